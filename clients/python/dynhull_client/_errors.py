"""The errors a call may end with, one class for each cause."""

import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import grpc
from google.rpc.error_details_pb2 import ErrorInfo
from grpc_status import rpc_status

import dynhull
from dynhull_proto.v1.hull_service_pb2 import ReadError
from dynhull_surface.reasons import REASONS, Code

__all__ = [
    "AlarmExistsError",
    "AlarmNotFoundError",
    "AlarmNotRaisedError",
    "AlarmReplacedError",
    "ConsumerNotFoundError",
    "DeadlineError",
    "DuplicateKeyError",
    "DynhullError",
    "FenceExistsError",
    "FenceNotFoundError",
    "FenceReplacedError",
    "HullEmptyError",
    "HullExistsError",
    "HullFencedError",
    "HullNotFoundError",
    "HullReplacedError",
    "HullUnsuitableError",
    "InvalidRequestError",
    "KeyMissingError",
    "LimitExceededError",
    "MethodUnknownError",
    "OutcomeUnknownError",
    "PastDamagedError",
    "PermissionDeniedError",
    "PointMissingError",
    "ProducerInUseError",
    "RestoredError",
    "RevisionForgottenError",
    "SequenceAheadError",
    "SequenceGapError",
    "StaleCopyError",
    "UnauthenticatedError",
    "UnavailableError",
]

DOMAIN = "dynhull.v1"
OF_SEVERAL = re.compile(r"batches\[\d+\]\.")
ROWS = re.compile(r"\b(puts\.keys|removes|releases|drops) row")


class DynhullError(Exception):
    """A call failed. A reason that this version of the client does not know is an error of this class itself.

    Attributes:
        code: the gRPC status code.
        reason: the server's machine-readable reason, such as "POINT_MISSING"; empty if the server gave none.
        metadata: what else the server reports, as text.
        problem: the message without the argument, its row and its value at the beginning, if these are there.
        field: the field of the request at fault, by its name on the wire; None if no single field is.
        row: the row of that field at fault; None if no single row is.
        value: the value at fault as text, or the limit that was exceeded; None if there is none.
        expected: after a gap in a producer's numbers, the next number.
        oldest: after a forgotten revision, the oldest revision the server remembers.
        batch: for an ingest, the number of batches applied before the error; None for other calls.
    """

    code: grpc.StatusCode
    reason: str
    metadata: Mapping[str, str]
    problem: str
    field: str | None
    row: int | None
    value: str | None
    expected: int | None
    oldest: int | None
    batch: int | None

    def __init__(self, message: str, code: grpc.StatusCode, reason: str, metadata: Mapping[str, str]) -> None:
        self.problem = _problem(message, metadata)
        super().__init__(message if self.problem == message else _in_arguments(message, self.problem, metadata))
        self.code = code
        self.reason = reason
        self.metadata = MappingProxyType(dict(metadata))
        self.field = metadata.get("field")
        self.row = _number(metadata.get("row"))
        self.value = metadata.get("value")
        self.expected = _number(metadata.get("expected"))
        self.oldest = _number(metadata.get("oldest"))
        self.batch = _number(metadata.get("batch"))

    def __reduce__(self) -> tuple[Any, ...]:
        """What pickle and copy make it again from: process pools hand errors on."""
        more = {name: value for name, value in vars(self).items() if name != "metadata"}
        return type(self), (str(self), self.code, self.reason, dict(self.metadata)), more


class InvalidRequestError(DynhullError, ValueError):
    """A field of the request has a value that is not allowed; nothing has changed."""


class HullNotFoundError(DynhullError, LookupError):
    """There is no hull of that name."""


class HullExistsError(DynhullError):
    """There is already a hull of that name."""


class PointMissingError(DynhullError, LookupError):
    """A batch deletes a point that is not in the hull; nothing of the batch was applied."""


class DuplicateKeyError(InvalidRequestError):
    """A batch names a key twice, in the rows `first_row` and `row`; nothing of it was applied."""

    @property
    def first_row(self) -> int | None:
        """The row that names the key first; `row` names it again."""
        return _number(self.metadata.get("first_row"))


class KeyMissingError(DynhullError, LookupError):
    """A batch removes a key that is not in the hull; nothing of the batch was applied."""


class LimitExceededError(DynhullError):
    """The request exceeds a limit of the server, such as the size of a message."""


class SequenceGapError(DynhullError):
    """A numbered batch arrived before its predecessors; `expected` is the next number."""


class ProducerInUseError(DynhullError):
    """A writer's batch had been applied before it was sent: another writer uses the same producer name."""


class PastDamagedError(DynhullError):
    """A part of the past of a hull is missing or damaged on the server. The message names its revisions."""


