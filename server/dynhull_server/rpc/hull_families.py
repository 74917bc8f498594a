"""Metrics of hulls: of all of them together, and the measures of some.

Those of a page are gathered in slices: ten thousand hulls delay no other call.
"""

import asyncio
import heapq
import logging
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from operator import itemgetter
from typing import Any, NamedTuple, TypeVar, get_args

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric

from ..engine.driver import Driver
from ..engine.feed_consumers import FeedConsumers, shown
from ..engine.hulls import Hulls
from ..engine.measures import HullMeasures
from ..engine.past import Outcome
from ..engine.series import KeptSeries
from ..engine.server_time import MICROSECONDS
from ..engine.steps import Slices
from ..state.errors import HullNotFoundError
from ..state.hull import Hull
from ..storage.past import Hole

# The number of largest hulls with metrics of their own; for all hulls there would be too many for Prometheus.
NAMED_HULLS = 100
# The same for consumers of feeds.
NAMED_CONSUMERS = 100
# Seconds in which the measures for one page are made. What then still lacks them has those of an earlier page, if any.
MEASURING_SECONDS = 2.0

# Of which hulls: whether on the globe; their measures, what these are, and their unit by the rules of Prometheus.
MEASURES = (
    (False, "area", "Area of the hull, in the square of the unit of its coordinates.", ""),
    (False, "perimeter", "Length of the boundary, in the unit of the coordinates.", ""),
    (False, "diameter", "Greatest distance of two vertices, in the unit of the coordinates.", ""),
    (False, "width", "Least distance of two parallel lines around the hull, in the unit of the coordinates.", ""),
    (True, "area", "Area of the hull on the globe.", "square_meters"),
    (True, "perimeter", "Length of the boundary on the globe.", "meters"),
    (True, "diameter", "Greatest distance of two vertices on the globe.", "meters"),
)

T = TypeVar("T", bound=tuple[Any, ...])

log = logging.getLogger(__name__)


class _Measured(NamedTuple):
    revision: int
    points: int
    vertices: int
    measures: HullMeasures
    changed: int | None


# The name of a hull, whether it is on the globe, and what was measured.
_Named = tuple[str, bool, _Measured]


@dataclass
class _Survey:
    """What one look at all hulls finds.

    Attributes:
        points, entities, held: of all hulls together.
        slowest: the slowest clock that follows event times.
        largest: the largest hulls, each after its number of points.
        chosen: the oldest hulls that are to have measures, each after its negative number.
        left_out: the number of others that would.
    """

    points: int = 0
    entities: int = 0
    held: int = 0
    slowest: int | None = None
    largest: list[tuple[int, int, Hull]] = field(default_factory=list)
    chosen: list[tuple[int, Hull]] = field(default_factory=list)
    left_out: int = 0


