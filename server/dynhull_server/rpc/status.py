"""Conversion of refusals to gRPC statuses with google.rpc details."""

import re
from collections.abc import Mapping

from google.protobuf.any_pb2 import Any
from google.protobuf.message import DecodeError, Message
from google.rpc import code_pb2 as code
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, PreconditionFailure, QuotaFailure, ResourceInfo
from google.rpc.status_pb2 import Status

from ..state.errors import (
    ConsumerNotFoundError,
    DiskFullError,
    FenceExistsError,
    FenceNotFoundError,
    FenceReplacedError,
    HullEmptyError,
    HullExistsError,
    HullFencedError,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    InvalidBatchError,
    InvalidFenceError,
    InvalidPlaceError,
    KeyMissingError,
    KeyRepeatedError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    PagesForgottenError,
    PointMissingError,
    RefusedError,
    RestoredError,
    RevisionForgottenError,
    SequenceAheadError,
    SequenceGapError,
    ShardAwayError,
    StoppingError,
)
from .access import PermissionDeniedError, TokensChangedError, UnauthenticatedError
from .decode import InvalidFieldError

DOMAIN = "dynhull.v1"
# The reason of TokensChangedError, for the gateway that gets it.
TOKENS_CHANGED = "TOKENS_CHANGED"
HULL_TYPE, FENCE_TYPE, CONSUMER_TYPE = "dynhull.v1.Hull", "dynhull.v1.Fence", "dynhull.v1.FenceConsumer"
# Statuses are sent as headers, whose size is limited.
LONGEST_VALUE = 120
# Numbers, points and counts such as "8 bytes" are shown as they are, names without spaces too.
PLAIN = re.compile(r"[!-~]+|\(.*\)|\d+ [a-z]+|[a-z]+ and [a-z]+")

PART_FIELDS = {"deletes": "batch.deletes", "origins": "batch.moves.origins"}


class DrainingError(Exception):
    """The server is shutting down."""


class StartingError(Exception):
    """The server is starting."""

    def __init__(self, words: str = "the server is reading its data") -> None:
        super().__init__(words)


class WorkerAwayError(StartingError):
    """The worker that has the hull is starting; the request has not reached it."""

    def __init__(self, worker: int) -> None:
        super().__init__(f"worker {worker}, which has this name, is starting")


class HullsApartError(RefusedError):
    """Two names that a request needs together belong to different workers.

    Attributes:
        field: the field of the second name.
        name: the second name.
    """

    def __init__(self, field: str, name: str, other: str) -> None:
        super().__init__(
            f"{field} is {name!r}: another worker has {other!r}; give both names the same part before the first "
            '"/", so that one worker has them'
        )
        self.field = field
        self.name = name


class RelayedError(Exception):
    """Another process of the server has refused the request.

    Attributes:
        status: its answer, which the caller gets as it is.
    """

    def __init__(self, status: Status) -> None:
        super().__init__(status.message)
        self.status = status