class RestoredError(DynhullError):
    """The hull was restored from a backup that lacks some of the producer's batches; nothing was applied.

    `last` is the number of the producer's last batch that the backup has. A new writer with the name of this producer
    begins there: give it everything after that batch again.
    """

    @property
    def last(self) -> int | None:
        """The number of the last batch that the hull has; 0 if it has none."""
        return _number(self.metadata.get("last"))

    @property
    def uid(self) -> str | None:
        """The present uid of the hull."""
        return self.metadata.get("uid")


class MethodUnknownError(DynhullError, NotImplementedError):
    """The server is older than this client, and does not know the call; nothing has changed."""


class HullEmptyError(DynhullError, ValueError):
    """The query has no answer for a hull without points."""


class HullUnsuitableError(DynhullError, ValueError):
    """The hull is not of the kind that the call needs: keyed or not, or with other points; the message says which."""


class RevisionForgottenError(DynhullError, LookupError):
    """A watch cannot resume from that revision: start it again. `oldest` is the oldest revision it can resume from."""


class HullReplacedError(RevisionForgottenError):
    """A watch cannot resume, or a past is gone: the hull was restored from a backup, or deleted and created again."""


class FenceNotFoundError(DynhullError, LookupError):
    """There is no fence of that name."""


class FenceExistsError(DynhullError):
    """There is already a fence of that name."""


class FenceReplacedError(DynhullError, LookupError):
    """The fence was restored from a backup, or deleted, and another one has its name: it has other sequences."""


class AlarmNotFoundError(DynhullError, LookupError):
    """There is no alarm of that name."""


class AlarmExistsError(DynhullError):
    """There is already an alarm of that name."""


class AlarmNotRaisedError(DynhullError, ValueError):
    """The alarm is not raised for the hull, so that nobody can acknowledge it."""


class AlarmReplacedError(DynhullError, LookupError):
    """The alarm was restored from a backup, or deleted, and another one has its name: it has other sequences."""


class SequenceAheadError(DynhullError, ValueError):
    """A sequence is after the last event of the fence or alarm, `last`."""

    @property
    def last(self) -> int | None:
        """The sequence of the last event."""
        return _number(self.metadata.get("last"))


class ConsumerNotFoundError(DynhullError, LookupError):
    """The fence, the alarm or the feed has no consumer of that name."""


class HullFencedError(DynhullError):
    """The hull cannot be deleted, because a fence or an alarm names it; `fence` or `alarm` is the name of one."""

    @property
    def fence(self) -> str | None:
        """The name of a fence to delete first; None if it is an alarm, or the token may not read it."""
        return self.metadata.get("fence")

    @property
    def alarm(self) -> str | None:
        """The name of an alarm to delete first; None if it is a fence, or the token may not read it."""
        return self.metadata.get("alarm")


class UnauthenticatedError(DynhullError):
    """The server requires a token and received none, or one that it does not know."""


class PermissionDeniedError(DynhullError, PermissionError):
    """The token does not allow the call."""


class UnavailableError(DynhullError, ConnectionError):
    """No server answers at the address, or it is starting or shutting down."""


class StaleCopyError(DynhullError, TimeoutError):
    """A copy has not heard of its hull for longer than its `max_staleness`: the watch is interrupted, or not read."""


class OutcomeUnknownError(DynhullError):
    """The server's disk failed during the batch, which may or may not have been applied.

    A Writer resolves this itself. Otherwise read the producer's last sequence number, or the hull, before you send the
    batch again.
    """


class DeadlineError(DynhullError, TimeoutError):
    """The call took longer than its timeout."""


BY_REASON: Mapping[str, type[DynhullError]] = {name: globals()[reason.error] for name, reason in REASONS.items()}
# What gRPC itself and proxies answer, without a reason. The server gives a reason with every refusal.
BY_CODE: Mapping[str, type[DynhullError]] = {code.name: globals()[code.error] for code in Code}

CODES: Mapping[int, grpc.StatusCode] = {code.value[0]: code for code in grpc.StatusCode}


# What gRPC's asyncio says of a call that ended while a message was sent; the status that it ended with is lost.
ENDED_IN_A_WRITE = "Internal error from Core"
# What gRPC says of a call that this process has cancelled.
CANCELLED_HERE = "Locally cancelled by application!", "Channel closed!"
# What servers say of calls that they have not begun: those that stop (github.com/grpc/grpc/issues/41785), and those
# where too many wait. Of calls that they have begun, and do not complete in time, servers that stop say that all calls
# are cancelled, with the code UNAVAILABLE.
CANCELLED_UNBEGUN = "CANCELLED"
# What gRPC says of calls that the server has refused before it has looked at them (RFC 9113, 8.7), because their
# connection has too many.
REFUSED_UNBEGUN = "(Received RST_STREAM with error code 7)"
# What gRPC says of calls for which there is no connection.
NOT_CONNECTED = "failed to connect to all addresses", "DNS resolution failed"
# What gRPC says of an answer that is not one of gRPC; of the status 404 with the code of an unknown method.
NOT_GRPC = "Received http2 header with status: "


