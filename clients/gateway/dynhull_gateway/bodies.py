"""Bodies of requests: of which type they are, how large they may be, and how slowly they may arrive."""

import asyncio
from collections.abc import Callable, Collection, Coroutine
from email.message import Message
from functools import lru_cache
from http import HTTPStatus
from typing import Any

from fastapi.routing import APIRoute
from pydantic_core import from_json
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.types import Message as Event

from .problems import FieldError, ProblemError, problem
from .settings import Settings
from .texts import BYTE_ORDER_MARK

JSON = "application/json"
GEOJSON = "application/geo+json"
ANSWERS = (JSON, GEOJSON, "application/schema+json")
NEWLINE = b"\n"
FORM = "application/x-www-form-urlencoded"
WHOLE = (b"", JSON.encode(), GEOJSON.encode())
SENT = "dynhull.body"
HERE = "dynhull.here"  # in the scope of a request whose body came together with its head


def require_type(request: Request, types: Collection[str]) -> str:
    """The media type of a body; ProblemError if it is none of these, or not in UTF-8."""
    given = request.headers.get("content-type", "")
    kind, charset = _media_type(given)
    if kind in types:
        if charset in ("utf-8", "utf8", "us-ascii"):
            return kind
        detail = f"the body is {charset}: it must be UTF-8"
    else:
        detail = f"the body is {given or 'of no type'}: Content-Type must be {' or '.join(types)}"
        if kind == FORM:
            detail += f", which curl sends with -H 'Content-Type: {next(iter(types))}'"
    raise ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, detail, "MEDIA_TYPE", field="Content-Type", value=given)


@lru_cache(maxsize=64)
def _media_type(given: str) -> tuple[str, str]:
    """The media type and the encoding in a header; an empty type without one."""
    message = Message()
    message["content-type"] = given
    return message.get_content_type() if given.strip() else "", message.get_content_charset("utf-8")


def read_json(body: bytes) -> Any:
    """A body as JSON; FieldError if it is none."""
    try:
        return from_json(body.removeprefix(BYTE_ORDER_MARK))
    except ValueError as error:
        raise FieldError((), f"not JSON: {error}") from None


def keep(request: Request, body: Any) -> None:
    """Keep the body of a request, as bytes or as JSON, for what errors say about it."""
    request.scope[SENT] = body


def body_of(request: Request) -> Any:
    """The kept body of a request, as JSON; None if there is none, or it is no JSON."""
    body = request.scope.get(SENT)
    try:
        return read_json(body) if isinstance(body, bytes) else body
    except FieldError:
        return None


def again(message: Event, receive: Receive) -> Receive:
    """Receives a message once more, and then what follows."""
    first = [message]

    async def received() -> Event:
        return first.pop() if first else await receive()

    return received


class JsonRoute(APIRoute):
    """A route that takes its body, if it has one, as JSON and as nothing else; its JSON ends with a newline."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of the framework, between what is common to all routes."""
        handle = super().get_route_handler()

        async def of_json(request: Request) -> Response:
            if self.body_field is not None and _has_body(request):
                require_type(request, (JSON,))
            response = await handle(_JsonRequest(request.scope, request.receive))
            body = bytes(response.body) if response.media_type in ANSWERS else b""
            if body and not body.endswith(NEWLINE):  # 204 has none
                response.body = body + NEWLINE
                response.headers["content-length"] = str(len(response.body))
            return response

        return of_json


def _has_body(request: Request) -> bool:
    return request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers


class _JsonRequest(Request):
    """A request whose body is read as everywhere in the gateway."""

    async def json(self) -> Any:
        """The body."""
        value = read_json(await self.body())
        keep(self, value)
        return value


class LimitedBodies:
    """Refuses bodies that are too large, and gives up on those that do not arrive."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, with a body that has limits."""
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        encoding = headers.get(b"content-encoding", b"identity").strip().lower()
        if encoding != b"identity":
            refused = problem(
                HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
                "the body must not be compressed",
                reason="CONTENT_ENCODING",
                field="Content-Encoding",
                value=encoding.decode("latin-1"),
            )
            await refused(scope, receive, send)
            return
        whole = headers.get(b"content-type", b"").partition(b";")[0].strip().lower() in WHOLE
        limit = self._settings.max_body if whole else self._settings.max_upload
        if int(headers.get(b"content-length", b"0")) > limit:
            await _too_large(limit)(scope, receive, send)
            return
        if scope.get(HERE) and b"content-length" in headers:
            await self._app(scope, receive, send)
            return
        body = _Body(receive, limit, self._settings.body_seconds, whole=whole)
        await self._app(scope, body.receive, send)


class _Body:
    """A body on its way."""

    def __init__(self, receive: Receive, limit: int, seconds: float, *, whole: bool) -> None:
        self._receive = receive
        self._left = limit
        self._limit = limit
        self._seconds = seconds
        self._deadline = asyncio.get_running_loop().time() + seconds if whole else None
        self._complete = False

    async def receive(self) -> Event:
        """The next part; ProblemError if it is too much or too late."""
        if self._complete:  # what is awaited now is the end of the connection
            return await self._receive()
        now = asyncio.get_running_loop().time()
        try:
            async with asyncio.timeout_at(now + self._seconds if self._deadline is None else self._deadline):
                message = await self._receive()
        except TimeoutError:
            detail = f"no more of the body within {self._seconds:g} s"
            raise ProblemError(HTTPStatus.REQUEST_TIMEOUT, detail, "BODY_TOO_SLOW") from None
        self._complete = not message.get("more_body", False)
        self._left -= len(message.get("body", b""))
        if self._left < 0:
            raise ProblemError(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _detail(self._limit), "BODY_TOO_LARGE", value=str(self._limit)
            )
        return message


def _detail(limit: int) -> str:
    return f"the body is larger than {limit} bytes"


def _too_large(limit: int) -> ASGIApp:
    return problem(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _detail(limit), reason="BODY_TOO_LARGE", value=str(limit))
