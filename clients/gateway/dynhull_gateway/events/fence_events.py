"""The events of a fence, each once and in order."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass

from dynhull_cli.fences.shown import event_members
from dynhull_client import AsyncHullClient, FenceEvent, FenceReplacedError

from .messages import COMMENT, message
from .shared import over_restarts, told


@dataclass(slots=True)
class Reading:
    """What is read, and how far.

    Attributes:
        name: the fence.
        consumer: a durable consumer that knows its place; None for `uid` and `after`.
        uid: the uid of the fence; empty if it is not known yet.
        after: the sequence of the last event that the reader has; None for new events only.
        conflate: whether to leave out events that cancel each other.
        exact: the sequence up to which none is left out again: the reader has a part of what was sent together.
        told: whether the reader has an id that says where it is.
        ended: whether the fence was deleted.
    """

    name: str
    consumer: str | None
    uid: str
    after: int | None
    conflate: bool
    exact: int = 0
    told: bool = False
    ended: bool = False


def events(client: AsyncHullClient, reading: Reading, keepalive: float) -> AsyncIterator[bytes]:
    """The events as text, over restarts of the server; a comment when there is none for long."""

    async def read() -> AsyncIterator[bytes]:
        while not reading.ended:
            async for text in _watched(client, reading, keepalive):
                yield text

    return over_restarts(read, reading, "fence", FenceReplacedError)


async def _watched(client: AsyncHullClient, reading: Reading, keepalive: float) -> AsyncIterator[bytes]:
    """One watch, which continues over lost connections itself once it has begun.

    Who has a part of what was sent together is not where any sequence leads. The ids of such events say so, from which
    sequence to which, and a reader with such an id is sent all events of that part.
    """
    if reading.consumer is None and not (reading.uid and reading.told):
        yield await told(reading, client.get_fence)
    exact = reading.conflate and (reading.after or 0) < reading.exact
    watch = client.watch_fence(
        reading.name,
        consumer=reading.consumer,
        after=None if reading.consumer else reading.after,
        uid=reading.uid,
        conflate=reading.conflate and not exact,
    )
    together: list[FenceEvent] = []
    async with watch:
        coming = asyncio.ensure_future(anext(watch))
        try:
            while True:
                done, _ = await asyncio.wait([coming], timeout=keepalive)
                if not done:
                    yield COMMENT
                    continue
                try:
                    event = coming.result()
                except StopAsyncIteration:
                    reading.ended = True
                    return
                together.append(event)
                if event.after is not None:
                    idents = [f"{event.uid}:{reading.after}~{event.after}"] * (len(together) - 1)
                    idents.append(f"{event.uid}:{event.after}")
                    text = b"".join(map(_text, together, idents))
                    together.clear()  # they take more memory than the text, and a reader may take long
                    yield text
                    reading.uid, reading.after = event.uid, event.after
                    if exact and event.after >= reading.exact:
                        return
                coming = asyncio.ensure_future(anext(watch))
        finally:
            coming.cancel()
            await asyncio.gather(coming, return_exceptions=True)


def _text(event: FenceEvent, ident: str) -> bytes:
    return message(event.type, ident, event_members(event))
