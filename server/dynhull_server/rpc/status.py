"""Conversion of refusals to gRPC statuses with google.rpc details."""

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from google.protobuf import any_pb2
from google.protobuf.message import DecodeError, Message
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, PreconditionFailure, QuotaFailure, ResourceInfo
from google.rpc.status_pb2 import Status

from dynhull_surface.reasons import REASONS, Code

from ..state.errors import (
    AlarmExistsError,
    AlarmNotFoundError,
    AlarmNotRaisedError,
    AlarmReplacedError,
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
    MomentForgottenError,
    NotStoredError,
    OutcomeUnknownError,
    PagesForgottenError,
    PartRefusedError,
    PastDamagedError,
    PointMissingError,
    PositionForgottenError,
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
STOPPING = "the server is shutting down"
HULL_TYPE, FENCE_TYPE, CONSUMER_TYPE = "dynhull.v1.Hull", "dynhull.v1.Fence", "dynhull.v1.FenceConsumer"
ALARM_TYPE = "dynhull.v1.Alarm"
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


class Refusal(NamedTuple):
    """What the status of an error says. Its code follows from the reason, and from the code what it is about.

    Attributes:
        reason: the reason.
        metadata: from an error, the field at fault, its value, and more.
        resource: the type of what is missing, or exists already.
        subject: what a precondition is about; the value at fault unless given.
        message: the message; that of the error unless given.
    """

    reason: str
    metadata: Callable[[Any], Mapping[str, object]] = lambda _: {}
    resource: str = ""
    subject: str = ""
    message: str = ""


def _name(error: Any) -> Mapping[str, object]:
    return {"value": error.name}


REFUSALS: Mapping[type[Exception], Refusal] = {
    AlarmExistsError: Refusal("ALARM_EXISTS", _name, ALARM_TYPE),
    AlarmNotFoundError: Refusal("ALARM_NOT_FOUND", _name, ALARM_TYPE),
    AlarmNotRaisedError: Refusal("ALARM_NOT_RAISED", lambda e: {"field": "hull", "value": e.hull}),
    AlarmReplacedError: Refusal("ALARM_REPLACED", lambda e: {"field": "uid", "value": e.name, "uid": e.uid}),
    ConsumerNotFoundError: Refusal("CONSUMER_NOT_FOUND", _name, CONSUMER_TYPE),
    DecodeError: Refusal("MALFORMED_MESSAGE", message="these bytes are not the request's message"),
    DiskFullError: Refusal("DISK_FULL", lambda _: {"limit": "disk"}),
    DrainingError: Refusal("DRAINING", message=STOPPING),
    FenceExistsError: Refusal("FENCE_EXISTS", _name, FENCE_TYPE),
    FenceNotFoundError: Refusal("FENCE_NOT_FOUND", _name, FENCE_TYPE),
    FenceReplacedError: Refusal("FENCE_REPLACED", lambda e: {"field": "uid", "value": e.name, "uid": e.uid}),
    HullEmptyError: Refusal("HULL_EMPTY", _name),
    HullExistsError: Refusal("HULL_EXISTS", _name, HULL_TYPE),
    HullFencedError: Refusal("HULL_FENCED", lambda e: {"value": e.name, e.what: e.fence}),
    HullNotFoundError: Refusal("HULL_NOT_FOUND", _name, HULL_TYPE),
    HullReplacedError: Refusal("HULL_REPLACED", lambda e: {"field": e.field, "value": e.name, "uid": e.uid}),
    HullUnsuitableError: Refusal(
        "HULL_UNSUITABLE", lambda e: {"field": e.field or None, "value": e.name, "point": e.point}
    ),
    HullsApartError: Refusal("HULLS_APART", lambda e: {"field": e.field, "value": e.name}),
    LimitExceededError: Refusal("LIMIT_EXCEEDED", lambda e: {"limit": e.limit, "value": e.maximum}),
    MethodUnknownError: Refusal("METHOD_UNKNOWN"),
    NotStoredError: Refusal("STORAGE_FAILED"),
    OutcomeUnknownError: Refusal("OUTCOME_UNKNOWN"),
    PagesForgottenError: Refusal("REVISION_FORGOTTEN", lambda e: {"field": "vertex_page_token", "value": e.revision}),
    PositionForgottenError: Refusal("REVISION_FORGOTTEN", lambda _: {"field": "position"}),
    PastDamagedError: Refusal("PAST_DAMAGED"),
    PermissionDeniedError: Refusal("PERMISSION_DENIED", lambda e: {"scope": e.scope, "value": e.name}),
    RestoredError: Refusal(
        "RESTORED", lambda e: {"value": e.name, "uid": e.uid, "last": e.last, "expected": e.last + 1}
    ),
    MomentForgottenError: Refusal(
        "REVISION_FORGOTTEN",
        lambda e: {"field": e.field, "value": str(e.time), "oldest": e.oldest, "newest": e.newest},
    ),
    RevisionForgottenError: Refusal(
        "REVISION_FORGOTTEN",
        lambda e: {"field": e.field, "value": e.revision, "oldest": e.oldest, "newest": e.newest},
    ),
    SequenceAheadError: Refusal("SEQUENCE_AHEAD", lambda e: {"field": e.field, "value": e.sequence, "last": e.last}),
    SequenceGapError: Refusal(
        "SEQUENCE_GAP",
        lambda e: {"field": "sequence", "value": e.sequence, "expected": e.expected, "uid": e.uid or None},
        subject="sequence",
    ),
    ServiceUnknownError: Refusal("SERVICE_UNKNOWN", lambda e: {"value": _short(e.name)}),
    ShardAwayError: Refusal("STARTING"),
    StartingError: Refusal("STARTING"),
    StoppingError: Refusal("DRAINING", message=STOPPING),
    TokensChangedError: Refusal(TOKENS_CHANGED),
    UnauthenticatedError: Refusal("UNAUTHENTICATED"),
}


def error_status(error: Exception, batch: int | None = None, within: str = "") -> Status:
    """The status for `error`, one of ANSWERED.

    Args:
        error: the error.
        batch: the number of batches that the call applied before it, or the index of the batch that was refused.
        within: the path of the message in the request whose fields the error names, with a point at its end.
    """
    where = {} if batch is None else {"batch": str(batch)}
    match error:
        case PartRefusedError():
            return error_status(error.reason, error.index, f"batches[{error.index}].")
        case RelayedError():
            return error.status
        case InvalidFieldError():
            return _invalid_field(within, error, where)
        case KeyRepeatedError():
            first = {"first_field": f"{within}batch.{error.first[0]}", "first_row": str(error.first[1])}
            return _invalid_field(within, _of_batch(error), first | where, "KEY_REPEATED")
        case InvalidBatchError():
            return _invalid_field(within, _of_batch(error), where)
        case InvalidPlaceError():
            return _invalid_field(within, InvalidFieldError(error.field, error.value, error.problem, error.row), where)
        case InvalidFenceError():
            return _invalid_field("config.", InvalidFieldError(error.field, error.value, error.problem), where)
        case PointMissingError():
            field = within + PART_FIELDS[error.part]
            return _missing(error, "POINT_MISSING", field, error.point, "point to delete", where)
        case KeyMissingError():
            return _missing(error, "KEY_MISSING", f"{within}batch.removes", error.key, "key to remove", where)
        case _:
            return _refused(error, within, where)


def _refused(error: Exception, within: str, where: dict[str, str]) -> Status:
    """The status of an error of `REFUSALS`. Raises the error if it is none of them."""
    refusal = next((REFUSALS[each] for each in type(error).__mro__ if each in REFUSALS), None)
    if refusal is None:
        raise error
    metadata = {name: str(value) for name, value in refusal.metadata(error).items() if value is not None}
    if isinstance(error, HullUnsuitableError) and error.field:
        metadata["field"] = within + error.field
    detail = _detail(refusal, metadata, str(error))
    return _status(refusal.reason, refusal.message or str(error), metadata | where, *detail)


def _detail(refusal: Refusal, metadata: Mapping[str, str], description: str) -> list[Message]:
    """What the refusal is about, as google.rpc has it for its code."""
    code, value = REASONS[refusal.reason].code, metadata.get("value", "")
    if refusal.resource:
        return [ResourceInfo(resource_type=refusal.resource, resource_name=value, description=description)]
    if code is Code.FAILED_PRECONDITION:
        return [_failed(refusal.reason, refusal.subject or value, description)]
    if code is Code.RESOURCE_EXHAUSTED:
        quota = QuotaFailure()
        quota.violations.add(subject=metadata["limit"], description=description)
        return [quota]
    return []


def _missing(
    error: PointMissingError | KeyMissingError,
    reason: str,
    field: str,
    value: object,
    what: str,
    where: Mapping[str, str],
) -> Status:
    """The status where a batch names what the hull does not have."""
    place, shown = f"{field}[{error.row}]", _short(value)
    message = f"{place} is {shown}: no such {what}; nothing of the batch was applied"
    metadata = {"field": field, "row": str(error.row), "value": shown, **where}
    return _status(reason, message, metadata, _failed(reason, place, str(error)))


def _failed(reason: str, subject: str, description: str) -> PreconditionFailure:
    failure = PreconditionFailure()
    failure.violations.add(type=reason, subject=subject, description=description)
    return failure


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
    return _status(reason, message, metadata, detail)


def _status(reason: str, message: str, metadata: Mapping[str, str], *details: Message) -> Status:
    status = Status(code=REASONS[reason].code.number, message=message)
    for detail in (ErrorInfo(reason=reason, domain=DOMAIN, metadata=metadata), *details):
        packed = any_pb2.Any()
        packed.Pack(detail)
        status.details.append(packed)
    return status


def _quoted(value: str) -> str:
    """The value in quotation marks if it could be misread without: because it is empty or has spaces around a text."""
    return value if PLAIN.fullmatch(value) else repr(value)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}... ({len(text)} characters)"