def error_of(call: grpc.Call | grpc.RpcError, method: str, proxy: str | None = None) -> DynhullError:
    """The error that a finished call of a method ended with; it names the proxy, if gRPC asks one for connections."""
    if call.code() == grpc.StatusCode.INTERNAL and call.details() == ENDED_IN_A_WRITE:
        # The code stays: to those who send again, it means that the message itself may be the cause.
        return UnavailableError("the connection was lost while a message was sent", grpc.StatusCode.INTERNAL, "", {})
    status = rpc_status.from_call(call)
    if status is None and call.code() == grpc.StatusCode.CANCELLED and call.details() not in CANCELLED_HERE:
        if call.details() == CANCELLED_UNBEGUN:
            why, reason = "has not begun the call: it stops, or too many wait there; try again", "DRAINING"
        else:
            why, reason = "ended the call, as one that stops", ""
        return UnavailableError(f"the server {why}", grpc.StatusCode.UNAVAILABLE, reason, {})
    message = call.details()
    if status is None and call.code() == grpc.StatusCode.UNAVAILABLE and message and REFUSED_UNBEGUN in message:
        why = "the server has not begun the call: too many of this connection wait there; try again"
        return UnavailableError(why, grpc.StatusCode.UNAVAILABLE, "TOO_MANY_CALLS", {})
    if proxy is not None and message is not None and message.startswith(NOT_CONNECTED):
        message += f" (through the proxy {proxy})"
    if call.code() == grpc.StatusCode.UNIMPLEMENTED:
        if message is not None and message.startswith(NOT_GRPC):
            return DynhullError(f"no gRPC server answers at this address: {message}", call.code(), "", {})
        message = _unknown(method)
    return _error(call.code(), message, () if status is None else status.details)


def not_sent(error: DynhullError) -> bool:
    """Whether nothing of the call was sent, because there was no connection."""
    return error.code == grpc.StatusCode.UNAVAILABLE and not error.reason and str(error).startswith(NOT_CONNECTED)


def error_of_read(error: ReadError) -> DynhullError:
    """The error that a read of a Query call was answered with."""
    return _error(CODES.get(error.code, grpc.StatusCode.UNKNOWN), error.message, error.details)


def _unknown(method: str) -> str:
    return (
        f"the server does not know the call {method}: it is older than its client, dynhull {dynhull.__version__}; "
        "upgrade the server first"
    )


def _error(code: grpc.StatusCode, message: str | None, details: Iterable[Any]) -> DynhullError:
    info = _error_info(details)
    if info.reason:
        return BY_REASON.get(info.reason, DynhullError)(message or code.name, code, info.reason, info.metadata)
    return BY_CODE.get(code.name, DynhullError)(message or code.name, code, "", {})


def _problem(message: str, metadata: Mapping[str, str]) -> str:
    """A message of the server without the field, the row and the value before it."""
    place, value = metadata.get("field", ""), metadata.get("value", "")
    if "row" in metadata:
        place += f"[{metadata['row']}]"
    for shown in (value, repr(value)):
        if message.startswith(start := f"{place} is {shown}: "):
            return message.removeprefix(start)
    return message


def _in_arguments(message: str, problem: str, metadata: Mapping[str, str]) -> str:
    """A message with arguments of the SDK in place of the fields of the request."""
    field, row = metadata["field"], metadata.get("row")
    start = len(field) if row is None else len(f"{field}[{row}]")
    shown = message[start : len(message) - len(problem)]
    problem = ROWS.sub(lambda each: f"{_argument(f'batch.{each[1]}')} row", problem)
    return f"{_argument(field)}{'' if row is None else f' row {row}'}{shown}{problem}"


def _argument(field: str) -> str:
    from dynhull_surface.names import find  # seldom needed

    of_several = OF_SEVERAL.match(field)
    above = of_several[0] if of_several else ""
    found = find(field.removeprefix(above))
    return field if found is None else f"{above}{found.argument}"


def _error_info(details: Iterable[Any]) -> ErrorInfo:
    """The server's reason; without one where something else answered."""
    for detail in details:
        info = ErrorInfo()
        if detail.Unpack(info) and info.domain == DOMAIN:
            return info
    return ErrorInfo()


def _number(text: str | None) -> int | None:
    return int(text) if text is not None and text.isdecimal() else None
