"""Comparison of stored fences with positions, areas and events: whole rows can say what cannot be."""

from bisect import bisect_left
from dataclasses import dataclass
from itertools import islice, takewhile

import numpy as np

from dynhull.arrays import Points
from dynhull.keys import Keys, PackedKeys

from ...state.alarms.values import seen
from ...state.contents import replayed
from ...state.contents.live import AnyHull, layer_of
from ...state.fences.events.order import EventOrder
from ...state.fences.model.config import FenceConfig
from ...state.fences.model.faults import FenceFault
from ...state.fences.model.records import KeptFence, Key
from ...state.fences.recovery.sides import AlarmState, Nearness, Side, Sides, wrong_sides
from ...state.records import Center, Contents
from ..port import NEWEST
from .fence_reading import read_runs, read_settled
from .fence_runs import FenceRows
from .ledger import HullRows, Ledger
from .reading import read_hull
from .tables import Reader

# Faults of a fence, and of a hull, at most.
MOST_FAULTS = 100


@dataclass(slots=True)
class FenceReport:
    """A description of one fence.

    Attributes:
        name: its name.
        last: the sequence of its last event.
        inside: the number of subjects inside.
        faults: what is wrong.
    """

    name: str
    last: int
    inside: int
    faults: list[FenceFault]


