"""What many calls at a gateway have in common, for as long as one of them uses it.

The worker does not know who reads a feed, and its file of tokens may be another one than that of the gateway. So once a
feed has begun, each call that is to read it asks the worker whether it may, and when the tokens of the worker change,
the worker ends the feed: all of its calls then ask again, and go on with the next feed.
"""

import asyncio
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Generic, Protocol, TypeVar

from google.protobuf.message import Message
from google.rpc import code_pb2

from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.status import TOKENS_CHANGED, RelayedError

from .again import reason_of
from .callers import metadata_of_feed
from .upstream import Upstream, one_request
from .worker_link import WorkerLink


class SharedFeed(Protocol):
    """A watch of a worker, for several calls."""

    @property
    def over(self) -> bool:
        """Whether it has ended by itself."""

    def close(self) -> None:
        """End it."""


class WatchFeed(ABC):
    """One watch of a worker, for all watches of a kind.

    Args:
        link: the worker.
        method: the path of the method.
        request: the watch.
        name: that of what is watched.
        ending: what it fails with if the worker ends it without a failure, or None.

    Attributes:
        over: whether it has ended by itself.
        failure: what it has ended with, or None.
    """

    def __init__(
        self, link: WorkerLink, method: str, request: Message, name: str, ending: Exception | None = None
    ) -> None:
        self.over = False
        self.failure: Exception | None = None
        self._moved = asyncio.Event()
        self._running = asyncio.create_task(
            self._run(partial(link.stream, method, metadata_of_feed(name)), request, ending)
        )

    def close(self) -> None:
        """End the watch."""
        self._running.cancel()

    async def _run(self, begin: Callable[[], Upstream], request: Message, ending: Exception | None) -> None:
        try:
            async with one_request(begin(), request.SerializeToString(), nullcontext()) as upstream:
                while (message := await upstream.read()) is not None:
                    await self._take(message)
            self.failure = ending
        except Exception as error:  # each watcher raises it, and logs what is a bug
            self.failure = error
        self.over = True
        self._wake()

    @abstractmethod
    async def _take(self, message: bytes) -> None:
        """Take the next response."""

    def _wake(self) -> None:
        self._moved.set()
        self._moved = asyncio.Event()


F = TypeVar("F", bound=SharedFeed)


class Feeds(Generic[F]):
    """The feeds in use, by their keys."""

    def __init__(self) -> None:
        self._feeds: dict[Hashable, F] = {}
        self._users: Counter[F] = Counter()

    @contextmanager
    def use(self, key: Hashable, begin: Callable[[], F]) -> Iterator[F]:
        """The feed with this key: a new one if none goes on. It ends with the last block that uses it."""
        feed = self._feeds.get(key)
        if feed is None or feed.over:
            feed = self._feeds[key] = begin()
        self._users[feed] += 1
        try:
            yield feed
        finally:
            self._users[feed] -= 1
            if not self._users[feed]:
                del self._users[feed]
                feed.close()
                if self._feeds.get(key) is feed:
                    del self._feeds[key]


async def require_allowed(call: Call, link: WorkerLink, method: str, request: Message) -> None:
    """Have the worker say whether the caller may read a feed, by a small request that needs the same right.

    Args:
        call: the call.
        link: the worker.
        method: the path of the method of the request.
        request: the request.

    Raises:
        RelayedError: it may not, or the worker cannot say.
        WorkerAwayError: the worker is away.
    """
    if not call.caller.key:
        return
    try:
        with call.cutoff():
            await link.ask(method, call, request.SerializeToString())
    except RelayedError as refusal:
        # Rights come first, so what is not there any more may be read; the feed says the rest.
        if refusal.status.code != code_pb2.NOT_FOUND:
            raise


def tokens_have_changed(failure: Exception | None) -> bool:
    """Whether a feed has ended because its calls have to ask again."""
    return isinstance(failure, RelayedError) and reason_of(failure.status) == TOKENS_CHANGED
