"""Streams of events joined to one, because a browser gives an origin six connections, whatever its pages show.

A subscription is a request for a stream of its own, which the application answers as any other one: its parameters,
rights and limits are checked where they always are. Only its texts go to the joined stream.

One text waits for the reader, and one more of each subscription: a slow reader holds all of them back as if each were
read alone.
"""

import asyncio
import json
import logging
import secrets
from collections.abc import AsyncGenerator, Mapping
from dataclasses import dataclass, field

import grpc
from starlette.types import ASGIApp, Message, Scope

from dynhull_client import DynhullError

from ..schemas import Subscription
from .messages import COMMENT, message, problem
from .stream import TAKE

log = logging.getLogger(__name__)

# Of a request, what those of subscriptions have as well.
COMMON = "type", "asgi", "http_version", "scheme", "server", "client"
HEADERS = b"host", b"authorization"


@dataclass(slots=True)
class _Answer:
    """What the application answers to a subscription, unless it is a stream."""

    status: int = 0
    body: bytearray = field(default_factory=bytearray)

    async def send(self, sent: Message) -> None:
        if sent["type"] == "http.response.start":
            self.status = sent["status"]
        else:
            self.body += sent.get("body", b"")

    def end(self) -> bytes:
        """The event that ends the subscription."""
        if self.status < 400:
            return message("over", "", {})
        return message("problem", "", json.loads(self.body))


class JoinedStream:
    """A stream of what is subscribed to.

    Args:
        app: answers the requests of subscriptions.
        scope: the request for this stream.
        token: that of its caller, and of all who change what it follows.
    """

    def __init__(self, app: ASGIApp, scope: Scope, token: str | None) -> None:
        self.token = token
        self._app = app
        self._common: Scope = {name: scope[name] for name in COMMON if name in scope}
        self._headers = [(name, value) for name, value in scope["headers"] if name in HEADERS]
        self._root = scope.get("root_path", "")
        self._running: dict[str, tuple[Subscription, asyncio.Task[None]]] = {}
        self._coming: asyncio.Queue[tuple[str, bytes]] = asyncio.Queue(1)

    def __len__(self) -> int:
        return len(self._running)

    def get(self, name: str) -> Subscription | None:
        """A subscription; None for one that is over, or never was."""
        found = self._running.get(name)
        return None if found is None else found[0]

    def add(self, name: str, subscription: Subscription) -> None:
        """Follow something more, under a name that is free."""
        running = asyncio.create_task(self._follow(name, subscription), name=f"subscription {subscription.path}")
        self._running[name] = subscription, running

    async def remove(self, *names: str) -> None:
        """End subscriptions, those that there are."""
        ended = [self._running.pop(name)[1] for name in names if name in self._running]
        for each in ended:
            each.cancel()
        await asyncio.gather(*ended, return_exceptions=True)

    async def texts(
        self, streams: dict[str, "JoinedStream"], subscriptions: Mapping[str, Subscription], keepalive: float
    ) -> AsyncGenerator[bytes, None]:
        """The events of all subscriptions, each with the name of its own; a comment when there is none for long.

        Args:
            streams: where this one is found while it is read.
            subscriptions: those to begin with.
            keepalive: the seconds before a comment.
        """
        ident = secrets.token_urlsafe(16)  # who knows it may change what is followed
        streams[ident] = self
        try:
            yield message("stream", "", {"stream": ident})
            for name, subscription in subscriptions.items():
                self.add(name, subscription)
            while True:
                try:
                    async with asyncio.timeout(keepalive):
                        name, text = await self._coming.get()
                except TimeoutError:
                    yield COMMENT
                    continue
                if sent := tagged(text, name):
                    yield sent
        finally:
            del streams[ident]
            await self.remove(*self._running)

    async def _follow(self, name: str, subscription: Subscription) -> None:
        answer = _Answer()
        try:
            await self._app(self._scope(name, subscription), _nothing_more, answer.send)
            end = answer.end()
        except Exception:  # whatever it is, the reader must not wait for ever
            log.exception("the subscription %s ended", subscription.path)
            end = problem(DynhullError("the gateway failed", grpc.StatusCode.INTERNAL, "", {}))
        if name in self._running:
            await self._coming.put((name, end))
            self._running.pop(name, None)

    def _scope(self, name: str, subscription: Subscription) -> Scope:
        path, _, query = subscription.path.partition("?")
        headers = list(self._headers)
        if subscription.last_event_id is not None:
            headers.append((b"last-event-id", subscription.last_event_id.encode()))

        async def take(text: bytes) -> None:
            await self._coming.put((name, text))

        where = {"path": path, "raw_path": (self._root + path).encode(), "query_string": query.encode()}
        return {**self._common, **where, "method": "GET", "root_path": "", "headers": headers, TAKE: take}


def tagged(text: bytes, name: str) -> bytes:
    """Events with the name of a subscription before their ids; comments are left out."""
    return b"".join(_tagged(block, name.encode()) for block in text.split(b"\n\n") if block and block[:1] != b":")


def _tagged(block: bytes, name: bytes) -> bytes:
    head, data, rest = block.partition(b"data: ")
    lines = [b"id: " + name + line[3:] if line[:3] == b"id:" else line for line in head.splitlines()]
    if not any(line[:3] == b"id:" for line in lines):
        lines.append(b"id: " + name)
    return b"\n".join([*lines, data + rest] if data else lines) + b"\n\n"


async def _nothing_more() -> Message:
    """What a request without a body receives: it ends with its subscription."""
    await asyncio.get_running_loop().create_future()
    return {"type": "http.disconnect"}
