"""Errors as problem details (RFC 9457): what is wrong, in which field, at which position, with which value."""

from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Any

import grpc
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field, ValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match, Route

from dynhull_client import DeadlineError, DynhullError

MEDIA_TYPE = "application/problem+json"
SHOWN_ERRORS = 10
SHOWN_CHARACTERS = 100
RETRY_SECONDS = "1"

STATUS_OF_CODE: Mapping[grpc.StatusCode, int] = {
    grpc.StatusCode.CANCELLED: 503,
    grpc.StatusCode.UNKNOWN: 502,
    grpc.StatusCode.INVALID_ARGUMENT: 400,
    grpc.StatusCode.DEADLINE_EXCEEDED: 504,
    grpc.StatusCode.NOT_FOUND: 404,
    grpc.StatusCode.ALREADY_EXISTS: 409,
    grpc.StatusCode.PERMISSION_DENIED: 403,
    grpc.StatusCode.RESOURCE_EXHAUSTED: 429,
    grpc.StatusCode.FAILED_PRECONDITION: 409,
    grpc.StatusCode.ABORTED: 409,
    grpc.StatusCode.OUT_OF_RANGE: 410,
    grpc.StatusCode.UNIMPLEMENTED: 501,
    grpc.StatusCode.INTERNAL: 502,
    grpc.StatusCode.UNAVAILABLE: 503,
    grpc.StatusCode.DATA_LOSS: 502,
    grpc.StatusCode.UNAUTHENTICATED: 401,
}
# Where HTTP distinguishes what gRPC does not.
STATUS_OF_REASON: Mapping[str, int] = {"DISK_FULL": 507, "SEQUENCE_AHEAD": 409}


class Cause(BaseModel):
    """One thing that is wrong with a request."""

    detail: str = Field(description="What is wrong.", examples=["Input should be a valid number"])
    pointer: str | None = Field(
        default=None, description="JSON pointer (RFC 6901) to the value in the body.", examples=["/insert/3/0"]
    )
    parameter: str | None = Field(default=None, description="Name of the parameter or header at fault.")
    value: str | None = Field(default=None, description="The value, cut if it is long.", examples=["'4,5'"])


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
    """A request is refused by the gateway itself."""

    def __init__(self, status: int, detail: str, reason: str = "", **more: Any) -> None:
        super().__init__(status, detail)
        self.reason = reason
        self.more = more


RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": description, "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
    for status, description in (
        (400, "The request has a bad value; nothing has changed."),
        (401, "The server requires another token."),
        (403, "The token does not allow the call."),
        (404, "There is no such hull, fence, key or point."),
        (408, "The body did not arrive in time."),
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
    return Response(content.model_dump_json(exclude_none=True), status, headers, MEDIA_TYPE)


def of_refusal(error: DynhullError, *, waited: bool = False, **more: Any) -> Response:
    """The response for an error of the server. `waited`: the request asked for a revision to wait for."""
    if waited and isinstance(error, DeadlineError):
        detail = "the hull has not reached min_revision within the time limit of the gateway"
        return problem(HTTPStatus.CONFLICT, detail, reason="REVISION_NOT_REACHED", field="min_revision", **more)
    status = STATUS_OF_REASON.get(error.reason) or STATUS_OF_CODE.get(error.code, HTTPStatus.BAD_GATEWAY)
    return problem(
        status,
        str(error),
        reason=error.reason or error.code.name,
        **{"field": error.field, "row": error.row, "value": error.value, "expected": error.expected, **more},
    )


def of_validation(errors: Iterable[Any], **more: Any) -> Response:
    """The response for values that do not match their declarations, as pydantic reports them."""
    causes = [_cause(each) for each in list(errors)[:SHOWN_ERRORS]]
    first = causes[0]
    where = first.parameter or first.pointer or "body"
    path = [part for part in (first.pointer or "").split("/") if part]
    row = next((int(part) for part in path if part.isdecimal()), None)
    return problem(
        HTTPStatus.BAD_REQUEST,
        f"{where}: {first.detail}",
        reason="INVALID_FIELD",
        **{"field": first.parameter or next(iter(path), "body"), "row": row, "value": first.value, **more},
        errors=causes,
    )


def install(app: FastAPI) -> None:
    """Answer every error of the application with problem details."""

    @app.exception_handler(DynhullError)
    async def refused(request: Request, error: Exception) -> Response:
        assert isinstance(error, DynhullError)
        return of_refusal(error, waited="min_revision" in request.query_params)

    @app.exception_handler(RequestValidationError)
    @app.exception_handler(ValidationError)
    async def invalid(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError | ValidationError)
        return of_validation(error.errors())

    @app.exception_handler(ValueError)  # of the SDK, about an argument; nothing was sent
    @app.exception_handler(TypeError)
    async def unusable(_: Request, error: Exception) -> Response:
        return problem(HTTPStatus.BAD_REQUEST, str(error), reason="INVALID_FIELD")

    @app.exception_handler(HTTPException)
    async def failed(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        if isinstance(error, ProblemError):
            return problem(error.status_code, error.detail, reason=error.reason, **error.more)
        if error.status_code != HTTPStatus.METHOD_NOT_ALLOWED:
            return problem(error.status_code, error.detail)
        allowed = ", ".join(sorted(_methods(request)))
        response = problem(error.status_code, f"{request.method} is not among {allowed}", value=request.method)
        response.headers["Allow"] = allowed
        return response


def shown(value: object) -> str:
    """A value for people, cut if it is long."""
    text = repr(value)
    return text if len(text) <= SHOWN_CHARACTERS else f"{text[:SHOWN_CHARACTERS]}..."


def _methods(request: Request) -> set[str]:
    """The methods of a path: the framework has a route for each."""
    routes: Iterable[Route] = request.app.state.routes
    return {
        method
        for route in routes
        if route.matches(request.scope)[0] is not Match.NONE
        for method in route.methods or ()
    }


def _cause(error: Mapping[str, Any]) -> Cause:
    place, *path = error["loc"] or ("body",)
    if error["type"] == "json_invalid":
        reason = error.get("ctx", {}).get("error", "")
        return Cause(detail=f"not JSON: {reason}", value=None)
    detail = error["msg"].removeprefix("Value error, ")
    value = None if error["type"] == "missing" else shown(error["input"])
    if place == "body":
        return Cause(detail=detail, pointer="".join(f"/{part}" for part in path), value=value)
    if place in ("path", "query", "header"):
        return Cause(detail=detail, parameter=str(path[0]) if path else None, value=value)
    return Cause(detail=detail, pointer="".join(f"/{part}" for part in (place, *path)), value=value)
