"""The ledger: the row numbers of each hull, and the totals, kept in memory."""

from array import array
from bisect import bisect_right
from collections.abc import Iterable, Set
from dataclasses import dataclass, field
from itertools import count
from typing import Self

from ...state.feed_consumers import ConsumerId
from ...state.records import HullRow
from .event_directory import EventDirectory
from .feed_rows import StoredFeedConsumer
from .fence_runs import FenceRows, FenceRuns, Staged
from .segment_rows import StoredErasure, StoredSegment
from .totals import Totals

KEPT = 2  # snapshots per hull; the older one serves if the newer is damaged

# The tables in which deleted hulls and fences and unfinished snapshots leave rows, and about the bytes of a row.
DROPPED = {
    "snapshots": "length(state)",
    "batches": "length(payload)",
    "chunks": "length(points)",
    "events": "length(payload)",
    "insides": "length(payload)",
    "consumers": "length(name)",
    "delays": "length(payload)",
    "starts": "8",
    "segments": "length(file)",
}

IDS = (
    "batch_ids",
    "chunk_ids",
    "snapshot_ids",
    "segment_ids",
    "event_ids",
    "inside_ids",
    "consumer_ids",
    "delay_ids",
    "start_ids",
)


@dataclass(slots=True)
class StoredSnapshot:
    """The row numbers of a snapshot; `chunks` are those of its points."""

    id: int
    revision: int
    chunks: "array[int]" = field(default_factory=lambda: array("q"))


@dataclass(slots=True)
class HullRows:
    """The rows of one hull.

    Attributes:
        row: the row of the hull itself.
        sum: the sum of its checksum and of the weights of its rows of batches and of segments.
        firsts: the first revision in each row of batches, ascending.
        ids: the numbers of these rows.
        last: the newest revision.
        snapshots: the snapshots, ordered by revision.
        segments: what the journal has dropped, ordered by revision.
        erasures: what was erased from it, the oldest first.
    """

    row: HullRow
    sum: int
    firsts: "array[int]" = field(default_factory=lambda: array("q"))
    ids: "array[int]" = field(default_factory=lambda: array("q"))
    last: int = 0
    snapshots: tuple[StoredSnapshot, ...] = ()
    segments: tuple[StoredSegment, ...] = ()
    erasures: tuple[StoredErasure, ...] = ()

    @property
    def oldest(self) -> int:
        """The oldest revision that the journal can read: one of a snapshot, or 0."""
        limit = self._limit
        return next((each.revision for each in reversed(self.snapshots) if each.revision <= limit), self.beginning)

    @property
    def start(self) -> int:
        """The revision after which the journal has all batches; segments have those before, as far as they are kept."""
        return min(self.oldest, self._limit)

    @property
    def _limit(self) -> int:
        """The revision up to which the journal need not have batches, apart from those after a snapshot before it."""
        if len(self.snapshots) < KEPT:
            return self.beginning
        base = self.snapshots[-KEPT].revision
        return min(base, self.filed) if self.row.settings.history else base

    @property
    def beginning(self) -> int:
        """The oldest revision that the rows of the journal lead to."""
        if not self.snapshots or (len(self.firsts) > 0 and self.firsts[0] == 1):
            return 0
        first = self._first
        return next(
            (each.revision for each in self.snapshots if each.revision + 1 >= first), self.snapshots[-1].revision
        )

    @property
    def filed(self) -> int:
        """The revision up to which segments have all batches that they are to have."""
        leads = self.segments and self.segments[-1].last + 1 >= self._first
        return self.segments[-1].last if leads else self.beginning

    @property
    def _first(self) -> int:
        """The first revision of the journal, or the next one."""
        return self.firsts[0] if self.firsts else self.last + 1

    @property
    def apart(self) -> int:
        """The number of segments that do not lead to the journal: for a while no past was kept after them."""
        first = self._first
        for place in range(len(self.segments), 0, -1):
            if self.segments[place - 1].last + 1 < first:
                return place
            first = self.segments[place - 1].first
        return 0

    @property
    def due(self) -> int:
        """The revision up to which batches are to go into a segment at present; `filed` if there are none."""
        filed = self.filed
        ends = [each.revision for each in self.snapshots[: 1 - KEPT] if each.revision > filed]
        return ends[0] if self.row.settings.history and ends else filed

    def copy(self) -> Self:
        """A copy of the present state."""
        columns = self.firsts[:], self.ids[:], self.last, self.snapshots, self.segments, self.erasures
        return type(self)(self.row, self.sum, *columns)

    def between(self, after: int, until: int) -> "array[int]":
        """The rows with the revisions `after` + 1 to `until`."""
        start = max(0, bisect_right(self.firsts, after + 1) - 1)
        return self.ids[start : bisect_right(self.firsts, until)]

    def superfluous(self) -> "array[int]":
        """The rows that no readable revision needs."""
        if len(self.snapshots) < KEPT:
            return array("q")
        start = self.start
        return self.ids[:] if self.last <= start else self.ids[: max(0, bisect_right(self.firsts, start + 1) - 1)]

    def outlived(self) -> StoredSnapshot | None:
        """A snapshot that neither a read nor a segment needs any more; None for none."""
        if len(self.snapshots) <= KEPT:
            return None
        first, second, *_ = self.snapshots
        return first if first.revision < self.oldest or first.revision == second.revision else None

    def change(self, row: HullRow, more: int) -> None:
        """Change the row of the hull itself, whose checksum is `more` by that much."""
        self.row = row
        self.sum += more

    def weigh(self, more: int) -> None:
        """Add the weight of a row to the sum, or subtract it."""
        self.sum += more

    def append(self, first: int, last: int, place: int, weight: int) -> None:
        """Add a row of batches."""
        self.firsts.append(first)
        self.ids.append(place)
        self.last = last
        self.sum += weight

    def set_snapshots(self, snapshots: Iterable[StoredSnapshot]) -> None:
        """Have these snapshots, given in any order."""
        self.snapshots = tuple(sorted(snapshots, key=lambda each: each.revision))

    def set_segments(self, segments: Iterable[StoredSegment]) -> None:
        """Have these segments, given in any order."""
        self.segments = tuple(sorted(segments, key=lambda each: each.first))

    def drop_segment(self, segment: StoredSegment) -> None:
        """Have no longer one of the segments."""
        self.segments = tuple(each for each in self.segments if each != segment)

    def add_erasures(self, stored: Iterable[StoredErasure]) -> None:
        """Have more erasures, the newest ones."""
        self.erasures = (*self.erasures, *stored)

    def drop_erasure(self, stored: StoredErasure) -> None:
        """Have no longer one of the erasures."""
        self.erasures = tuple(each for each in self.erasures if each != stored)

    def drop(self, rows: int, weights: int) -> None:
        """Remove the oldest rows of batches."""
        del self.firsts[:rows], self.ids[:rows]
        self.sum -= weights

    def drop_newest(self, rows: int, weights: int, last: int) -> None:
        """Remove the newest rows of batches."""
        del self.firsts[-rows:], self.ids[-rows:]
        self.sum -= weights
        self.last = last

    def after(self, last: int) -> "array[int]":
        """The rows whose revisions are all after `last`."""
        return self.ids[bisect_right(self.firsts, last) :]


