"""A channel to a server, and how calls begin on it."""

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import grpc

from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

from .calls import Call
from .errors import DynhullError
from .retry import Attempts

DEFAULT_ADDRESS = "127.0.0.1:50051"
DEFAULT_TIMEOUT = 30.0
DEFAULT_RETRIES = 3
MAX_MESSAGE_BYTES = 2**31 - 1

OPTIONS = [
    # The server's limits are the ones that count.
    ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
    ("grpc.max_send_message_length", MAX_MESSAGE_BYTES),
    # A server that was restarted is found within a second; by default gRPC may take two minutes.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 1000),
]


class Connection:
    """What `HullClient` and `AsyncHullClient` have in common.

    Every method raises a `DynhullError`: `UnavailableError` where there is no server, `DeadlineError` after the
    timeout, `HullNotFoundError` where there is no such hull, `InvalidRequestError` where the server refuses a value.
    Arrays that are no finite points raise ValueError or TypeError, as in `dynhull`, and nothing is sent.

    Args:
        address: host:port.
        timeout: seconds a call may take unless the call says otherwise; None for no limit. Ingests, writers and watches
            have none of themselves.
        wait_for_ready: whether calls wait, within their timeout, for a server that is not there yet.
        token: the bearer token to show. Over an encrypted connection only, or on this machine.
        tls: TLS with the server; None for none. `grpc.ssl_channel_credentials()` trusts what the machine trusts; it
            also takes a root certificate, and a client's key and certificate.
        retries: how often a call is made again that found no server, after a growing pause. Only calls that may be
            repeated: reads, and batches with a producer and a sequence.

    Attributes:
        blocking: makes another connection with the same arguments, for threads.
    """

    _grpc: ClassVar[Any] = grpc

    def __init__(
        self,
        address: str = DEFAULT_ADDRESS,
        *,
        timeout: float | None = DEFAULT_TIMEOUT,
        wait_for_ready: bool = False,
        token: str | None = None,
        tls: grpc.ChannelCredentials | None = None,
        retries: int = DEFAULT_RETRIES,
    ) -> None:
        self.address = address
        self.blocking = partial(
            Connection,
            address,
            timeout=timeout,
            wait_for_ready=wait_for_ready,
            token=token,
            tls=tls,
            retries=retries,
        )
        self._timeout = timeout
        self._retries = retries
        self._wait_for_ready = wait_for_ready
        self._closed = False
        # Call credentials would do the same, but gRPC sends them over TLS only, and a local server needs none of that.
        self._metadata = () if token is None else (("authorization", f"Bearer {token}"),)
        if tls is None:
            self.channel = self._grpc.insecure_channel(address, OPTIONS)
        else:
            self.channel = self._grpc.secure_channel(address, tls, OPTIONS)
        self.stub: Any = HullServiceStub(self.channel)

    def begin(self, method: Callable[..., Any], requests: Any, timeout: float | None) -> Any:
        """Begin a call: a method of the stub with a message, or with an iterator of messages."""
        if self._closed:
            raise DynhullError("the client is closed", grpc.StatusCode.CANCELLED, "", {})
        return method(requests, timeout=timeout, metadata=self._metadata, wait_for_ready=self._wait_for_ready)

    def attempts(self, call: Call[Any]) -> Attempts:
        """The attempts that a call may have."""
        timeout = self._timeout if call.timeout is None else call.timeout
        return Attempts(timeout, self._retries if call.repeatable else 0)