def check_fences(reader: Reader, ledger: Ledger) -> list[FenceReport]:
    """Compare all fences of a database whose rows are whole. The reports, ordered by name.

    Args:
        reader: reads the rows.
        ledger: the rows.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    return _Check(reader, ledger).run()


@dataclass(frozen=True, slots=True)
class _Stored:
    """A fence as stored: who is on its inner side, by hull; no keys of a hull that is near as a whole."""

    kept: KeptFence
    sides: dict[str, list[Key]]
    report: FenceReport


class _Check:
    def __init__(self, reader: Reader, ledger: Ledger) -> None:
        self._reader = reader
        self._ledger = ledger
        self._hulls = {hull.row.name: hull for hull in ledger.hulls.values() if not hull.row.settings.shards}
        self._names = sorted(self._hulls)
        self._outlines: dict[tuple[str, int], tuple[Points, Center | None]] = {}

    def run(self) -> list[FenceReport]:
        fences = sorted(self._ledger.fences.values(), key=lambda fence: fence.row.name)
        stored = self._follow(fences)
        reports = {each.report.name: each.report for each in stored}
        comparing: dict[str, list[_Stored]] = {}
        for each in stored:
            names = self._compared(each.kept.row.config)
            for name in names:
                comparing.setdefault(name, []).append(each)
            for hull in sorted(each.sides.keys() - names):
                where = f"{len(each.sides[hull]) or 1} inside"
                each.report.faults.append(FenceFault(each.report.name, hull, None, 0, "nobody of this hull", where))
        for name, found in sorted(comparing.items()):
            for fault in islice(wrong_sides(self._sides(name, found)), MOST_FAULTS):
                reports[fault.fence].faults.append(fault)
        return [each.report for each in stored]

    def _compared(self, config: FenceConfig) -> set[str]:
        """The names of the hulls that a fence compares with its area: by their keys, or as a whole."""
        if config.kind != "prefix":
            return {config.subjects}
        first = bisect_left(self._names, config.subjects)
        begin_so = takewhile(lambda name: name.startswith(config.subjects), islice(self._names, first, None))
        if config.rule is not None:
            suits, other = config.rule.suits, config.rule.other
            settings = None if other is None else self._hulls[other].row.settings
            named = (name for name in begin_so if config.compares(name))
            return {name for name in named if suits(self._hulls[name].row.settings, settings)}
        return {name for name in begin_so if self._hulls[name].row.settings.identity != "multiset"}

    def _follow(self, fences: list[FenceRows]) -> list[_Stored]:
        """Read fences, and follow their events: those since it was stored who is inside, and all that are kept."""
        kept = {fence.row.number: read_settled(self._reader, fence) for fence in fences}
        newest = {
            number: EventOrder(each.row.name, each.inside.sequence, each.inside.members)
            for number, each in kept.items()
        }
        orders = {number: EventOrder(each.row.name, each.first - 1) for number, each in kept.items()}
        for number, events in read_runs(self._reader, {fence.row.number: (fence, 0) for fence in fences}):
            orders[number].take(events)
            newest[number].take(event for event in events if event.sequence > kept[number].inside.sequence)
        stored = []
        for fence in fences:
            number, name = fence.row.number, fence.row.name
            inside, each = set(newest[number].inside()), kept[number]
            faults = orders[number].finish(inside, fence.last, each.consumers.values())
            faults += [fault for fault in newest[number].faults if fault not in faults]
            # Those with a delay are on the other side than is reported.
            sides: dict[str, list[Key]] = {}
            delayed = {subject for subject in each.delays if subject[0]} if each.row.config.rule is None else set()
            for subject in inside ^ delayed:
                if isinstance(subject, str):
                    sides[subject] = []
                else:
                    sides.setdefault(subject[0], []).append(subject[1])
            stored.append(_Stored(each, sides, FenceReport(name, fence.last, len(inside), faults)))
        return stored

    def _sides(self, name: str, stored: list[_Stored]) -> Sides:
        """What the fences that compare a hull have about it."""
        found = Sides(name)
        hull = self._hulls[name]
        identity = hull.row.settings.identity
        for each in stored:
            config = each.kept.row.config
            area = config.area_hull
            if config.rule is not None:
                standing, geographic = each.kept.delays.get((name, "")), hull.row.settings.geographic
                other = None if area is None else _Outline(None, *self._outline(area))
                own = _Outline(self._replayed(name) if config.rule.counts else None, *self._outline(name))
                looked = seen(config.rule, own, other, geographic=geographic)
                waits = standing is not None and standing.enters
                found.alarms.append(
                    AlarmState(each.report.name, config.rule, looked, geographic, name in each.sides, waits)
                )
                continue
            if config.kind == "other":
                assert area is not None  # checked when the fence was created
                (vertices, center), (others, _) = self._outline(area), self._outline(name)
                pair = Nearness(each.report.name, config.near, vertices, others, center, name in each.sides)
                found.pairs.append(pair)
                continue
            if found.contents is None:
                found.contents, found.center = self._contents(hull)
            corners = None if area is None else self._outline(area, config.area_layer)[0]
            keys = _packed(each.sides.get(name, []), identity)
            delays = {key: delay for (of, key), delay in each.kept.delays.items() if of == name}
            found.sides.append(Side(each.report.name, config, corners, keys, delays))
        return found

    def _contents(self, hull: HullRows) -> tuple[Contents, Center | None]:
        contents = replayed(read_hull(self._reader, hull, NEWEST), hull.row.settings)
        return contents.stored(), None if contents.globe is None else contents.globe.center

    def _outline(self, name: str, layer: int = 1) -> tuple[Points, Center | None]:
        """The vertices of a hull, or of another convex layer, and its centre."""
        if (name, layer) not in self._outlines:
            hull = self._hulls[name]
            contents = replayed(read_hull(self._reader, hull, NEWEST), hull.row.settings)
            center = None if contents.globe is None else contents.globe.center
            self._outlines[name, layer] = layer_of(contents.hull, layer), center
        return self._outlines[name, layer]

    def _replayed(self, name: str) -> AnyHull:
        """A hull with its points."""
        hull = self._hulls[name]
        return replayed(read_hull(self._reader, hull, NEWEST), hull.row.settings).hull


@dataclass(frozen=True, slots=True)
class _Outline:
    """What an alarm asks of the state of a hull."""

    replayed: AnyHull | None
    corners: Points
    center: Center | None

    @property
    def hull(self) -> "AnyHull | _Outline":
        return self if self.replayed is None else self.replayed

    def vertices(self) -> Points:
        return self.corners


def _packed(keys: list[Key], identity: str) -> Keys:
    if identity == "str":
        return PackedKeys.pack(map(str, keys))
    return np.array(keys, np.uint64)
