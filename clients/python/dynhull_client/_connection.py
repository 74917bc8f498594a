"""A channel to a server, and calls on it."""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace
from threading import Condition, Event
from types import SimpleNamespace
from typing import Any, ClassVar, Self, TypeVar

import grpc

from dynhull_proto.v1.alarm_service_pb2_grpc import AlarmServiceStub
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

from ._address import is_local, proxy_of, target
from ._arguments import require_not_negative
from ._calls import Call
from ._errors import DynhullError, error_of, not_sent
from ._home import Home, require_grpc
from ._retry import Attempts

DEFAULT_ADDRESS = "127.0.0.1:50051"
DEFAULT_TIMEOUT = 30.0
DEFAULT_RETRIES = 3
DEFAULT_PING_INTERVAL = 10.0
MAX_MESSAGE_BYTES = 2**31 - 1

OPTIONS = [
    # Only the server's limits apply.
    ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
    ("grpc.max_send_message_length", MAX_MESSAGE_BYTES),
    # Finds a server that begins to listen before the last of the default retries; gRPC may take two minutes otherwise.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 250),
    ("grpc.keepalive_permit_without_calls", 1),
    ("grpc.http2.max_pings_without_data", 0),
    # A connection of its own: one that is dead would be shared with all new clients of the process.
    ("grpc.use_local_subchannel_pool", 1),
]

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, repr=False)  # a token is no text for tracebacks
class Dialling:
    """How to connect, and how calls are made. Attributes as the arguments of `HullClient`."""

    timeout: float | None
    wait_for_ready: bool
    token: str | None
    tls: grpc.ChannelCredentials | None
    retries: int
    ping_interval: float
    read_ahead: int | None


class Connection:
    """A channel with what every call on it needs.

    Attributes:
        address: host:port.
        retries: how often a call that reached no server is repeated.
    """

    _grpc: ClassVar[Any]
    _event: ClassVar[type[Any]]

    def __init__(self, address: str, dialling: Dialling) -> None:
        read_ahead = dialling.read_ahead
        require_not_negative(timeout=dialling.timeout, retries=dialling.retries, read_ahead=read_ahead)
        self._options = [*OPTIONS, *_pings(dialling.ping_interval)]
        if read_ahead is not None:
            self._options += [("grpc.http2.lookahead_bytes", read_ahead), ("grpc.http2.bdp_probe", 0)]
        self.address, encrypted = target(address)
        if is_local(self.address):
            self._options.append(("grpc.enable_http_proxy", 0))
        self._proxy = proxy_of(self.address)
        if dialling.tls is None and encrypted:
            dialling = replace(dialling, tls=grpc.ssl_channel_credentials())
        self._dialling = dialling
        self.retries = dialling.retries
        self._closed = self._event()  # shared with those of other tokens
        self._metadata = _authorization(dialling.token)
        self._open()

    @property
    def stub(self) -> SimpleNamespace:
        """The methods of all services, whose names differ."""
        return self._stub

    def with_token(self, token: str | None) -> Self:
        """The same connection for a caller with another token; None for none."""
        other = copy(self)
        other._metadata = _authorization(token)
        other._dialling = replace(self._dialling, token=token)
        return other

    def begin(self, method: Callable[..., Any], requests: Any, timeout: float | None) -> Any:
        """Begin a call: a method of the stub with a message, or with an iterator of messages."""
        if self._closed.is_set():
            raise client_is_closed()
        return method(requests, timeout=timeout, metadata=self._metadata, wait_for_ready=self._dialling.wait_for_ready)

    @property
    def closed(self) -> bool:
        """Whether it is closed."""
        return bool(self._closed.is_set())

    def error_of(self, call: grpc.Call | grpc.RpcError, method: str) -> DynhullError:
        """The error that a finished call of a method ended with."""
        error = error_of(call, method, self._proxy)
        if not_sent(error):
            tls = "without" if self._dialling.tls is None else "with"
            error.add_note(f"Is a server running at {self.address} (dynhull serve), {tls} TLS?")
        return error

    def _open(self) -> None:
        require_grpc()
        if (tls := self._dialling.tls) is None:
            self._channel = self._grpc.insecure_channel(self.address, self._options)
        else:
            self._channel = self._grpc.secure_channel(self.address, tls, self._options)
        stubs = HullServiceStub(self._channel), FenceServiceStub(self._channel), AlarmServiceStub(self._channel)
        self._stub = SimpleNamespace(**{name: method for stub in stubs for name, method in vars(stub).items()})

    def _attempts(self, call: Call[Any]) -> Attempts:
        return Attempts(call, self._dialling.timeout if call.timeout is None else call.timeout, self.retries)


