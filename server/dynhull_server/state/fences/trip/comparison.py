"""What a change of hulls means for their fences: who has crossed, and the events of that."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from dynhull import Crossings
from dynhull.crossings import PackedCrossings, pack
from dynhull.keys import key_list

from ...hull import Hull
from ...leg import Leg
from ...limits import FenceLimits
from ..events.log import EventLog
from ..events.sequences import Swap, first_rows
from ..index.keys_changed import KeysChanged, some, with_expiries
from ..index.line import Line
from ..index.subjects import Subjects
from ..index.transfers import carry, known_to
from ..model.fence import Fence
from ..model.records import Cause, Key, Origin
from ..model.tallies import Column, Tallies
from .alarms import look as alarm_at
from .delayed import NO_ROWS, delay, take_over
from .expected import follow
from .leg import NOBODY, FenceLeg

# The hull removes keys whose time has come.
EXPIRY: Swap = Cause.REMOVED, Cause.EXPIRED
NOTHING: Mapping[str, KeysChanged] = MappingProxyType({})
NO_DOUBT: Mapping[Fence, bool] = MappingProxyType({})


@dataclass(slots=True)
class Ground:
    """What a trip on hulls with fences begins with.

    Attributes:
        hulls: its parts at hulls, by name.
        lines: the lines of its queues.
        fences: the fences that its requests name; None for those that do not exist.
        numbers: the numbers of new fences, by name; those without one are too many.
        tallies: what is counted of fences, as of the last commit.
        limits: the limits on fences.
        room: how many more hulls alarms may watch, which is reserved for it if it creates alarms or hulls.
    """

    hulls: Mapping[str, Leg]
    lines: Sequence[Line]
    fences: Mapping[str, Fence | None]
    numbers: Mapping[str, int]
    tallies: Tallies
    limits: FenceLimits
    room: int = 0


class Comparison:
    """Compares subjects with areas after each revision, and makes the events of the trip.

    Args:
        ground: what the trip begins with.

    Attributes:
        legs: the fences that the trip changes otherwise than by events of crossings, by number.
        log: the events of crossings.
        applied: whether a fence has changed in memory, so that a failed commit needs an examination.
        torn: whether crossings may have been lost.
    """

    __slots__ = ("_lines", "_tallies", "applied", "legs", "log", "torn")

    def __init__(self, ground: Ground) -> None:
        self.legs: dict[int, FenceLeg] = {}
        self.log = EventLog(ground.tallies)
        self.applied = self.torn = False
        self._lines = ground.lines
        self._tallies = ground.tallies

    def leg(self, fence: Fence) -> FenceLeg:
        """The part of the trip at a fence."""
        leg = self.legs.get(fence.number)
        if leg is None:
            leg = self.legs[fence.number] = FenceLeg(fence, told=self.log.last(fence.number))
        return leg

    def tear(self, hulls: Iterable[Hull] = ()) -> None:
        """Take note that crossings of these hulls may have been lost."""
        self.torn = True
        for hull in hulls:
            hull.state.torn = True

    def compare(
        self, hulls: Sequence[Hull], now: int, swap: Swap | None, changed: Mapping[str, KeysChanged] = NOTHING
    ) -> None:
        """Make the events of a change of these hulls.

        Args:
            hulls: the hulls.
            now: the time.
            swap: a cause, and the one that it stands for.
            changed: what has happened to their keys, by name.
        """
        try:
            for line in self._lines:
                alone = line.alone(hulls[0].row.name) if len(hulls) == 1 else None
                if alone is not None:
                    found = alone.take()
                    if found is not None or alone.delaying:
                        self.cross(alone, found, line.area_revisions(), swap, now, changed.get(alone.hull.row.name))
                    continue
                carried = carry(line.subjects, changed) if len(changed) > 1 else {}
                for name, origins in carried.items():
                    self._take_over(line.subjects[name], origins)
                crossed: dict[str, tuple[Subjects, PackedCrossings | None]] = {
                    name: (line.subjects[name], None) for name in changed if name in line.subjects
                }
                doubting: dict[Fence, bool] = {}
                crossed |= {each.hull.name: (each, crossings) for each, crossings in line.changed(hulls, doubting)}
                for fence in doubting:
                    for name, subjects in fence.subjects.items():
                        crossed.setdefault(name, (subjects, None))
                areas = line.area_revisions()
                for name, (subjects, crossings) in sorted(crossed.items()):
                    origins = carried.get(name, NOBODY)
                    self.cross(subjects, crossings, areas, swap, now, changed.get(name), origins, doubting)
                for fence, pair, causes in line.paired(hulls):
                    self.leg(fence).paired(pair, causes, now)
                names = dict.fromkeys(hull.name for hull in hulls)
                for fence, watched in line.watching(names) if line.alarms else ():
                    if watched.touched(now):
                        own, other = (each is not None and each.name in names for each in (watched.hull, watched.other))
                        cause = (Cause.EXPIRED if swap is EXPIRY else Cause.MOVED) if own else Cause(0)
                        alarm_at(self.leg(fence), watched, cause | (Cause.AREA if other else Cause(0)), now)
            for leg in self.legs.values():
                follow(leg, now)
        except BaseException:  # an index may have lost crossings
            self.tear(hulls)
            raise

    def cross(
        self,
        subjects: Subjects,
        packed: PackedCrossings | None,
        areas: Mapping[str, int],
        swap: Swap | None,
        now: int,
        changed: KeysChanged | None = None,
        origins: Mapping[Key, Origin] = NOBODY,
        doubting: Mapping[Fence, bool] = NO_DOUBT,
    ) -> None:
        """Make the events of a change of the keys of a hull, or of the areas of its fences with these revisions.

        Those `doubting` may be certain of others now, with whether their areas have moved.
        """
        crossed: set[Fence] = set()
        expired = changed is not None and changed.expired and swap is not EXPIRY  # which says it of all
        if packed is not None and (self._tallies.ruled or self.legs or origins or expired):
            crossings = packed.unpack()
            if changed is not None and expired:
                crossings = with_expiries(crossings, changed.expired)
            apart = self._apart(crossings, origins)
            if apart is not None:
                starts = first_rows(crossings.fences)
                ends = np.append(starts[1:], len(crossings))
                for first, end in zip(starts[apart[starts]].tolist(), ends[apart[starts]].tolist(), strict=True):
                    fence = subjects.fences[int(crossings.fences[first])]
                    crossed.add(fence)
                    leg, rows, own = self.leg(fence), slice(first, end), known_to(fence, origins)
                    if fence.delays is None:
                        leg.crossed(subjects, crossings, rows, swap, now, own)
                    else:
                        delay(leg, subjects, crossings, rows, swap, now, changed, own, moved=doubting.get(fence))
                crossings = some(crossings, np.flatnonzero(~apart))
            packed = pack(crossings)
        if packed is not None:
            self.log.add(subjects, packed, areas, swap, now)
        for fence in list(subjects.delaying):
            if fence not in crossed and (
                changed is not None or fence in doubting
            ):  # they may have reported that they stay
                leg, own, moved = self.leg(fence), known_to(fence, origins), doubting.get(fence)
                delay(leg, subjects, None, NO_ROWS, None, now, changed, own, moved=moved)

    def _apart(self, crossings: Crossings, origins: Mapping[Key, Origin]) -> npt.NDArray[np.bool_] | None:
        """(n,) which crossings are of fences that look at each of their events; None if none is."""
        tallies, fences = self._tallies, crossings.fences
        found = tallies.columns[Column.RULES, tallies.places(fences)] != 0 if tallies.ruled else None
        if self.legs:
            legs = np.isin(fences, list(self.legs))
            found = legs if found is None else found | legs
        if origins:
            moved = fences[[key in origins for key in key_list(crossings.keys)]]
            found = np.isin(fences, moved) if found is None else found | np.isin(fences, moved)
        return found if found is not None and found.any() else None

    def _take_over(self, subjects: Subjects, origins: Mapping[Key, Origin]) -> None:
        """Let subjects that come from other hulls bring their delays."""
        for fence in subjects.fences.values():
            if fence.delays is not None and len(fence.delays):
                own = known_to(fence, origins)
                if own:
                    take_over(self.leg(fence), subjects, own)
