"""What can go wrong, one class a cause."""

from collections.abc import Mapping

import grpc
from google.rpc.error_details_pb2 import ErrorInfo
from grpc_status import rpc_status


class DynhullError(Exception):
    """A call that failed.

    Attributes:
        code: the gRPC status code.
        reason: the server's word for the cause, such as "POINT_MISSING"; empty where the server did not give one.
        field: the field of the request at fault, None where it is none in particular.
        row: the row of the points at fault, None where it is none in particular.
        value: the value at fault as text, or that of the limit exceeded; None where there is none.
        expected: of a gap in a producer's numbers, the number that should have come.
        oldest: of a revision that is forgotten, the oldest one that is not.
        batch: of an ingest, how many of its batches were applied before; None of other calls.
    """

    def __init__(self, message: str, code: grpc.StatusCode, reason: str, metadata: Mapping[str, str]) -> None:
        super().__init__(message)
        self.code = code
        self.reason = reason
        self.field = metadata.get("field")
        self.row = _number(metadata.get("row"))
        self.value = metadata.get("value")
        self.expected = _number(metadata.get("expected"))
        self.oldest = _number(metadata.get("oldest"))
        self.batch = _number(metadata.get("batch"))


class InvalidRequestError(DynhullError, ValueError):
    """A field of the request holds what it cannot hold; nothing has changed."""


class HullNotFoundError(DynhullError, LookupError):
    """There is no hull of that name."""


class HullExistsError(DynhullError):
    """There is a hull of that name already."""


class PointMissingError(DynhullError, LookupError):
    """A batch deletes a point that is not there; nothing of it was applied."""


class LimitExceededError(DynhullError):
    """The request goes beyond a limit of the server, such as the size of a message."""


class SequenceGapError(DynhullError):
    """A numbered batch came before the ones that precede it; `expected` is the number of the next one."""


class ProducerInUseError(DynhullError):
    """A writer's batch had been applied before it was sent: another writer uses the same producer name."""


class HullEmptyError(DynhullError, ValueError):
    """A question that a hull without points has no answer to."""


class HullUnsuitableError(DynhullError, ValueError):
    """A question that has no answer for a hull with such a point, which the message names."""


class RevisionForgottenError(DynhullError, LookupError):
    """A watch cannot be resumed from that revision: watch anew. `oldest` is the oldest one that could be resumed."""


class UnauthenticatedError(DynhullError):
    """The server wants a token, and got none or one that it does not know."""


class PermissionDeniedError(DynhullError, PermissionError):
    """The token does not allow it."""


class UnavailableError(DynhullError, ConnectionError):
    """There is no server at the address, or it is starting or shutting down."""


class OutcomeUnknownError(DynhullError):
    """The server's disk failed in the middle of the batch: it may have been applied or not.

    A Writer finds out by itself. Otherwise ask for the producer's last sequence number, or read the hull, before you
    send the batch again.
    """


class DeadlineError(DynhullError, TimeoutError):
    """The call took longer than its timeout."""


BY_REASON: Mapping[str, type[DynhullError]] = {
    "SEQUENCE_GAP": SequenceGapError,
    "HULL_EMPTY": HullEmptyError,
    "HULL_UNSUITABLE": HullUnsuitableError,
    "OUTCOME_UNKNOWN": OutcomeUnknownError,
}

BY_CODE: Mapping[grpc.StatusCode, type[DynhullError]] = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidRequestError,
    grpc.StatusCode.NOT_FOUND: HullNotFoundError,
    grpc.StatusCode.ALREADY_EXISTS: HullExistsError,
    grpc.StatusCode.FAILED_PRECONDITION: PointMissingError,
    grpc.StatusCode.OUT_OF_RANGE: RevisionForgottenError,
    grpc.StatusCode.UNAUTHENTICATED: UnauthenticatedError,
    grpc.StatusCode.PERMISSION_DENIED: PermissionDeniedError,
    grpc.StatusCode.RESOURCE_EXHAUSTED: LimitExceededError,
    grpc.StatusCode.UNAVAILABLE: UnavailableError,
    grpc.StatusCode.DEADLINE_EXCEEDED: DeadlineError,
}


def error_of(call: grpc.Call | grpc.RpcError) -> DynhullError:
    """The error that a finished call ended with."""
    code, message = call.code(), call.details() or ""
    info = ErrorInfo()
    status = rpc_status.from_call(call)
    for detail in [] if status is None else status.details:
        if detail.Is(ErrorInfo.DESCRIPTOR):
            detail.Unpack(info)
    kind = BY_REASON.get(info.reason) or BY_CODE.get(code, DynhullError)
    return kind(message or code.name, code, info.reason, info.metadata)


def _number(text: str | None) -> int | None:
    return None if text is None else int(text)
