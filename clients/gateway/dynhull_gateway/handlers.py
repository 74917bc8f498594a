"""Every error of the application, answered with problem details."""

from collections.abc import Iterable
from difflib import get_close_matches
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.routing import Match, Route

from dynhull_client import DynhullError

from .bodies import body_of
from .heads import GET, HEAD
from .invalid import of_validation
from .problems import ProblemError, cut, problem
from .refusals import of_refusal, of_value_error
from .waits import REVISIONS

NEAR = 3


def install(app: FastAPI) -> None:
    """Answer the errors of an application."""

    @app.exception_handler(DynhullError)
    async def refused(request: Request, error: Exception) -> Response:
        assert isinstance(error, DynhullError)
        body = body_of(request)
        given = (request.query_params, body if isinstance(body, dict) else {})
        return of_refusal(error, body, waited=[name for name in REVISIONS if any(name in each for each in given)])

    @app.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return of_validation(error.errors(), body_of(request))

    @app.exception_handler(ValidationError)  # of a body that a route has read itself
    async def invalid_body(request: Request, error: Exception) -> Response:
        assert isinstance(error, ValidationError)
        found = [{**each, "loc": ("body", *each["loc"])} for each in error.errors()]
        return of_validation(found, body_of(request))

    @app.exception_handler(ValueError)  # of the SDK, about an argument; nothing was sent
    @app.exception_handler(TypeError)
    async def unusable(request: Request, error: Exception) -> Response:
        assert isinstance(error, ValueError | TypeError)
        return of_value_error(error, body_of(request))

    @app.exception_handler(ClientDisconnect)
    async def gone(_: Request, __: Exception) -> Response:
        return Response(status_code=HTTPStatus.BAD_REQUEST)  # of half a body; nobody is there to read it

    @app.exception_handler(HTTPException)
    async def failed(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        if isinstance(error, ProblemError):
            return problem(error.status_code, error.detail, reason=error.reason, **error.more)
        if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
            return _not_allowed(request)
        if error.status_code == HTTPStatus.NOT_FOUND:
            return _not_found(request)
        return problem(error.status_code, error.detail, reason=HTTPStatus(error.status_code).name)


def _not_allowed(request: Request) -> Response:
    allowed = sorted(_methods(request))
    detail = f"{cut(_path(request))} takes {', '.join(allowed)}, not {request.method}"
    response = problem(HTTPStatus.METHOD_NOT_ALLOWED, detail, reason="METHOD_NOT_ALLOWED", value=request.method)
    response.headers["Allow"] = ", ".join(allowed)
    return response


def _not_found(request: Request) -> Response:
    path = cut(_path(request))
    near = get_close_matches(path, _paths_like(path, request.app.state.routes), NEAR)
    what = f"near it {'is' if len(near) == 1 else 'are'} {', '.join(near)}; " if near else ""
    if meant := _with_slashes(_path(request), request.app.state.routes):
        what += f"a slash in a name is written %2F, as in {cut(meant)}; "
    detail = f"there is no {path}: {what}/docs lists what there is, and /openapi.json for programs"
    return problem(HTTPStatus.NOT_FOUND, detail, reason="PATH_NOT_FOUND", value=path)


def _path(request: Request) -> str:
    """The path as it was sent, below the path that a proxy shows."""
    return str(request.scope["path"]).removeprefix(request.scope.get("root_path", "")) or "/"


def _with_slashes(path: str, routes: Iterable[Route]) -> str | None:
    """The path of a route that is meant if slashes behind /hulls/ or /fences/ are part of a name; None if none is."""
    _, kind, *parts = path.split("/")
    if kind not in ("hulls", "fences") or not all(parts):
        return None
    for end in range(2, len(parts) + 1):
        meant = "/".join(["", kind, "%2F".join(parts[:end]), *parts[end:]])
        if any(route.path_regex.fullmatch(meant) for route in routes):
            return meant
    return None


def _paths_like(path: str, routes: Iterable[Route]) -> list[str]:
    """The paths of all routes, with the parts of a path in place of their parameters."""
    given = path.split("/")
    found: dict[str, None] = {}
    for route in routes:
        parts = route.path.split("/")
        filled = [given[i] if part.startswith("{") and any(given[i : i + 1]) else part for i, part in enumerate(parts)]
        found["/".join(filled)] = None
    return list(found)


def _methods(request: Request) -> set[str]:
    """The methods of a path: the framework has a route for each, and every GET takes HEAD."""
    routes: Iterable[Route] = request.app.state.routes
    found = [route.methods or () for route in routes if route.matches(request.scope)[0] is not Match.NONE]
    methods = {method for each in found for method in each}
    return methods | {HEAD} if GET in methods else methods