class HullFamilies:
    """The metrics of hulls.

    Args:
        driver: drives the core that has them.
        hulls: the hulls.
        prefixes: hulls whose names begin with one of these have their measures on the page.
        most: their largest number; the hulls that were created first have them.
    """

    def __init__(self, driver: Driver, hulls: Hulls, prefixes: Sequence[str], most: int) -> None:
        self._driver = driver
        self._hulls = hulls
        self._prefixes = tuple(prefixes)
        self._most = most
        self._measured: dict[Hull, _Measured] = {}
        self._left_out = 0

    async def look(self) -> Iterator[Metric]:
        """Look at all hulls, on the event loop. Another thread may make the metrics of what is returned."""
        survey = await self._survey()
        if self._prefixes:
            self._say(survey.left_out)
            await self._measure([hull for _, hull in sorted(survey.chosen, reverse=True)])
        present = [(hull, each) for hull, each in self._measured.items() if not hull.ended]
        measured = [(hull.name, hull.row.settings.geographic, each) for hull, each in present]
        largest = [hull for *_, hull in sorted(survey.largest, reverse=True) if hull not in self._measured]
        sizes = [(hull.name, hull.counts.points, hull.vertex_count) for hull in largest]
        sums = [*self._sums(survey), *self._past(await self._hulls.pasts.holes())]
        return chain(sums, _sizes(measured, sizes), _measures(measured) if self._prefixes else ())

    def _sums(self, survey: _Survey) -> list[Metric]:
        lag = 0.0 if survey.slowest is None else max(self._driver.time() - survey.slowest, 0) / MICROSECONDS
        behind = "Seconds by which the slowest clock that event times drive is behind the server's; 0 without any."
        sums: list[Metric] = [
            GaugeMetricFamily("dynhull_hulls", "Hulls.", value=len(self._driver.core.hulls)),
            GaugeMetricFamily("dynhull_points", "Points of all hulls.", value=survey.points),
            GaugeMetricFamily("dynhull_entities", "Points of all keyed hulls.", value=survey.entities),
            GaugeMetricFamily("dynhull_held_keys", "Keys in quarantine.", value=survey.held),
            GaugeMetricFamily("dynhull_clock_lag_seconds", behind, value=lag),
        ]
        sums += _series(self._hulls.series)
        sums += _feed_consumers(self._hulls.feed_consumers)
        if self._prefixes:
            left_out = "Hulls under --metrics-prefix without measures here: there are more than --metrics-hulls."
            sums.append(GaugeMetricFamily("dynhull_metrics_hulls_left_out", left_out, value=survey.left_out))
        return sums

    def _past(self, holes: Sequence[Hole]) -> Iterator[Metric]:
        """How the past was read, and what could not be."""
        rebuilt = CounterMetricFamily(
            "dynhull_past_reads",
            "Hulls rebuilt as they were: anew, or from one that was kept; and reads that failed.",
            labels=["outcome"],
        )
        for outcome in get_args(Outcome):
            rebuilt.add_metric([outcome], self._hulls.pasts.outcomes[outcome])
        yield rebuilt
        missing = GaugeMetricFamily(
            "dynhull_past_holes",
            "1 for revisions of the past that could not be read when they were last needed.",
            labels=["hull", "first", "last"],
        )
        names = {hull.row.number: hull.name for hull in self._driver.core.hulls.values()} if holes else {}
        for hole in holes:
            if hole.number in names:
                missing.add_metric([names[hole.number], str(hole.first), str(hole.last)], 1)
        yield missing

    async def _survey(self) -> _Survey:
        found, slices = _Survey(), Slices()
        for hull in list(self._driver.core.hulls.values()):
            counts, settings = hull.counts, hull.row.settings
            found.points += counts.points
            found.held += counts.held
            if settings.identity != "multiset":
                found.entities += counts.points
            if settings.window is not None and settings.window.clock == "data" and counts.clock is not None:
                found.slowest = counts.clock if found.slowest is None else min(found.slowest, counts.clock)
            _keep(found.largest, (counts.points, hull.row.number, hull), NAMED_HULLS)
            if self._prefixes and hull.name.startswith(self._prefixes):
                found.left_out += _keep(found.chosen, (-hull.row.number, hull), self._most)
            await slices.others()
        return found

    async def _measure(self, chosen: list[Hull]) -> None:
        """Measure what has changed, as far as there is time: those first that are not busy."""
        self._measured = {hull: self._measured[hull] for hull in chosen if hull in self._measured}
        slices = Slices()
        with suppress(TimeoutError):
            async with asyncio.timeout(MEASURING_SECONDS):
                busy = []
                for hull in chosen:
                    known = self._measured.get(hull)
                    if known is not None and known.revision == hull.counts.revision:
                        continue
                    if self._driver.idle(hull):
                        await self._look_at(hull)
                        await slices.others()
                    else:
                        busy.append(hull)
                for hull in busy:
                    await self._look_at(hull)

    async def _look_at(self, hull: Hull) -> None:
        with suppress(HullNotFoundError):  # it is gone meanwhile, or another one has its name
            live = self._hulls.of(hull)
            counts, vertices = await live.vertices()
            measures = await live.measures(vertices)
            changed = None if hull.committed is None else hull.committed.time
            self._measured[hull] = _Measured(counts.revision, counts.points, len(vertices), measures, changed)

    def _say(self, left_out: int) -> None:
        if left_out and not self._left_out:
            log.warning(
                "hulls have no measures on the metrics page: there are more than --metrics-hulls",
                extra={"left_out": left_out, "metrics_hulls": self._most},
            )
        self._left_out = left_out


