"""One fence, watched once for all viewers."""

import asyncio

from dynhull_client import AsyncHullClient, DynhullError, Fence, FenceNotFoundError, Inside

from .degrees import shown_place
from .event_rows import MOST_EVENTS, EventRows
from .fence_drawing import area_of
from .marks import MOST_MARKED, Mark, Marks
from .repeating import log, repeat

MAX_RATE = 10.0
READ_SECONDS, MARK_SECONDS, RETRY_SECONDS = 1.0, 0.2, 1.0
TIMEOUT_SECONDS = 2.0
# Of more subjects inside, none is marked: their keys alone would be megabytes.
MOST_INSIDE = 10_000
# A watch that is further behind begins again with the newest events.
MOST_BEHIND = 5_000


class FenceFeed:
    """The latest state of a fence, kept up to date until closed.

    Attributes:
        name: the name of the fence.
        fence: its settings and counts; None while unknown, and while there is no fence of this name.
        trouble: why the fence could not be read the last time; None where it could.
        deleted: whether there is no fence of this name any more.
        area: its area on the page.
        inside: the subjects inside, all at one moment; None while unknown, or more than `MOST_INSIDE`.
        marks: those with a mark in the picture.
        events: its latest events.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.name = name
        self.fence: Fence | None = None
        self.trouble: DynhullError | None = None
        self.deleted = False
        self.area = area_of(name, None)
        self.inside: Inside | None = None
        self.marks = Marks(name)
        self.events = EventRows(name)
        self._client = client
        self._watched, self._seen = "", 0  # the uid of the fence, and its last sequence
        self._known = asyncio.Event()
        self._moved = asyncio.Event()
        self._task = asyncio.create_task(self._run())

    @property
    def inside_count(self) -> int:
        """The number of subjects inside."""
        if self.inside is not None:
            return len(self.inside)
        return 0 if self.fence is None else self.fence.inside

    @property
    def unit(self) -> str:
        """What follows a length: metres on the globe, nothing in a plane."""
        return "" if self.marks.center is None else " m"

    def messages(self) -> dict[str, str]:
        """What the pages draw and list, by kind."""
        return {"area": self.area.message, "inside": self.marks.message, "events": self.events.message}

    async def close(self) -> None:
        """Stop following the fence."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(repeat(self.name, self._read, lambda: READ_SECONDS))
            tasks.create_task(self._follow())
            tasks.create_task(repeat(self.name, self._mark, lambda: MARK_SECONDS, self._moved))

    async def _read(self) -> None:
        try:
            fence = await self._client.get_fence(self.name, timeout=TIMEOUT_SECONDS)
        except DynhullError as error:
            self.trouble = error
            if isinstance(error, FenceNotFoundError):
                self._forget()
            raise
        self.trouble, self.deleted = None, False
        if self.fence is None or _drawn(fence) != _drawn(self.fence):
            center = await self._center(fence)
            self.marks.center = center
            self.area = area_of(self.name, fence, center)
        self.fence = fence
        self._known.set()

    async def _center(self, fence: Fence) -> tuple[float, float] | None:
        """The centre of the hulls of a fence on the globe; None for one in the plane."""
        name = fence.subjects if isinstance(fence.subjects, str) else fence.area
        if not isinstance(name, str):
            return None
        info = await self._client.wait_for_hull(name, timeout=TIMEOUT_SECONDS)
        return info.center

    def _forget(self) -> None:
        """There is no fence of this name. Its events stay on the page."""
        self.deleted = self.deleted or self.fence is not None
        self.fence = self.inside = None
        self.area = area_of(self.name, None)
        self.marks.replace([])
        self._known.clear()

    async def _follow(self) -> None:
        """Watch the fence. A watch survives lost connections, and ends when the fence is deleted or it is behind."""
        while True:
            await self._known.wait()
            try:
                await self._watch()
            except DynhullError as error:  # reading the fence fails for the same reason, which the page shows
                log.info("%s: %s", self.name, error)
            await asyncio.sleep(RETRY_SECONDS)

    async def _watch(self) -> None:
        if self.fence is None:
            return
        uid = self.fence.uid
        before = self._seen if uid == self._watched else 0
        self._watched = uid
        self._seen = max(before, self.fence.first_sequence - 1, self.fence.last_sequence - MOST_EVENTS)
        if 0 < before < self._seen:
            self.events.skip(uid, before + 1, self._seen, "there were too many to show")
        async with self._client.watch_fence(self.name, after=self._seen, uid=uid, max_rate=MAX_RATE) as watch:
            async for event in watch:
                self.events.add(event)
                self.marks.take(event)
                self._seen = event.sequence
                self._moved.set()
                if self.fence is not None and self.fence.last_sequence - self._seen > MOST_BEHIND:
                    return

    async def _mark(self) -> None:
        """Read who is inside, and where."""
        fence = self.fence
        if fence is None or fence.other_hull is not None or fence.inside > MOST_INSIDE:
            self.inside = None
            self.marks.replace([])
            return
        inside = await self._client.fence_inside(self.name, timeout=TIMEOUT_SECONDS)
        marks = await self._positions(inside)
        if inside.sequence >= self._seen:  # otherwise the events say more
            self.inside = inside
            self.marks.replace(marks)

    async def _positions(self, inside: Inside) -> list[Mark]:
        marks: list[Mark] = []
        for each in inside.subjects:
            keys = each.keys[: MOST_MARKED - len(marks)]
            if not keys:
                break
            found = await self._client.positions(each.hull, keys, timeout=TIMEOUT_SECONDS)
            rows = zip(keys, found.positions.tolist(), found.present.tolist(), strict=True)
            center = self.marks.center
            marks.extend(
                Mark(each.hull, str(key), *shown_place(x, y, center)) for key, (x, y), present in rows if present
            )
        return marks


def _drawn(fence: Fence) -> tuple[object, ...]:
    """What the picture shows: settings, and the centre of the hulls, which stays as long as the fence."""
    return fence.uid, fence.area, fence.other_hull, fence.margin, fence.near
