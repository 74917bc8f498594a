"""The hulls by name, as their callers use them."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from ..state.batch import Applied, Write
from ..state.core import not_stored
from ..state.errors import (
    HullNotFoundError,
    HullUnsuitableError,
    NotStoredError,
    OutcomeUnknownError,
    PartRefusedError,
    words_for_callers,
)
from ..state.hull import Hull
from ..state.records import DEFAULT, HullSettings
from ..state.registry import page_of
from ..state.requests import CreateHull, DeleteHull, Expire, WriteBatch, WriteTogether
from ..storage.past import StoredHistory
from ..storage.port import NotCommittedError, Storage
from .batch_stream import BatchStream
from .divided_hull import DividedHull
from .division import Divisions
from .driver import Driver
from .feed import HullFeeds
from .feed_consumers import FeedConsumers
from .feed_many import PrefixFeed
from .fences import Fences
from .filing import Filing
from .layers import COPIES
from .live_hull import LiveHull
from .outliving import Outliving
from .past import PastHull, PastHulls, Place
from .positions import Standing, standing
from .recalls import UNREADABLE, Recalls
from .replay import ReplayedHull
from .roster import Roster
from .rosters import Rosters
from .series import KeptSeries
from .waiter import Waiter


class Hulls:
    """The hulls of an engine.

    Args:
        driver: drives the core that has them.
        storage: keeps them.
        fences: the fences that compare them.
        divisions: runs hulls over shards; None for a server that has none.

    Attributes:
        rosters: those of the watches of many hulls.
        pasts: finds and rebuilds earlier revisions.
        series: the measures that are kept.
        feeds: reads the batches of each.
        feed_consumers: those of these feeds.
        filing: writes the segments of their past.
    """

    def __init__(self, driver: Driver, storage: Storage, fences: Fences, divisions: Divisions | None) -> None:
        self.rosters = Rosters(lambda: driver.core.hulls.values())
        self.series = KeptSeries(self.of, driver)
        self.pasts = PastHulls(driver, storage, keeps=storage.keeps, max_rows=driver.limits.max_past_rows)
        self.feeds = HullFeeds(driver, storage, self.pasts, keeps=storage.keeps)
        self._newest = 0  # the number of the last commit with a batch
        self.feed_consumers = FeedConsumers(
            driver, storage, self.feeds, self.get, lambda: (self.standing, self._newest)
        )
        self._driver = driver
        self._fences = fences
        self._divisions = divisions
        self._copies = asyncio.Semaphore(COPIES)
        self._recalls = Recalls(storage, driver.on_disk)
        self._storage = storage
        self._changing = Outliving()
        self._turn_of_settings = asyncio.Lock()
        self.filing = Filing(driver, storage, self.pasts)
        self._live: dict[Hull, LiveHull] = {}
        self._incarnation = driver.machine.token()  # that of hulls in memory; others find theirs in the storage
        self._standing = standing(self._incarnation, driver.published)

    def __len__(self) -> int:
        return len(self._driver.core.hulls)

    def __iter__(self) -> Iterator[LiveHull]:
        return iter([self._live_hull(hull) for hull in list(self._driver.core.hulls.values())])

    def get(self, name: str) -> LiveHull:
        """The hull of that name, or raise HullNotFoundError."""
        return self._live_hull(self._driver.core.get(name))

    def of(self, hull: Hull) -> LiveHull:
        """A hull of the core as its callers use it, or raise HullNotFoundError if it is there no more."""
        if hull.ended:
            raise HullNotFoundError(hull.name)
        return self._live_hull(hull)

    async def past(self, live: LiveHull, revision: int | None, time: int, place: Place) -> PastHull:
        """A hull as it was.

        Args:
            live: the hull.
            revision: the revision; None for the last one committed at or before the time.
            time: the time, in microseconds since 1970.
            place: holds a place of those who may rebuild at the same time.
        """
        with place():
            moment = await self.pasts.moment(live, revision, time)
        hull = self._same(live)
        past = PastHull(self._driver, hull, self._recalls, self._fences, self._copies, self.pasts, place, moment)
        await past.begin()
        return past

    async def replayed(self, live: LiveHull, first: int, last: int) -> ReplayedHull:
        """A hull at its first revision, on its way to its last one. Raises the errors of `PastHulls.state`."""
        hull = self._same(live)
        state, erasures = await self.pasts.own(hull, first)
        around = self._driver, hull, self._recalls, self._fences, self._copies
        return ReplayedHull(*around, live, self.pasts, state, erasures, last)

    def _same(self, live: LiveHull) -> Hull:
        """The hull of the core, or raise HullNotFoundError if there is another one of that name by now."""
        hull = self._driver.core.get(live.name)
        if hull.row.number != live.number:
            raise HullNotFoundError(live.name)
        return hull

    def feed(self, roster: Roster) -> PrefixFeed:
        """The feed of the hulls of a roster, for one reader."""
        return PrefixFeed(self.feeds, self.get, roster, self.standing.incarnation)

    def has(self, name: str) -> bool:
        """Whether a hull of that name exists."""
        return name in self._driver.core.hulls

    def page(self, prefixes: Sequence[str], after: str, size: int) -> tuple[list[LiveHull], bool]:
        """At most `size` hulls whose names follow `after`, and whether there are more.

        Only names that begin with one of the prefixes. These are sorted, and none of them begins with another.
        """
        names, more = page_of(self._driver.core.hulls, prefixes, after, size)
        return [self.get(name) for name in names], more

    async def create(self, name: str, settings: HullSettings = DEFAULT) -> LiveHull:
        """Create an empty hull, or raise HullExistsError, LimitExceededError or NotStoredError."""
        if settings.divided:
            no_shards = "config.shards", "cannot be divided: this server has no shards"
            why_not = no_shards if self._divisions is None else self._divisions.why_not(settings)
            if why_not is not None:
                field, reason = why_not
                raise HullUnsuitableError(name, reason, field=field)
        if settings.history:
            self._require_history(name, settings)
        hull: Hull = await self._driver.ask(
            CreateHull(Waiter(), name, self._driver.birth(), settings, self._driver.time())
        )
        return self._live_hull(hull)

    async def delete(self, name: str) -> None:
        """Delete the hull of that name, or raise HullNotFoundError or NotStoredError."""
        await self._driver.ask(DeleteHull(Waiter(), name, self._driver.time()))

    async def set_history(self, name: str, max_age: int, max_bytes: int) -> LiveHull:
        """Change how much of the past of a hull is kept, as in `HullSettings`.

        It is changed even if its caller goes away.

        Raises:
            HullNotFoundError: no hull has that name.
            HullUnsuitableError: the server can keep none of it.
            NotStoredError: the storage has failed, and it is as before.
        """
        hull = self._driver.core.get(name)
        if max_age:
            self._require_history(name, hull.row.settings)
        elif not hull.row.settings.history:
            return self._live_hull(hull)
        await self._changing.run(self._set_history(hull, max_age, max_bytes))
        return self._live_hull(hull)

    async def _set_history(self, hull: Hull, max_age: int, max_bytes: int) -> None:
        async with self._turn_of_settings:
            try:
                await self._driver.commit([self._storage.set_history(hull.row.number, max_age, max_bytes)])
                await self.filing.take_settings(hull)
            except KeyError:
                raise HullNotFoundError(hull.name) from None
            except NotCommittedError as error:
                raise not_stored(error) from error
            except Exception as error:
                self.filing.unsure.add(hull)
                raise OutcomeUnknownError(words_for_callers(error)) from error

    def _require_history(self, name: str, settings: HullSettings) -> None:
        """Raise HullUnsuitableError if a hull with these settings can have no history."""
        if settings.divided:
            raise HullUnsuitableError(name, "is divided among shards, and has no history", field="config.history")
        if why_not := self._storage.why_no_history():
            raise HullUnsuitableError(name, why_not, field="config.history")

    async def history(self, name: str) -> tuple[LiveHull, StoredHistory]:
        """What is there of the past of a hull.

        Raises:
            HullNotFoundError: no hull has that name.
            NotStoredError: it cannot be read at present.
        """
        hull = self._driver.core.get(name)
        try:
            found = await self._driver.on_disk(partial(self._storage.history, hull.row.number))
        except KeyError:  # deleted meanwhile
            raise HullNotFoundError(name) from None
        except UNREADABLE as error:
            raise NotStoredError(words_for_callers(error)) from error
        if hull.divided:  # only its present can be read
            found = StoredHistory(found.last, found.last)
        return self._live_hull(hull), found

    async def apply(self, write: Write, *, create: bool) -> Applied:
        """Apply a batch as the next revision of a hull, or raise the error that refuses it.

        With `create`, a missing hull is created.
        """
        birth = self._driver.birth() if create else None
        applied: Applied = await self._driver.ask(WriteBatch(Waiter(), write, birth))
        return applied

    async def apply_together(self, writes: Sequence[Write], rows: int) -> list[Applied]:
        """Apply a batch to each of several hulls, which have about `rows` points together.

        Raises:
            PartRefusedError: one of them is refused: then none is applied.
        """
        request = WriteTogether(Waiter(), writes, rows=rows)
        try:
            results: list[Applied] = await self._driver.ask(request)
        except Exception as error:
            if request.refused is None:
                raise
            raise PartRefusedError(request.refused, error) from None
        return results

    def stream(self, name: str, notify: Callable[[], None], *, create: bool) -> BatchStream:
        """A stream of batches to one hull; `notify` is called after each that was applied or refused.

        Raises:
            HullNotFoundError: no hull has that name, and `create` is False.
        """
        hull = self._driver.core.get(name) if self.has(name) or not create else None
        return BatchStream(self._driver, name, hull, notify)

    @property
    def standing(self) -> Standing:
        """How far what is published has come."""
        if not self._driver.core.undecided:  # otherwise it may lack an earlier commit than the latest
            self._standing = standing(self._incarnation, self._driver.published)
        return self._standing

    # What the engine calls

    def restored(self, incarnation: str) -> None:
        """Begin with the hulls of the storage, whose incarnation this is."""
        self._incarnation = incarnation
        commits = (hull.committed for hull in self._driver.core.hulls.values())
        self._newest = max((commit.number for commit in commits if commit is not None), default=0)

    def moved(self, hulls: Sequence[Hull]) -> None:
        """Wake the watchers of hulls: each has a new revision, or was deleted."""
        published = self._driver.published
        self._newest = published.number
        for hull in hulls:
            if hull.committed is None or hull.committed < published:  # one that has just been examined is later
                hull.committed = published
            if hull.divided and self._divisions is not None:
                if hull.ended:
                    self._divisions.end(hull)
                else:
                    self._divisions.begin(hull)
            live = self._live.get(hull)
            if live is not None:
                live.moved()
                if hull.ended:
                    del self._live[hull]
        if self.rosters.in_use:
            self.rosters.moved(hulls)
        if self.series.seconds:
            self.series.moved(hulls)

    def divide(self, hull: Hull, requests: Sequence[WriteBatch | Expire]) -> None:
        """Have the shards of a hull carry out requests."""
        assert self._divisions is not None  # otherwise there is no such hull
        self._divisions.carry_out(hull, requests)

    def _live_hull(self, hull: Hull) -> LiveHull:
        live = self._live.get(hull)
        if live is None:
            around = self._driver, hull, self._recalls, self._fences, self._copies
            if hull.divided and self._divisions is not None:
                live = DividedHull(*around, self._divisions.of(hull))
            else:
                live = LiveHull(*around)
            if not hull.ended:
                self._live[hull] = live
        return live
