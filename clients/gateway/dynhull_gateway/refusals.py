"""Refusals of the server, in the names of the request that the caller has sent."""

import re
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

import grpc
from starlette.responses import Response

from dynhull_client import DeadlineError, DynhullError
from dynhull_surface.names import find
from dynhull_surface.reasons import http_of

from .problems import Cause, named, pointer, problem, said, shown

RING = 2  # where the way to an area's ring has its name: after `area` and the number of the polygon
OF_SEVERAL = re.compile(r"batches\[(\d+)\]\.")
BATCH = re.compile(r"(?:batches\[(\d+)\]\.)?batch(?:\.(.*))?")
SDK = re.compile(r"(\w+)(?: row (\d+))? is .*?: (.*)", re.DOTALL)
OF_KIND = re.compile(r"(?:batches\[\d+\]\.)?batch\.(inserts|deletes|puts\.keys|removes)")
COLUMNS = {
    "puts.keys": "key",
    "removes": "key",
    "puts.times": "time",
    "insert_times": "time",
    "puts.expire_times": "expires",
    "puts.accuracies": "accuracy",
}
HINT_OF_ROWS = (
    'a row with a key is {"key": KEY, "x": X, "y": Y}, and one without [X, Y]; ?keys=none, str or int leaves keys out '
    "or converts them"
)
HINT_OF_BATCH = (
    'a batch with keys is {"keys": [KEY, ...], "points": [[X, Y], ...]}, and one without is {"insert": [[X, Y], ...]}'
)


def of_refusal(error: DynhullError, body: Any = None, *, waited: Sequence[str] = (), **more: Any) -> Response:
    """The response for an error of the server.

    Args:
        error: the error.
        body: the body of the request; None for a request without.
        waited: the names of the revisions that the request asked to wait for.
        more: further fields of the problem, in place of those of the error.
    """
    if waited and isinstance(error, DeadlineError):
        detail = f"{' or '.join(waited)}: not reached within the time limit of the gateway"
        return problem(HTTPStatus.CONFLICT, detail, reason="REVISION_NOT_REACHED", field=waited[0], **more)
    fields: dict[str, Any] = {"row": error.row, "value": error.value, "expected": error.expected}
    detail = str(error)
    if error.code == grpc.StatusCode.UNAVAILABLE and not error.reason:
        detail = f"no answer from the server behind the gateway: {detail}"
    elif error.code == grpc.StatusCode.UNAUTHENTICATED:
        detail = "a token that the server knows is required: send the header Authorization: Bearer TOKEN"
    path = None if error.field is None else _path(error.field, body)
    if path is not None:
        cause = _cause(error, path, body)
        detail = said(cause)
        fields |= {name: each for name, each in named(cause, path).items() if each is not None}
    elif error.field is not None:
        fields["field"] = _parameter(error.field)
        if error.problem != detail:  # its words have the argument of the SDK
            detail = f"{fields['field']}: {error.problem}"
    return problem(status_of(error), detail, reason=error.reason or error.code.name, **(fields | more))


def of_value_error(error: ValueError | TypeError, body: Any = None) -> Response:
    """The response for an argument that the SDK does not take; nothing was sent."""
    found = SDK.fullmatch(str(error))
    name = "" if found is None else found[1].removesuffix("_")  # as Python writes what is a word of its own
    if found is None or not isinstance(body, dict) or name not in body:
        return problem(HTTPStatus.BAD_REQUEST, str(error), reason="INVALID_FIELD")
    path: list[str | int] = [name, *([] if found[2] is None else [int(found[2])])]
    value = shown(_at(body, path))
    cause = Cause(detail=found[3], pointer=pointer(path), value=value)
    return problem(HTTPStatus.BAD_REQUEST, said(cause), reason="INVALID_FIELD", **named(cause, path))


