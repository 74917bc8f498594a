"""What callers ask of a root that is served: each is carried out in its thread, and answered on the event loop."""

import asyncio
from typing import Any, Protocol

from dynhull_server.state import requests
from dynhull_server.state.hull import Hull
from dynhull_server.state.trip import refuse

from ..shards import messages as say
from ..shards.requests import ExpirePoints, Read, Reshard, RootRequest, RootWrite


class Asker(Protocol):
    """Somebody who asked hears of the answer."""

    def tell(self) -> None:
        """Have them hear of it, on the event loop."""


class AskedWrite(RootWrite):
    """A batch of a caller. Its stream stops with it, in the thread of the root, before another one begins."""

    def __init__(self, request: requests.WriteBatch, hull: Hull, now: float, answered: list[Asker]) -> None:
        super().__init__(request, now)
        self._hull = hull
        self._answered = answered

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        super().answer(result, error)
        if error is not None:
            refuse(self.batch, error)
        else:
            self.batch.result = result
            if self.batch.stream is not None:
                self.batch.stream.hull = self._hull
        self._answered.append(self)

    @property
    def for_another_hull(self) -> bool:
        """Whether the batches of its stream before it were applied to another hull of this name."""
        stream = self.batch.stream
        return stream is not None and stream.hull is not None and stream.hull is not self._hull

    def tell(self) -> None:
        """Have the caller hear of it."""
        if not self.batch.abandoned:
            self.batch.to.answer(self.batch)


class AskedExpiry(ExpirePoints):
    """Points that leave by the clock, as the core has noticed."""

    def __init__(self, request: requests.Expire, answered: list[Asker]) -> None:
        super().__init__(request.time)
        self._request = request
        self._answered = answered

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        super().answer(result, error)
        self._request.result, self._request.error = result, error
        self._answered.append(self)

    def tell(self) -> None:
        """Have the core hear of it."""
        self._request.to.answer(self._request)


class _Awaited(RootRequest):
    """What a caller waits for. The counts are those of its revision: readers see each decision before the next one.

    Attributes:
        counts: the counts of the hull.
        asked: is done when the caller has been told.
    """

    def _await(self, hull: Hull, answered: list[Asker]) -> None:
        self.counts = hull.counts
        self.asked: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._hull = hull
        self._answered = answered

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        super().answer(result, error)
        self.counts = self._hull.counts
        self._answered.append(self)

    def tell(self) -> None:
        """Have the caller hear of it."""
        if not self.asked.done():
            self.asked.set_result(None)


class AskedRead(_Awaited, Read):
    """A question of a reader."""

    def __init__(self, question: say.Question, hull: Hull, answered: list[Asker]) -> None:
        Read.__init__(self, question)
        self._await(hull, answered)


class AskedReshard(_Awaited, Reshard):
    """Another number of shards."""

    def __init__(self, shards: int, hull: Hull, answered: list[Asker]) -> None:
        Reshard.__init__(self, shards)
        self._await(hull, answered)


Asked = AskedWrite | AskedExpiry | AskedRead | AskedReshard
