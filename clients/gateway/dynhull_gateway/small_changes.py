"""The short way for what comes most often: a few points or keys as JSON.

The framework's way to `points.change_points` takes longer than all the rest of such a request. What this way does not
take goes on to that route, which describes it: everything that is larger, numbered, or wrong.
"""

import re

from pydantic import ValidationError
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dynhull_client import DynhullError

from .bodies import JSON, read_json
from .figures import SHORT
from .points import read_batch
from .problems import FieldError, ProblemError, problem
from .refusals import of_refusal, of_value_error
from .schemas import Batch

PATH = re.compile(r"/hulls/([A-Za-z0-9._-]{1,200})/points")
ROUTE = "/hulls/{name}/points"
MOST_BYTES = 4096
OTHERS = {b"authorization", b"idempotency-key", b"origin"}
LENGTH = re.compile(rb"[0-9]{1,4}")


class SmallChanges:
    """Applies small batches, and passes everything else on."""

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self._app = app
        self._root = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a small batch, or pass the request on as it came."""
        name = self._hull(scope)
        if name is None:
            await self._app(scope, receive, send)
            return
        state = scope["app"].state
        try:
            message = await receive()
            batch = _batch(message)
            if batch is None:
                await self._app(scope, _again(message, receive), send)
                return
            response = Response(await state.gatherer.apply(state.client, None, name, batch), media_type=JSON)
        except DynhullError as error:
            response = of_refusal(error, read_json(message["body"]))
        except ProblemError as error:
            response = problem(error.status_code, error.detail, reason=error.reason, **error.more)
        except (ValueError, TypeError) as error:
            response = of_value_error(error, read_json(message["body"]))
        await response(scope, receive, send)

    def _hull(self, scope: Scope) -> str | None:
        """The hull, if the request can be a small batch of a caller without a token."""
        if scope["type"] != "http" or scope["method"] != "POST" or scope["query_string"]:
            return None
        found = PATH.fullmatch(scope["path"].removeprefix(self._root))
        if found is None:
            return None
        headers = dict(scope["headers"])
        small = LENGTH.fullmatch(headers.get(b"content-length", b"")) and int(headers[b"content-length"]) <= MOST_BYTES
        plain = headers.get(b"content-type") == JSON.encode() and not OTHERS & headers.keys()
        if not (small and plain):
            return None
        scope[SHORT] = ROUTE
        return found[1]


def _batch(message: Message) -> Batch | None:
    """The batch in a body that came as a whole; None for what the route has to answer."""
    if message["type"] != "http.request" or message.get("more_body", False):
        return None
    try:
        return read_batch(message["body"])
    except (ValidationError, FieldError):
        return None


def _again(message: Message, receive: Receive) -> Receive:
    """Receives a message once more, and then what follows."""
    first = [message]

    async def again() -> Message:
        return first.pop() if first else await receive()

    return again
