"""The asyncio client."""

from collections.abc import AsyncIterator, Callable, Coroutine
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from . import _alarms as alarms
from . import _calls as calls
from . import _feed as feeds
from . import _feed_consumers as readers
from . import _fences as fences
from . import _fences_between as between
from . import _history as past
from . import _layers as peeling
from . import _many as many
from . import _past as earlier
from . import _quarantine as quarantine
from . import _replay as playing
from . import _series as kept
from . import _tracks as ways
from . import _uses as uses
from ._async_connection import AsyncConnection
from ._async_ingest import AsyncIngest
from ._async_past import AsyncPast
from ._async_pipeline import AsyncPipeline
from ._async_watch import (
    AsyncAlarmWatch,
    AsyncFeed,
    AsyncFenceEvents,
    AsyncFenceWatch,
    AsyncManyWatch,
    AsyncReplay,
    AsyncWatch,
)
from ._async_writer import AsyncWriter
from ._calls import Call, Pages
from ._messages import HullInfo
from ._methods import Client, answer_of, described, documented, opening

P = ParamSpec("P")
Result = TypeVar("Result")


def _answering(
    describe: Callable[P, Call[Result]],
) -> Callable[Concatenate["AsyncHullClient", P], Coroutine[Any, Any, Result]]:
    """The coroutine that makes a call and returns its answer."""

    async def method(self: "AsyncHullClient", /, *arguments: P.args, **options: P.kwargs) -> Result:
        return await self._connection.answer(described(describe, *arguments, **options))

    documented(method, describe, answer_of(describe))
    return method


def _reading(describe: Callable[P, Call[Result]]) -> Callable[Concatenate["AsyncHullClient", P], AsyncIterator[Result]]:
    """The method that makes a call and returns its answer part by part."""

    def method(self: "AsyncHullClient", /, *arguments: P.args, **options: P.kwargs) -> AsyncIterator[Result]:
        return self._connection.parts(described(describe, *arguments, **options))

    documented(method, describe, f"AsyncIterator[{answer_of(describe)}]")
    return method


def _listing(
    describe: Callable[P, Pages[Result]],
) -> Callable[Concatenate["AsyncHullClient", P], AsyncIterator[Result]]:
    """The method that returns a list, one after the other."""

    async def method(self: "AsyncHullClient", /, *arguments: P.args, **options: P.kwargs) -> AsyncIterator[Result]:
        page, token = described(describe, *arguments, **options), ""
        while True:
            found, token = await self._connection.answer(page(token))
            for each in found:
                yield each
            if not token:
                return

    documented(method, describe, f"AsyncIterator[{answer_of(describe)}]")
    return method


def _past(
    describe: Callable[P, Call[HullInfo]],
) -> Callable[Concatenate["AsyncHullClient", P], Coroutine[Any, Any, AsyncPast]]:
    """The coroutine that finds a hull as it was."""

    async def method(self: "AsyncHullClient", /, *arguments: P.args, **options: P.kwargs) -> AsyncPast:
        info = await self._connection.answer(described(describe, *arguments, **options))
        return AsyncPast(self._connection, info)

    documented(method, describe, "AsyncPast")
    return method


class AsyncHullClient(Client[AsyncConnection]):
    """A client of a dynhull server for asyncio; arguments and errors as for `HullClient`.

    Make and use it in one running event loop. An async context manager, which closes it.
    """

    _connect = AsyncConnection

    create_hull = _answering(calls.create_hull)
    recenter = _answering(calls.recenter)
    reshard = _answering(calls.reshard)
    set_history = _answering(past.set_history)
    history = _answering(past.history)
    erase_history = _answering(past.erase_history)
    wait_for_hull = _answering(calls.wait_for_hull)
    delete_hull = _answering(calls.delete_hull)
    apply = _answering(calls.apply)
    put = _answering(calls.put)
    remove = _answering(calls.remove)
    release = _answering(quarantine.release)
    drop = _answering(quarantine.drop)
    set_quarantine = _answering(quarantine.set_quarantine)
    transfer = _answering(calls.transfer)
    last_sequence = _answering(calls.last_sequence)
    locate = _answering(calls.locate)
    count = _answering(calls.count)
    positions = _answering(calls.positions)
    entities = _answering(calls.entities)
    read_points = _reading(calls.read_points)
    support = _answering(calls.support)
    tangents = _answering(calls.tangents)
    distance = _answering(calls.distance)
    intersect_lines = _answering(calls.intersect_lines)
    get_hull = _answering(calls.get_hull)
    sample_points = _answering(calls.sample_points)
    verify = _answering(calls.verify)
    layers = _answering(peeling.layers)
    influence = _answering(peeling.influence)
    get_measures = _answering(uses.get_measures)
    series = _answering(kept.series)
    track = _answering(ways.track)
    at = _past(earlier.at)
    separate = _answering(uses.separate)
    phase_diagram = _answering(uses.phase_diagram)
    frontier = _answering(uses.frontier)
    create_fence = _answering(fences.create_fence)
    replace_fence = _answering(fences.replace_fence)
    delete_fence = _answering(fences.delete_fence)
    get_fence = _answering(fences.get_fence)
    fence_inside = _answering(fences.fence_inside)
    ack_fence = _answering(fences.ack_fence)
    delete_consumer = _answering(fences.delete_consumer)
    ack_feed = _answering(readers.ack_feed)
    delete_feed_consumer = _answering(readers.delete_feed_consumer)
    create_alarm = _answering(alarms.create_alarm)
    delete_alarm = _answering(alarms.delete_alarm)
    get_alarm = _answering(alarms.get_alarm)
    acknowledge_alarm = _answering(alarms.acknowledge_alarm)
    mute_alarm = _answering(alarms.mute_alarm)
    ack_alarm = _answering(alarms.ack_alarm)
    delete_alarm_consumer = _answering(alarms.delete_alarm_consumer)
    list_hulls = _listing(calls.list_hulls)
    list_held = _listing(quarantine.list_held)
    list_fences = _listing(fences.list_fences)
    list_alarms = _listing(alarms.list_alarms)
    list_feed_consumers = _listing(readers.list_feed_consumers)
    ingest = opening(AsyncIngest, calls.ingest)
    pipeline = opening(AsyncPipeline, calls.pipeline)
    watch = opening(AsyncWatch, calls.watch)
    replay = opening(AsyncReplay, playing.replay)
    watch_many = opening(AsyncManyWatch, many.watch_many)
    feed = opening(AsyncFeed, feeds.feed)
    watch_fence = opening(AsyncFenceWatch, fences.watch_fence)
    fence_events_between = opening(AsyncFenceEvents, between.fence_events_between)
    watch_alarm = opening(AsyncAlarmWatch, alarms.watch_alarm)
    writer = opening(AsyncWriter, calls.writer)

    def presence(self) -> AsyncIterator[bool]:
        """Whether the server is connected, now and whenever that changes, until the client is closed.

        It connects again by itself, also where nothing is called, and notices a server that is silent, see
        `ping_interval`.
        """
        return self._connection.presence()

    async def close(self) -> None:
        """Close the connection and end the calls on it."""
        await self._connection.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()
