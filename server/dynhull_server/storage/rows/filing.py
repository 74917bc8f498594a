"""Filing: batches that the journal need not keep become segments; and which segments are to go."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from ...state.records import FOREVER, NO_TIME, HullRow, Kept
from ..segments.archive import BATCHES, STATE, Archive, Written
from ..segments.columns import SegmentColumns, columns_of_state
from ..segments.parquet import to_parquet
from .chunks import state
from .ledger import HullRows
from .past_rows import columns_between
from .reading import newest_snapshot
from .segment_rows import SegmentFacts, StoredErasure, StoredSegment
from .tables import Reader

# Points and keys after which a segment ends, even if what is due does not.
MOST_ROWS = 2**19


@dataclass(frozen=True, slots=True)
class Due:
    """What a segment is made of.

    Attributes:
        row: the hull.
        columns: its batches, at least one.
        before: the state before them, if it is to lie beside them.
    """

    row: HullRow
    columns: SegmentColumns
    before: Kept | None

    @property
    def first(self) -> int:
        """The first revision."""
        return int(self.columns.revision[0])

    @property
    def last(self) -> int:
        """The last revision."""
        return int(self.columns.revision[-1])

    def write(self, archive: Archive, place: int, file: str) -> StoredSegment:
        """Write the files.

        Raises:
            OSError: the disk is full, or fails.
        """
        columns = self.columns
        state, commit = Written(0, "", ""), None
        if self.before is not None:
            state, commit = archive.write(file + STATE, state_file(self.row, self.before)), self.before.committed
        wrote = archive.write(file + BATCHES, to_parquet(columns, _about(self.row, columns)))
        ends = int(columns.committed[0]), int(columns.committed[-1])
        times = (0, 0) if NO_TIME in ends else ends
        facts = SegmentFacts(
            wrote.bytes,
            wrote.digest,
            state.bytes,
            state.digest,
            commit,
            self.last - self.first + 1,
            columns.moves,
            *times,
            wrote.blocks,
            state.blocks,
        )
        return StoredSegment(place, self.first, self.last, file, facts)


def read_due(reader: Reader, hull: HullRows) -> Due:
    """What the next segment of a hull is made of. Something is due.

    Raises:
        DamagedError: a row of the journal is damaged.
    """
    after = hull.filed
    columns = columns_between(reader, hull, after, hull.due, MOST_ROWS)
    kept = None
    if any(each.revision == after for each in hull.snapshots):
        kept = newest_snapshot(reader, hull, after)
    begins = kept is not None and kept.revision == after and _needs_state(hull, len(kept.contents.points))
    return Due(hull.row, columns, kept if begins else None)


def _needs_state(hull: HullRows, points: int) -> bool:
    """Whether the next segment is to begin with the state before it, which has so many points.

    Snapshots are far enough apart for that. An erasure makes one after whatever has come since: a state beside each
    of the segments that these leave would be the hull again for each key that is erased.
    """
    if not hull.segments or hull.segments[-1].last != hull.filed:
        return True
    moves = 0
    for segment in reversed(hull.segments):
        moves += segment.facts.moves
        if segment.begins:
            break
    return 2 * moves >= points


def state_file(row: HullRow, kept: Kept) -> bytes:
    """The state of a hull as a file."""
    columns = columns_of_state(kept.contents, kept.revision, kept.committed, row.settings.identity)
    about = _about(row, columns) | {
        "times": str(kept.contents.times is not None),
        "deadlines": str(kept.contents.deadlines is not None),
    }
    return to_parquet(columns, about, state(replace(kept, records=[])))


def _about(row: HullRow, columns: SegmentColumns) -> dict[str, str]:
    return {
        "hull": row.name,
        "uid": row.uid,
        "frame": row.settings.frame,
        "first": str(columns.revision[0]) if len(columns) else "",
        "last": str(columns.revision[-1]) if len(columns) else "",
    }


def outdated(hull: HullRows, now: int, archive: Archive) -> Sequence[StoredSegment]:
    """The segments of a hull that are kept for too long, are too many bytes, or lead nowhere.

    Those that are kept begin with a state, so what follows one goes with it.
    """
    settings = hull.row.settings
    if not settings.history:
        return hull.segments
    age = min(settings.history, archive.most_age or FOREVER)
    oldest = 0 if age == FOREVER else now - age
    room = settings.history_bytes or FOREVER
    gone = hull.apart
    for place in range(len(hull.segments) - 1, gone - 1, -1):
        segment = hull.segments[place]
        room -= segment.size
        if room < 0 or segment.facts.last_time < oldest:
            gone = place + 1
            break
    return hull.segments[: run_from_start(hull, gone)]


def past_erasures(hull: HullRows) -> list[StoredErasure]:
    """The erasures that concern nothing of what is still there."""
    oldest = hull.segments[0].first - 1 if hull.segments else hull.oldest
    return [each for each in hull.erasures if each.erasure.last < oldest]


def excess(hulls: Mapping[int, HullRows], most_bytes: int) -> int:
    """By how many bytes the segments of all hulls are more than they may be; 0 or less if they are not."""
    return sum(segment.size for hull in hulls.values() for segment in hull.segments) - most_bytes


def oldest_of_all(hulls: Mapping[int, HullRows], most_bytes: int) -> Iterator[tuple[int, StoredSegment]]:
    """The oldest segments of all hulls, so many that the others have at most so many bytes."""
    more = excess(hulls, most_bytes)
    left = {number: hull.copy() for number, hull in hulls.items() if hull.segments} if more > 0 else {}
    while more > 0 and left:
        number = min(left, key=lambda each: left[each].segments[0].facts.last_time)
        hull = left[number]
        for segment in hull.segments[: run_from_start(hull, 1)]:
            yield number, segment
            more -= segment.size
            hull.drop_segment(segment)
        if not hull.segments:
            del left[number]


def run_from_start(hull: HullRows, count: int) -> int:
    """The number of segments, at least so many, after which the others begin with a state, or there are none."""
    rest = range(count, len(hull.segments))
    return next((place for place in rest if hull.segments[place].begins), len(hull.segments))