@dataclass(slots=True)
class Ledger:
    """The rows of all hulls, as of the last commit.

    Attributes:
        totals: the number and the sum of all valid rows.
        hulls: the hulls by number.
        fences: the fences by number.
        dead: by table, the rows to drop because no hull, fence or snapshot needs them.
        batch_ids, chunk_ids, snapshot_ids, segment_ids: the next numbers. No number is used twice while the storage is
            open, so a row found dead cannot belong to anything else when it is dropped.
        event_ids, inside_ids, consumer_ids, delay_ids, start_ids: the same for fences.
        events: the rows of events.
        staged: by fence, the rows of events that are not valid yet, in order.
        feed_consumers: the consumers of feeds.
    """

    totals: Totals = field(default_factory=Totals)
    hulls: dict[int, HullRows] = field(default_factory=dict)
    fences: dict[int, FenceRows] = field(default_factory=dict)
    dead: "dict[str, array[int]]" = field(default_factory=lambda: {table: array("q") for table in DROPPED})
    batch_ids: "count[int]" = field(default_factory=lambda: count(1))
    chunk_ids: "count[int]" = field(default_factory=lambda: count(1))
    snapshot_ids: "count[int]" = field(default_factory=lambda: count(1))
    segment_ids: "count[int]" = field(default_factory=lambda: count(1))
    event_ids: "count[int]" = field(default_factory=lambda: count(1))
    inside_ids: "count[int]" = field(default_factory=lambda: count(1))
    consumer_ids: "count[int]" = field(default_factory=lambda: count(1))
    delay_ids: "count[int]" = field(default_factory=lambda: count(1))
    start_ids: "count[int]" = field(default_factory=lambda: count(1))
    events: EventDirectory = field(default_factory=EventDirectory)
    staged: dict[int, list[Staged]] = field(default_factory=dict)
    feed_consumers: dict[ConsumerId, StoredFeedConsumer] = field(default_factory=dict)
    runs: FenceRuns = field(init=False)

    def __post_init__(self) -> None:
        self.runs = FenceRuns(self.fences)

    def go_on_from(self, before: "Ledger", under_way: Set[int]) -> None:
        """Replace an earlier ledger; chunks of snapshots that are `under_way` are not dead."""
        for name in IDS:
            setattr(self, name, count(max(next(getattr(self, name)), next(getattr(before, name)))))
        self.dead["chunks"] = array("q", (place for place in self.dead["chunks"] if place not in under_way))
