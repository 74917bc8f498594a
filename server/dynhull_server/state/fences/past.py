"""A fence after the fact: the events that it would have made, by what makes those of fences that are there."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest

from ..contents.keyed import Keyed
from ..errors import HullUnsuitableError
from ..hull import Hull
from ..leg import Leg
from ..limits import FenceLimits
from ..records import Expiry, Record
from ..requests import Birth
from .events.recent import RecentEvents
from .index.cells import cells_of
from .index.checked import CheckedArea
from .index.keys_changed import KeysChanged, of_record
from .index.line import Line
from .model.config import FenceConfig
from .model.fence import Fence
from .model.records import FenceEvent, Key
from .model.requests import CreateFence, PassTime
from .model.tallies import Tallies
from .sieve import Sieve, Sifted
from .trip.comparison import Ground
from .trip.part import FencePart

# A fence after the fact has no name, and is the only one that it knows.
NAME, NUMBER = "", 1

# What is applied and then compared at once: some revisions of one hull, or of several.
Change = Sequence[tuple[Hull, Sequence[Record]]]


class PastFence:
    """A fence over hulls as they were, whose later revisions are applied again.

    Args:
        config: its settings.
        hulls: the hulls that it names, as of the moment at which it begins; nobody else changes them.
        time: that moment, in microseconds since 1970.
        checked: the polygons of its area, if they have been checked.

    Raises:
        RefusedError: a fence with these settings would have been refused.
    """

    def __init__(self, config: FenceConfig, hulls: Sequence[Hull], time: int, checked: CheckedArea | None) -> None:
        self._legs = {hull.name: Leg(hull.name, hull, keeps=False, fenced=True) for hull in hulls}
        self._tallies = Tallies()
        self._line = Line((), self._legs)
        create = CreateFence(None, NAME, time, config, Birth(NAME, 0.0), checked, gives_center=False)
        part = self._part(create)
        fence = part.do(create)
        assert isinstance(fence, Fence)  # the first one of a trip is not left for a later one
        self._fence = fence
        fence.join(self._tallies, RecentEvents())
        for subjects in fence.subjects.values():
            subjects.fences[NUMBER] = fence
        self._made = self._events(part)
        self._line.add(fence)

    def take(self) -> list[FenceEvent]:
        """The events since this was last called."""
        made, self._made = self._made, []
        return made

    def pass_time(self, time: int) -> None:
        """Make the events that time has made up to a moment, each at its own."""
        while (due := self._fence.next_due) is not None and due <= time:
            request = PassTime(None, NAME, due, self._fence)
            part = self._part(request)
            part.do(request)
            self._made += self._events(part)

    def repeat(self, change: Change, time: int) -> None:
        """Apply revisions again, and make their events. Time has passed up to then."""
        changed: dict[Hull, KeysChanged] = {}
        for hull, records in change:
            expired: set[Key] = set()
            for record in records:
                _require_center(hull, record)
                hull.state.repeat(record)
                if record is not records[-1] and isinstance(hull.state.contents, Keyed):
                    expired |= set(hull.state.contents.ended)
            hull.counts = hull.state.counts
            changed[hull] = of_record(hull, records[-1], expired)
        part = self._part()
        part.repeated(changed, time, expiry=len(change) == 1 and isinstance(change[0][1][-1].rows, Expiry))
        self._made += self._events(part)

    @property
    def waiting(self) -> set[Key]:
        """The keys of the subjects of which it waits for reports, or for time."""
        dwelling, delays = self._fence.dwelling, self._fence.delays
        found = [] if dwelling is None else dwelling.subjects()
        return {key for _, key in found} | {subject[1] for subject, _ in ([] if delays is None else delays.all())}

    def sieve(self) -> Sieve | None:
        """Lets those moves through that may mean something for it; None if others do, too."""
        config, subjects = self._fence.row.config, next(iter(self._fence.subjects.values()), None)
        if subjects is None:
            return None
        settings = subjects.hull.row.settings
        if settings.geographic or settings.window is not None or settings.by_event_time:
            return None  # their batches do more than they say
        if config.by_accuracy or config.expected:
            return None  # it asks for more than a move says
        cells = cells_of(config)
        return None if cells is None else Sieve(cells, config.crosses, bool(config.delays or config.dwell))

    def follow(self, hull: Hull, sifted: Sifted, last: int) -> Iterator[int]:
        """Apply what was let through of revisions, with its events, then the others. Yields the rows of each."""
        for moved in sifted.moved():
            commit = moved.record.committed
            assert commit is not None  # a sieve reads it
            self.pass_time(commit.time)
            if len(moved.before):
                self._pass_over(hull, replace(moved.record, revision=moved.record.revision - 1, rows=moved.before))
            if len(moved.record.rows):
                self.repeat([(hull, [moved.record])], commit.time)
            else:
                self._pass_over(hull, moved.record)
            yield 1 + len(moved.before) + len(moved.record.rows)
        self._pass_over(hull, Record(last, sifted.lasts, cause="batch"))
        yield 1 + len(sifted.lasts)

    def _pass_over(self, hull: Hull, record: Record) -> None:
        """Apply what makes no event."""
        hull.state.repeat(record)
        hull.counts = hull.state.counts
        crossings = self._fence.subjects[hull.name].take()
        assert crossings is None or not crossings.unpack().changes.any(), "no key changes sides"

    def _part(self, *requests: CreateFence | PassTime) -> FencePart:
        """What a trip with these requests does to the fence."""
        creates = any(isinstance(each, CreateFence) for each in requests)
        fences = {NAME: None if creates else self._fence}
        ground = Ground(self._legs, [self._line], fences, {NAME: NUMBER}, self._tallies, FenceLimits())
        return FencePart(ground, requests)

    def _events(self, part: FencePart) -> list[FenceEvent]:
        """What a part of a trip has made, which counts from now on."""
        part.settle([])
        if part.crossed is not None:
            self._tallies.take(part.crossed)
        for leg in part.legs.values():
            leg.publish()
        block = part.events
        return [] if block is None else [event for run in range(len(block.runs)) for event in block.events(run)]


def changes_of(commit: Mapping[Hull, Sequence[Record]]) -> Iterator[Change]:
    """What one commit has done to hulls, in the order in which it is compared.

    The order between hulls is that of their batches: the first of each count together, as those of a batch to several
    hulls do, with points that leave before it.
    """
    if len(commit) == 1:
        for hull, records in commit.items():
            for record in records:
                yield [(hull, [record])]
        return
    for together in zip_longest(*([(hull, each) for each in _batches(records)] for hull, records in commit.items())):
        change = [each for each in together if each is not None]
        for hull, records in change:
            if isinstance(records[-1].rows, Expiry):
                yield from ([(hull, [record])] for record in records)
        batches = [each for each in change if not isinstance(each[1][-1].rows, Expiry)]
        if batches:
            yield batches


def _batches(records: Sequence[Record]) -> list[list[Record]]:
    """The batches in a commit, each after the points that leave before it."""
    found: list[list[Record]] = [[]]
    for record in records:
        found[-1].append(record)
        if not isinstance(record.rows, Expiry):
            found.append([])
    return found if found[-1] else found[:-1]


def _require_center(hull: Hull, record: Record) -> None:
    """Raise HullUnsuitableError where a revision moves the centre of a hull: fences keep their projection."""
    if record.center is not None and record.center != hull.state.center:
        reason = f"was recentred by revision {record.revision}: a fence after the fact ends before it, or begins at it"
        raise HullUnsuitableError(hull.name, reason)