def _feed_consumers(consumers: FeedConsumers) -> list[Metric]:
    """How many there are, and how far those are behind that are so most."""
    backlog = GaugeMetricFamily(
        "dynhull_feed_backlog",
        "Batches of a hull that a consumer of its feed has not acknowledged; of a prefix*, commits.",
        labels=["feed", "consumer"],
    )
    for ident, behind in heapq.nlargest(NAMED_CONSUMERS, consumers.backlogs(), key=itemgetter(1)):
        backlog.add_metric([shown(ident.feed), ident.name], behind)
    return [GaugeMetricFamily("dynhull_feed_consumers", "Consumers of feeds.", value=len(consumers)), backlog]


def _series(series: KeptSeries) -> list[Metric]:
    """What the kept measures of hulls take."""
    if not series.seconds:
        return []
    lost = CounterMetricFamily(
        "dynhull_series_lost_samples", "Kept measures that were dropped early, or not kept, by --series-bytes."
    )
    lost.add_metric([], series.lost)
    return [
        GaugeMetricFamily("dynhull_series_hulls", "Hulls whose measures are kept.", value=len(series)),
        GaugeMetricFamily("dynhull_series_bytes", "Memory that kept measures take, about.", value=series.bytes),
        GaugeMetricFamily("dynhull_series_reach_seconds", "Time for which measures are kept.", value=series.reach),
        lost,
    ]


def _sizes(measured: Sequence[_Named], largest: Sequence[tuple[str, int, int]]) -> Iterator[Metric]:
    points = _gauge("points", "Points of the largest hulls, and of those that have measures.")
    vertices = _gauge("vertices", "Vertices of the largest hulls when last read, and of those that have measures.")
    for name, more, fewer in chain(((name, each.points, each.vertices) for name, _, each in measured), largest):
        points.add_metric([name], more)
        vertices.add_metric([name], fewer)
    yield from (points, vertices)


def _measures(measured: Sequence[_Named]) -> Iterator[Metric]:
    """The measures of hulls: those on the globe have units, those of a plane are in the unit of its coordinates."""
    for geographic, name, documentation, unit in MEASURES:
        family = _gauge(name, documentation, unit)
        for hull, on_globe, each in measured:
            value = getattr(each.measures, name) if on_globe == geographic else None
            if value is not None:
                family.add_metric([hull], value)
        yield family
    changed = _gauge("changed_timestamp_seconds", "Time of the last commit that changed the hull.")
    revisions = CounterMetricFamily(
        "dynhull_hull_revisions", "Revisions of the hull: its batches, and what left by time.", labels=["hull"]
    )
    for hull, _, each in measured:
        if each.changed is not None:
            changed.add_metric([hull], each.changed / MICROSECONDS)
        revisions.add_metric([hull], each.revision)
    yield from (changed, revisions)


def _gauge(name: str, documentation: str, unit: str = "") -> GaugeMetricFamily:
    suffix = unit and f"_{unit}"
    return GaugeMetricFamily(f"dynhull_hull_{name}{suffix}", documentation, labels=["hull"], unit=unit)


def _keep(heap: list[T], item: T, most: int) -> bool:
    """Keep the greatest items, at most this many. Returns whether one was left out. O(log most)."""
    if len(heap) < most:
        heapq.heappush(heap, item)
        return False
    if most:
        heapq.heappushpop(heap, item)
    return True
