"""Refusals as gRPC statuses with google.rpc details."""

from collections.abc import Mapping

from google.protobuf.any_pb2 import Any
from google.protobuf.message import DecodeError, Message
from google.rpc.code_pb2 import ALREADY_EXISTS, FAILED_PRECONDITION, INVALID_ARGUMENT, NOT_FOUND, RESOURCE_EXHAUSTED
from google.rpc.code_pb2 import UNAVAILABLE as CODE_UNAVAILABLE
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, PreconditionFailure, QuotaFailure, ResourceInfo
from google.rpc.status_pb2 import Status

from ..engine.errors import HullExistsError, HullNotFoundError, LimitExceededError, PointMissingError, RefusedError
from .codec import InvalidFieldError

DOMAIN = "dynhull.v1"
HULL_TYPE = "dynhull.v1.Hull"
# Statuses travel as headers, which have little room.
LONGEST_VALUE = 120

PART_FIELDS = {"deletes": "batch.deletes", "origins": "batch.moves.origins"}


class DrainingError(Exception):
    """The server is about to stop."""


ANSWERED = (RefusedError, InvalidFieldError, DecodeError, DrainingError)


def error_status(error: Exception, batch: int | None = None) -> Status:
    """The status that tells a client of `error`, one of ANSWERED.

    `batch` is how many batches the call has applied before it.
    """
    where = {} if batch is None else {"batch": str(batch)}
    match error:
        case InvalidFieldError():
            row = {} if error.row is None else {"row": str(error.row)}
            value = _short(error.value)
            field = error.field if error.row is None else f"{error.field}[{error.row}]"
            detail = BadRequest()
            detail.field_violations.add(field=field, description=f"{error.problem}, got {value}")
            message = f"{field} is {value}: {error.problem}"
            metadata = {"field": error.field, **row, "value": value, **where}
            return _status(INVALID_ARGUMENT, message, "INVALID_FIELD", metadata, detail)
        case PointMissingError():
            field, value = PART_FIELDS[error.part], _short(error.point)
            failure = PreconditionFailure()
            failure.violations.add(type="POINT_MISSING", subject=f"{field}[{error.row}]", description=str(error))
            message = f"{field}[{error.row}] is {value}: no such point to delete; nothing of the batch was applied"
            metadata = {"field": field, "row": str(error.row), "value": value, **where}
            return _status(FAILED_PRECONDITION, message, "POINT_MISSING", metadata, failure)
        case HullNotFoundError():
            resource = ResourceInfo(resource_type=HULL_TYPE, resource_name=error.name, description=str(error))
            return _status(NOT_FOUND, str(error), "HULL_NOT_FOUND", {"value": error.name, **where}, resource)
        case HullExistsError():
            resource = ResourceInfo(resource_type=HULL_TYPE, resource_name=error.name, description=str(error))
            return _status(ALREADY_EXISTS, str(error), "HULL_EXISTS", {"value": error.name}, resource)
        case LimitExceededError():
            quota = QuotaFailure()
            quota.violations.add(subject=error.limit, description=str(error))
            metadata = {"limit": error.limit, "value": str(error.maximum), **where}
            return _status(RESOURCE_EXHAUSTED, str(error), "LIMIT_EXCEEDED", metadata, quota)
        case DecodeError():
            return _status(INVALID_ARGUMENT, "these bytes are not the request's message", "MALFORMED_MESSAGE", where)
        case DrainingError():
            return _status(CODE_UNAVAILABLE, "the server is shutting down", "DRAINING", where)
    raise error


def _status(code: int, message: str, reason: str, metadata: Mapping[str, str], *details: Message) -> Status:
    status = Status(code=code, message=message)
    for detail in (ErrorInfo(reason=reason, domain=DOMAIN, metadata=metadata), *details):
        packed = Any()
        packed.Pack(detail)
        status.details.append(packed)
    return status


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}... ({len(text)} characters)"
