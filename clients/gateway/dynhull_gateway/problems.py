"""Errors as problem details (RFC 9457): what is wrong, in which field, at which position, with which value."""

import json
from collections.abc import Iterable
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.responses import Response

MEDIA_TYPE = "application/problem+json"
SHOWN_CHARACTERS = 100
RETRY_SECONDS = "1"


class Cause(BaseModel):
    """One thing that is wrong with a request."""

    detail: str = Field(description="What is wrong.", examples=["must be a valid number"])
    pointer: str | None = Field(
        default=None, description="JSON pointer (RFC 6901) to the value in the body.", examples=["/insert/3/0"]
    )
    parameter: str | None = Field(default=None, description="Name of the parameter or header at fault.")
    value: str | None = Field(
        default=None,
        description="The value, cut if it is long: of a body as JSON, else as it was sent.",
        examples=['"4,5"'],
    )


class Problem(BaseModel):
    """Problem details (RFC 9457)."""

    type: str = Field("about:blank", description="Always about:blank: the status and the reason say the type.")
    title: str = Field(description="The HTTP status in words.")
    status: int = Field(description="The HTTP status.")
    detail: str = Field(description="What went wrong, for people.")
    reason: str = Field("", description="What went wrong, for programs, such as POINT_MISSING.")
    field: str | None = Field(default=None, description="Field of the request at fault.")
    row: int | None = Field(default=None, description="Row of that field, or of the body, counted from 0.")
    value: str | None = Field(default=None, description="The value at fault, or the limit that was exceeded.")
    expected: int | None = Field(default=None, description="After a gap in a producer's numbers, the next number.")
    applied: int | None = Field(
        default=None, description="Of a body of rows: the rows that were applied before the error."
    )
    errors: list[Cause] | None = Field(
        default=None, description="Everything that is wrong with the request, up to ten."
    )


class ProblemError(HTTPException):
    """A request is refused by the gateway itself. `more`: further fields of the problem."""

    def __init__(self, status: int, detail: str, reason: str = "", **more: Any) -> None:
        super().__init__(status, detail)
        self.reason = reason
        self.more = more


class FieldError(ProblemError):
    """A value in the body of a request cannot be used.

    Args:
        path: the way to the value: names of fields and rows; empty for the whole body.
        detail: what is wrong with it.
        value: the value; left out if there is none to show.
    """

    def __init__(self, path: Iterable[str | int], detail: str, value: Any = None) -> None:
        way = list(path)
        cause = Cause(detail=detail, pointer=pointer(way), value=None if value is None else shown(value))
        super().__init__(HTTPStatus.BAD_REQUEST, said(cause), "INVALID_FIELD", **named(cause, way))


RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": description, "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
    for status, description in (
        (400, "The request has a bad value; nothing has changed."),
        (401, "The server requires another token."),
        (403, "The token does not allow the call."),
        (404, "There is no such hull, fence, key or point."),
        (408, "The request did not arrive in time."),
        (409, "The hull or fence is in another state, of another kind, or exists already."),
        (410, "The revision is no longer known."),
        (413, "The body is too large."),
        (415, "The body is of a type that the call does not take."),
        (429, "A limit of the server is exceeded."),
        ("default", "The gateway or the server cannot answer now."),
    )
}


def problem(status: int, detail: str, **more: Any) -> Response:
    """A response with problem details."""
    content = Problem(title=HTTPStatus(status).phrase, status=status, detail=detail, **more)
    headers = {}
    if status == HTTPStatus.UNAUTHORIZED:
        headers["WWW-Authenticate"] = "Bearer"
    if status in (HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.TOO_MANY_REQUESTS):
        headers["Retry-After"] = RETRY_SECONDS
    return Response(f"{content.model_dump_json(exclude_none=True)}\n", status, headers, MEDIA_TYPE)


def shown(value: Any) -> str:
    """A value as JSON, cut if it is long."""
    try:
        text = json.dumps(value, ensure_ascii=False, default=str)
    except ValueError:  # an integer too long for the interpreter to write
        text = f"an integer of {value.bit_length()} bits" if isinstance(value, int) else f"a {type(value).__name__}"
    return cut(text)


def cut(text: str) -> str:
    """A text, cut if it is long."""
    return text if len(text) <= SHOWN_CHARACTERS else f"{text[:SHOWN_CHARACTERS]}..."


def pointer(path: Iterable[str | int]) -> str:
    """The JSON pointer (RFC 6901) of a way into a body."""
    return "".join(f"/{str(part).replace('~', '~0').replace('/', '~1')}" for part in path)


def said(cause: Cause) -> str:
    """One cause as the detail of a problem."""
    return f"{cause.parameter or cause.pointer or 'body'}: {cause.detail}"


def named(cause: Cause, path: Iterable[str | int] = ()) -> dict[str, Any]:
    """The fields of a problem that name a cause. `path`: the way to it in the body."""
    parts = list(path)
    row = next((part for part in parts if isinstance(part, int)), None)
    field = cause.parameter or (parts[0] if parts and isinstance(parts[0], str) else "body")
    return {"field": field, "row": row, "value": cause.value, "errors": [cause]}