class ServiceUnknownError(RefusedError):
    """Health was requested of an unknown service."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no service {_short(name)!r}")
        self.name = name


class MethodUnknownError(RefusedError):
    """The method does not exist."""

    def __init__(self) -> None:
        super().__init__("there is no such method in this version of the server")


class PartRefusedError(Exception):
    """One of the batches of a request to several hulls was refused, and so none was applied.

    Attributes:
        index: the index of the batch in the request.
        reason: why it was refused.
    """

    def __init__(self, index: int, reason: Exception) -> None:
        super().__init__(index, reason)
        self.index = index
        self.reason = reason


ANSWERED = (
    RefusedError,
    InvalidFieldError,
    DecodeError,
    DrainingError,
    OutcomeUnknownError,
    PartRefusedError,
    RelayedError,
    StartingError,
    StoppingError,
    TokensChangedError,
)


def error_status(error: Exception, batch: int | None = None, within: str = "") -> Status:
    """The status for `error`, one of ANSWERED.

    Args:
        error: the error.
        batch: the number of batches that the call applied before it, or the index of the batch that was refused.
        within: the path of the message in the request whose fields the error names, with a point at its end.
    """
    where = {} if batch is None else {"batch": str(batch)}
    match error:
        case InvalidFieldError():
            return _invalid_field(within, error, where)
        case KeyRepeatedError():
            first = {"first_field": f"{within}batch.{error.first[0]}", "first_row": str(error.first[1])}
            return _invalid_field(within, _of_batch(error), first | where, "KEY_REPEATED")
        case InvalidBatchError():
            return _invalid_field(within, _of_batch(error), where)
        case PointMissingError():
            field, value = within + PART_FIELDS[error.part], _short(error.point)
            failure = PreconditionFailure()
            failure.violations.add(type="POINT_MISSING", subject=f"{field}[{error.row}]", description=str(error))
            message = f"{field}[{error.row}] is {value}: no such point to delete; nothing of the batch was applied"
            metadata = {"field": field, "row": str(error.row), "value": value, **where}
            return _status(code.FAILED_PRECONDITION, message, "POINT_MISSING", metadata, failure)
        case KeyMissingError():
            field, value = f"{within}batch.removes", _short(error.key)
            failure = PreconditionFailure()
            failure.violations.add(type="KEY_MISSING", subject=f"{field}[{error.row}]", description=str(error))
            message = f"{field}[{error.row}] is {value}: no such key to remove; nothing of the batch was applied"
            metadata = {"field": field, "row": str(error.row), "value": value, **where}
            return _status(code.FAILED_PRECONDITION, message, "KEY_MISSING", metadata, failure)
        case PartRefusedError():
            return error_status(error.reason, error.index, f"batches[{error.index}].")
        case HullNotFoundError():
            resource = ResourceInfo(resource_type=HULL_TYPE, resource_name=error.name, description=str(error))
            return _status(code.NOT_FOUND, str(error), "HULL_NOT_FOUND", {"value": error.name, **where}, resource)
        case HullsApartError():
            failure = PreconditionFailure()
            failure.violations.add(type="HULLS_APART", subject=error.name, description=str(error))
            metadata = {"field": error.field, "value": error.name}
            return _status(code.FAILED_PRECONDITION, str(error), "HULLS_APART", metadata, failure)
        case HullExistsError():
            resource = ResourceInfo(resource_type=HULL_TYPE, resource_name=error.name, description=str(error))
            return _status(code.ALREADY_EXISTS, str(error), "HULL_EXISTS", {"value": error.name}, resource)
        case FenceNotFoundError():
            resource = ResourceInfo(resource_type=FENCE_TYPE, resource_name=error.name, description=str(error))
            return _status(code.NOT_FOUND, str(error), "FENCE_NOT_FOUND", {"value": error.name}, resource)
        case ConsumerNotFoundError():
            resource = ResourceInfo(resource_type=CONSUMER_TYPE, resource_name=error.name, description=str(error))
            return _status(code.NOT_FOUND, str(error), "CONSUMER_NOT_FOUND", {"value": error.name}, resource)
        case FenceExistsError():
            resource = ResourceInfo(resource_type=FENCE_TYPE, resource_name=error.name, description=str(error))
            return _status(code.ALREADY_EXISTS, str(error), "FENCE_EXISTS", {"value": error.name}, resource)
        case FenceReplacedError():
            metadata = {"field": "uid", "value": error.name, "uid": error.uid}
            return _status(code.OUT_OF_RANGE, str(error), "FENCE_REPLACED", metadata)
        case InvalidPlaceError():
            return _invalid_field(within, InvalidFieldError(error.field, error.value, error.problem, error.row), where)
        case InvalidFenceError():
            return _invalid_field("config.", InvalidFieldError(error.field, error.value, error.problem), where)
        case HullFencedError():
            failure = PreconditionFailure()
            failure.violations.add(type="HULL_FENCED", subject=error.name, description=str(error))
            metadata = {"value": error.name} | ({} if error.fence is None else {"fence": error.fence})
            return _status(code.FAILED_PRECONDITION, str(error), "HULL_FENCED", metadata, failure)
        case SequenceAheadError():
            metadata = {"field": error.field, "value": str(error.sequence), "last": str(error.last)}
            return _status(code.OUT_OF_RANGE, str(error), "SEQUENCE_AHEAD", metadata)
        case RestoredError():
            failure = PreconditionFailure()
            failure.violations.add(type="RESTORED", subject=error.name, description=str(error))
            metadata = {"value": error.name, "uid": error.uid, "last": str(error.last), "expected": str(error.last + 1)}
            return _status(code.FAILED_PRECONDITION, str(error), "RESTORED", metadata | where, failure)
        case SequenceGapError():
            failure = PreconditionFailure()
            failure.violations.add(type="SEQUENCE_GAP", subject="sequence", description=str(error))
            metadata = {"field": "sequence", "value": str(error.sequence), "expected": str(error.expected), **where}
            return _status(code.FAILED_PRECONDITION, str(error), "SEQUENCE_GAP", metadata, failure)
        case HullEmptyError():
            failure = PreconditionFailure()
            failure.violations.add(type="HULL_EMPTY", subject=error.name, description=str(error))
            return _status(code.FAILED_PRECONDITION, str(error), "HULL_EMPTY", {"value": error.name}, failure)
        case HullUnsuitableError():
            failure = PreconditionFailure()
            failure.violations.add(type="HULL_UNSUITABLE", subject=error.name, description=str(error))
            point = {} if error.point is None else {"point": str(error.point)}
            unsuitable = {"field": within + error.field} if error.field else {}
            metadata = {**unsuitable, "value": error.name, **point, **where}
            return _status(code.FAILED_PRECONDITION, str(error), "HULL_UNSUITABLE", metadata, failure)
        case RevisionForgottenError():
            metadata = {"field": "resume.revision", "value": str(error.revision)}
            metadata |= {"oldest": str(error.oldest), "newest": str(error.newest)}
            return _status(code.OUT_OF_RANGE, str(error), "REVISION_FORGOTTEN", metadata)
        case PagesForgottenError():
            metadata = {"field": "vertex_page_token", "value": str(error.revision)}
            return _status(code.OUT_OF_RANGE, str(error), "REVISION_FORGOTTEN", metadata)
        case HullReplacedError():
            metadata = {"field": "resume.uid", "value": error.name, "uid": error.uid}
            return _status(code.OUT_OF_RANGE, str(error), "HULL_REPLACED", metadata)
        case UnauthenticatedError():
            return _status(code.UNAUTHENTICATED, str(error), "UNAUTHENTICATED", {})
        case PermissionDeniedError():
            metadata = {"scope": error.scope, "value": error.name}
            return _status(code.PERMISSION_DENIED, str(error), "PERMISSION_DENIED", metadata)
        case LimitExceededError():
            quota = QuotaFailure()
            quota.violations.add(subject=error.limit, description=str(error))
            metadata = {"limit": error.limit, "value": str(error.maximum), **where}
            return _status(code.RESOURCE_EXHAUSTED, str(error), "LIMIT_EXCEEDED", metadata, quota)
        case ServiceUnknownError():
            return _status(code.NOT_FOUND, str(error), "SERVICE_UNKNOWN", {"value": _short(error.name)})
        case MethodUnknownError():
            return _status(code.UNIMPLEMENTED, str(error), "METHOD_UNKNOWN", {})
        case DecodeError():
            return _status(
                code.INVALID_ARGUMENT, "these bytes are not the request's message", "MALFORMED_MESSAGE", where
            )
        case DiskFullError():
            quota = QuotaFailure()
            quota.violations.add(subject="disk", description=str(error))
            return _status(code.RESOURCE_EXHAUSTED, str(error), "DISK_FULL", {"limit": "disk", **where}, quota)
        case NotStoredError():
            return _status(code.UNAVAILABLE, str(error), "STORAGE_FAILED", where)
        case OutcomeUnknownError():
            return _status(code.UNKNOWN, str(error), "OUTCOME_UNKNOWN", where)
        case StartingError() | ShardAwayError():
            return _status(code.UNAVAILABLE, str(error), "STARTING", where)
        case TokensChangedError():
            return _status(code.UNAVAILABLE, str(error), TOKENS_CHANGED, where)
        case RelayedError():
            return error.status
        case DrainingError() | StoppingError():
            return _status(code.UNAVAILABLE, "the server is shutting down", "DRAINING", where)
    raise error


def _of_batch(error: InvalidBatchError) -> InvalidFieldError:
    return InvalidFieldError(f"batch.{error.field}", error.value, error.problem, error.row)


def _invalid_field(
    within: str, error: InvalidFieldError, where: Mapping[str, str], reason: str = "INVALID_FIELD"
) -> Status:
    row = {} if error.row is None else {"row": str(error.row)}
    value = _short(error.value)
    name = within + error.field
    field = name if error.row is None else f"{name}[{error.row}]"
    detail = BadRequest()
    detail.field_violations.add(field=field, description=f"{error.problem}, got {_quoted(value)}")
    message = f"{field} is {_quoted(value)}: {error.problem}"
    metadata = {"field": name, **row, "value": value, **where}
    return _status(code.INVALID_ARGUMENT, message, reason, metadata, detail)


def _status(number: int, message: str, reason: str, metadata: Mapping[str, str], *details: Message) -> Status:
    status = Status(code=number, message=message)
    for detail in (ErrorInfo(reason=reason, domain=DOMAIN, metadata=metadata), *details):
        packed = Any()
        packed.Pack(detail)
        status.details.append(packed)
    return status


def _quoted(value: str) -> str:
    """The value in quotation marks if it could be misread without: because it is empty or has spaces around a text."""
    return value if PLAIN.fullmatch(value) else repr(value)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}... ({len(text)} characters)"
