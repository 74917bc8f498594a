"""Watches that are shared by all their readers, each for as long as somebody reads it."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Hashable
from contextlib import AbstractAsyncContextManager, aclosing, suppress
from typing import Any, Generic, Protocol, TypeVar

import grpc

from dynhull_client import Alarm, DynhullError, Fence

from .messages import COMMENT, message, problem
from .messages import place as text_of_place

log = logging.getLogger(__name__)

RETRY_SECONDS = 0.5

Happening = TypeVar("Happening")
AnyFeed = TypeVar("AnyFeed", bound="SharedWatch[Any]")


class SharedWatch(ABC, Generic[Happening]):
    """A watch, which goes on over restarts of the server.

    Args:
        subject: what is watched, for people.

    Attributes:
        readers: the number of those who read it.
        failure: why it has ended; None while it has not.
        news: set, and replaced, when there is something to read.
    """

    def __init__(self, subject: str) -> None:
        self.readers = 0
        self.failure: DynhullError | None = None
        self.news = asyncio.Event()
        self._subject = subject
        self._task = asyncio.create_task(self._follow(), name=f"events of {subject}")

    @abstractmethod
    def watch(self) -> "AbstractAsyncContextManager[AsyncIterator[Happening]]":
        """A watch from where this one is."""

    @abstractmethod
    def take(self, happening: Happening) -> None:
        """Keep what the watch has returned."""

    def passes(self, error: DynhullError) -> bool:
        """Whether a watch that has ended with this error goes on later."""
        return error.code == grpc.StatusCode.UNAVAILABLE

    async def close(self) -> None:
        """End the watch."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    def tell(self) -> None:
        """Wake the readers."""
        self.news.set()
        self.news = asyncio.Event()

    async def _follow(self) -> None:
        while self.failure is None:
            try:
                async with self.watch() as watch:
                    async for happening in watch:
                        self.take(happening)
            except DynhullError as error:
                if self.passes(error):
                    await asyncio.sleep(RETRY_SECONDS)
                    continue
                self._fail(error)
            except Exception:  # whatever it is, the readers must not wait for ever
                log.exception("the events of %s ended", self._subject)
                self._fail(DynhullError("the gateway failed", grpc.StatusCode.INTERNAL, "", {}))

    def _fail(self, error: DynhullError) -> None:
        self.failure = error
        self.tell()


class SharedWatches:
    """The watches that are read, by what they are of."""

    def __init__(self) -> None:
        self._feeds: dict[Hashable, SharedWatch[Any]] = {}

    async def read(
        self, view: Hashable, begin: Callable[[], AnyFeed], texts: Callable[[AnyFeed], AsyncGenerator[bytes, None]]
    ) -> AsyncIterator[bytes]:
        """The events of a watch, which is there while somebody reads it.

        Args:
            view: what it is of: the same for all who get the same.
            begin: makes it.
            texts: reads it.
        """
        feed: Any = self._feeds.get(view)
        if feed is None or feed.failure is not None:
            feed = self._feeds[view] = begin()
        feed.readers += 1
        try:
            async with aclosing(texts(feed)) as read:
                async for text in read:
                    yield text
        finally:
            feed.readers -= 1
            if not feed.readers:
                if self._feeds.get(view) is feed:
                    del self._feeds[view]
                await feed.close()


class Place(Protocol):
    """How far a reader is: the name of what is read, its uid, and what the reader goes on after."""

    name: Any
    uid: str
    after: Any


class NumberedPlace(Place, Protocol):
    """How far a reader of numbered events is, and whether it has been sent where that is."""

    told: bool


def begin_at(place: NumberedPlace, there: Fence | Alarm) -> None:
    """Begin after the last event, unless the reader says where."""
    place.uid = there.uid
    place.after = there.last_sequence if place.after is None else place.after


async def told(place: NumberedPlace, get: Callable[[str], Awaitable[Fence | Alarm]]) -> bytes:
    """The id of where a reader begins, which misses nothing if it is cut off before the first event.

    Args:
        place: where that is. It is looked for here only if it is not known: a reader sees its stream open before, and
            what happens from then on is to come.
        get: asks for what is read.
    """
    if not place.uid:
        begin_at(place, await get(place.name))
    place.told = True
    return text_of_place(f"{place.uid}:{place.after}")


async def over_restarts(
    read: Callable[[], AsyncIterator[bytes]],
    place: Place,
    kind: str,
    replaced: type[DynhullError],
    end: Callable[[DynhullError], bytes] = problem,
) -> AsyncIterator[bytes]:
    """The texts of a watch, and of those that follow it when the server was away, until one ends.

    Args:
        read: the texts of a watch from where the reader is.
        place: where the reader is.
        kind: what is read, such as "fence".
        replaced: the error that says that another one has the name now: the reader goes to the beginning of that.
        end: the text of the error that ends them.
    """
    while True:
        try:
            async for text in read():
                yield text
        except replaced:
            place.uid, place.after = "", 0
            yield message("replaced", "", {kind: place.name})
        except DynhullError as error:
            if error.code != grpc.StatusCode.UNAVAILABLE:
                yield end(error)
                return
            yield COMMENT
            await asyncio.sleep(RETRY_SECONDS)
        else:
            return
