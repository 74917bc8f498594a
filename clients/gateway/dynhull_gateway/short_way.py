"""The short way for what comes most often: a few points or keys to apply, and a few points to locate.

The framework's way to `points.change_points` and `questions.locate` takes many times as long as all the rest of such a
request. What this way does not take goes on to those routes, which describe it: everything that is larger, numbered,
has parameters, or is wrong.
"""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from pydantic import ValidationError
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dynhull_client import DynhullError

from .bodies import JSON, again, read_json
from .callers import bearer, client_with
from .figures import SHORT
from .gathering import Gatherer
from .points import read_batch
from .problems import FieldError, ProblemError, problem
from .refusals import of_refusal, of_value_error
from .schemas import AboutPoints, unquoted


class _Work(NamedTuple):
    """What is done the short way: its route, how its body is read, and who does it."""

    route: str
    read: Callable[[bytes], Any]
    do: Callable[..., Any]


def _read_points(body: bytes) -> Any:
    return AboutPoints.model_validate_json(body).points


WORKS = {
    "points": _Work("/hulls/{name}/points", read_batch, Gatherer.apply),
    "locate": _Work("/hulls/{name}/locate", _read_points, Gatherer.locate),
}
PATH = re.compile(rf"/hulls/((?:[A-Za-z0-9._-]|%2[Ff]){{1,200}})/({'|'.join(WORKS)})")
MOST_BYTES = 4096
NUMBER = b"idempotency-key"
LENGTH = re.compile(rb"[0-9]{1,4}")


class ShortWay:
    """Answers what is small, and passes everything else on."""

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self._app = app
        self._root = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a small request, or pass it on as it came."""
        found = self._found(scope)
        if found is None:
            await self._app(scope, receive, send)
            return
        name, work, given = found
        try:
            message = await receive()
            content = _content(message, work)
            if content is None:
                await self._app(scope, again(message, receive), send)
                return
            scope[SHORT] = work.route
            state, token = scope["app"].state, bearer(given)
            client = client_with(state.client, token)
            response = Response(await work.do(state.gatherer, client, token, name, content), media_type=JSON)
        except DynhullError as error:
            response = of_refusal(error, read_json(message["body"]))
        except ProblemError as error:
            response = problem(error.status_code, error.detail, reason=error.reason, **error.more)
        except (ValueError, TypeError) as error:
            response = of_value_error(error, read_json(message["body"]))
        await response(scope, receive, send)

    def _found(self, scope: Scope) -> tuple[str, _Work, str | None] | None:
        """The hull, what is asked of it, and who asks; None if the request cannot be a small one."""
        if scope["type"] != "http" or scope["method"] != "POST" or scope["query_string"]:
            return None
        found = PATH.fullmatch(scope["path"].removeprefix(self._root))
        if found is None:
            return None
        headers = dict(reversed(scope["headers"]))  # the first of each name, as those of a Request
        small = LENGTH.fullmatch(headers.get(b"content-length", b"")) and int(headers[b"content-length"]) <= MOST_BYTES
        if not small or headers.get(b"content-type") != JSON.encode() or NUMBER in headers:
            return None
        given = headers.get(b"authorization")
        return unquoted(found[1]), WORKS[found[2]], None if given is None else given.decode("latin-1")


def _content(message: Message, work: _Work) -> Any:
    """What a body that came as a whole says; None for what the route has to answer."""
    if message["type"] != "http.request" or message.get("more_body", False):
        return None
    try:
        return work.read(message["body"])
    except (ValidationError, FieldError):
        return None