def _pings(seconds: float) -> list[tuple[str, int]]:
    """The options of a connection that is lost when a ping has no answer for as long as is between two of them."""
    if not seconds > 0:
        raise ValueError(f"ping_interval must be more than 0, got {seconds}")
    milliseconds = max(1, round(seconds * 1000))
    return [
        ("grpc.keepalive_time_ms", milliseconds),
        ("grpc.keepalive_timeout_ms", milliseconds),
        ("grpc.http2.ping_timeout_ms", milliseconds),  # of other pings, which a ping of keepalive would wait for
    ]


def _authorization(token: str | None) -> tuple[tuple[str, str], ...]:
    """The metadata of every call; ValueError for a token that metadata cannot have.

    Call credentials would do the same, but gRPC sends them over TLS only, which a local server does not need.
    """
    if token is None:
        return ()
    if not (token.isascii() and token.isprintable() and " " not in token):
        raise ValueError("token must consist of printable ASCII characters without spaces")
    return (("authorization", f"Bearer {token}"),)


def client_is_closed() -> DynhullError:
    """What calls of a closed client end with."""
    return DynhullError("the client is closed", grpc.StatusCode.CANCELLED, "", {})


class BlockingConnection(Connection):
    """A connection whose calls block the thread. Threads may share it. In a forked process it is opened anew."""

    _grpc: ClassVar[Any] = grpc
    _event = Event

    def __init__(self, address: str, dialling: Dialling) -> None:
        super().__init__(address, dialling)
        self._news = Condition()
        self._home = Home("client")

    @property
    def stub(self) -> SimpleNamespace:
        """The methods of both services, on the channel of this process."""
        if self._home.left():
            self._inherited = self._channel  # to close it would wait for threads that are not here
            self._news = Condition()
            self._open()
            self._home = Home("client")
        return self._stub

    def begin(self, method: Callable[..., Any], requests: Any, timeout: float | None) -> Any:
        """Begin a call; an error of ours, too, if another thread closes the connection meanwhile."""
        try:
            return super().begin(method, requests, timeout)
        except ValueError:
            if self._closed.is_set():
                raise client_is_closed() from None
            raise

    def answer(
        self,
        call: Call[Result],
        hold: Callable[[Any], None] | None = None,
        ended: Callable[[], bool] = lambda: False,
    ) -> Result:
        """Make a call, again if it may be repeated, and return its answer.

        Args:
            call: the call.
            hold: called with what cancels each attempt, if another thread may.
            ended: whether the caller does not wait any more; `wake` has it asked again.
        """
        attempts = self._attempts(call)
        while True:
            method = getattr(self.stub, call.method)
            try:
                if hold is None:
                    begun = self.begin(method, call.request, attempts.timeout())
                    return call.decode(list(begun) if call.in_parts else begun)
                hold(begun := self.begin(method.future, call.request, attempts.timeout()))
                return call.decode(begun.result())
            except grpc.FutureCancelledError:
                raise self.error_of(begun, call.method) from None
            except grpc.RpcError as failure:
                call, pause = attempts.after(call, self.error_of(failure, call.method))
            self.pause(pause, ended)

    def parts(self, call: Call[Result]) -> Iterator[Result]:
        """Make a call that is answered by a stream, and return what is decoded of each message of it.

        It may be repeated until the first message is there. It has no limit of time but its own.
        """
        attempts, begun = Attempts(call, call.timeout, self.retries), False
        while True:
            stream = self.begin(getattr(self.stub, call.method), call.request, attempts.timeout())
            try:
                for message in stream:
                    begun = True
                    yield call.decode(message)
                return
            except grpc.RpcError as failure:
                error = self.error_of(failure, call.method)
                if begun:
                    raise error from None
                call, pause = attempts.after(call, error)
            finally:
                stream.cancel()
            self.pause(pause, lambda: False)

    def pause(self, seconds: float, ended: Callable[[], bool]) -> None:
        """Wait before a new attempt, while the connection is open and `ended` returns False."""
        with self._news:
            self._news.wait_for(lambda: self._closed.is_set() or ended(), seconds)

    def wake(self) -> None:
        """Have those who pause ask again whether they go on."""
        with self._news:
            self._news.notify_all()

    def close(self) -> None:
        """End the connection and the calls on it."""
        self._closed.set()
        if self._home.left():
            return
        self.wake()
        self._channel.close()