def of_refused_rows(error: DynhullError | ValueError, applied: int) -> Response:
    """The response for rows of a body that the server or the SDK does not take. `applied`: the rows before them."""
    if not isinstance(error, DynhullError):
        found = SDK.fullmatch(str(error))
        row = applied + int((found and found[2]) or 0)
        detail = f"row {row}: {error}"
        return problem(HTTPStatus.BAD_REQUEST, detail, reason="INVALID_FIELD", row=row, applied=applied)
    batch = None if error.field is None else BATCH.fullmatch(error.field)
    if batch is None:
        return of_refusal(error, applied=applied)
    row = applied + (error.row or 0)
    column = COLUMNS.get(batch[2])
    value = value_of(error)
    place = f"row {row}, {column}" if column else f"row {row}"
    detail = f"{place}: {error.problem}"
    if error.reason == "KEY_REPEATED":
        first = applied + int(error.metadata["first_row"])
        detail = f"{place}: a batch names a key once, and row {first} has the same"
    if error.reason == "HULL_UNSUITABLE" and OF_KIND.fullmatch(error.field or ""):
        detail = f"{detail}; {HINT_OF_ROWS}"
    fields = {"field": column, "row": row, "value": value, "applied": applied}
    return problem(status_of(error), detail, reason=error.reason or error.code.name, **fields)


def status_of(error: DynhullError) -> int:
    """The HTTP status for an error of the server."""
    return http_of(error.reason, error.code.name)


def value_of(error: DynhullError) -> str | None:
    """The value of a row at fault, as JSON; None if no row is."""
    return None if error.row is None or error.value is None else _as_json(error.value)


def _cause(error: DynhullError, path: list[str | int], body: Any) -> Cause:
    """What is wrong with the body at a path, to which the row is added."""
    detail = error.problem
    if error.reason == "KEY_REPEATED":
        first = _path(error.metadata["first_field"], body) or []
        detail = f"a batch names a key once, and {pointer([*first, error.metadata['first_row']])} is the same"
    row = error.row
    if error.reason == "HULL_UNSUITABLE" and OF_KIND.fullmatch(error.field or ""):
        detail, row = f"{detail}; {HINT_OF_BATCH}", 0  # the first of rows that are all alike
    if row is not None:
        path.append(row)
    value = _at(body, path)
    return Cause(detail=detail, pointer=pointer(path), value=None if value is None else shown(value))


def _path(field: str, body: Any) -> list[str | int] | None:
    """The way through the body to a field that the server names; None if the body does not have it."""
    of_several = OF_SEVERAL.match(field)
    found = find(field.removeprefix(of_several[0]) if of_several else field)
    if found is None:
        return [field] if isinstance(body, dict) and field in body else None
    way = list(found.json)
    if found.path.startswith("batch"):
        within = ["batches", list(body["batches"])[int(of_several[1])]] if of_several else []
        return [] if isinstance(body, list) else [*within, *way]
    if way[1:] and way[0] == "area" and isinstance(way[1], int):
        way = _in_area(way, _at(body, ["area"]))
    if isinstance(body, dict) and found.argument in body and way[0] not in body:
        return [found.argument]  # the moments of a fence after the fact
    in_body = not way or found.path.startswith("config") or (isinstance(body, dict) and way[0] in body)
    return way if in_body else None


def _in_area(way: list[Any], area: Any) -> list[str | int]:
    """The way to a ring of a polygon, in the form in which the body has the area."""
    if not isinstance(area, dict):
        return way
    if "coordinates" not in area or len(way) <= RING:
        return [way[0], *way[2:]]  # one polygon is no list
    polygon = way[1:RING] if area.get("type") == "MultiPolygon" else []
    return [way[0], "coordinates", *polygon, 0 if way[RING] == "exterior" else way[RING + 1] + 1]


def _parameter(field: str) -> str:
    """A field of the server that is no part of a body, as a parameter or a header is called."""
    found = find(field)
    return field if found is None or not found.json else str(found.json[-1])


def _at(body: Any, path: list[str | int]) -> Any:
    """What the body has there; None for nothing."""
    for part in path:
        try:
            body = body[part]
        except (LookupError, TypeError):
            return None
    return body


def _as_json(value: str) -> str:
    """A value as the server shows it; a point as JSON has it."""
    return f"[{value[1:-1]}]" if value.startswith("(") and value.endswith(")") else value
