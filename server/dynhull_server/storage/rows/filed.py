"""Reading hulls as they were before what the journal has: from segments."""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import replace
from threading import Lock

from ...state.records import CommitStamp, Kept, Record
from ..past import Moment, created
from ..port import DamagedError
from ..segments.archive import BATCHES, STATE, Archive
from ..segments.columns import Batches, contents_of
from ..segments.gathered import gathered
from ..segments.parquet import from_parquet
from .chunks import state_from
from .ledger import HullRows
from .past_rows import STEP_POINTS
from .segment_rows import StoredSegment

KEPT_OPEN = 2  # segments whose columns stay in memory, since what is read next is mostly in the same


class Filed:
    """The segments of hulls, read beside commits.

    Args:
        archive: has their files.
    """

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self._turn = Lock()
        self._open: OrderedDict[str, Batches] = OrderedDict()

    def oldest_moment(self, hull: HullRows, *, timed: bool) -> Moment | None:
        """The oldest revision that segments lead to; or, `timed`, the oldest whose commit is known. None for none."""
        usable = _usable(hull)
        if not usable:
            return None
        first = usable[0]
        if first.first == 1:
            return Moment(0, created(hull.row))
        commit = first.facts.state_commit
        if commit is not None or not timed:
            return Moment(first.first - 1, None if commit is None else CommitStamp(*commit))
        for segment in usable:
            if segment.facts.last_time:
                for record in self._batches(segment).between(segment.first - 1, segment.last):
                    if record.committed is not None:
                        return Moment(record.revision, record.committed)
        return None

    def moment(self, hull: HullRows, time: int) -> Moment | None:
        """The last revision in segments that was committed at or before a time; None for none."""
        for segment in reversed(_usable(hull)):
            if segment.facts.first_time <= time and segment.facts.last_time:
                found = self._batches(segment).until(time)
                if found is not None:
                    return Moment(*found)
        oldest = self.oldest_moment(hull, timed=True)
        if oldest is None or oldest.committed is None or oldest.committed.time > time:
            return None
        return oldest

    def state(self, hull: HullRows, until: int) -> Kept:
        """The newest state that lies beside a segment and is not after a revision."""
        begins = [each for each in _usable(hull) if each.begins and each.first - 1 <= until]
        if not begins:
            raise _not_kept(hull, until)
        segment = begins[-1]
        return Kept() if segment.first == 1 else read_state(self._archive, segment)

    def batches(self, hull: HullRows, after: int, until: int) -> list[Record]:
        """Some batches after a revision: no more than one segment has."""
        return _some(self._batches(_segment(hull, after + 1)).between(after, until))

    def gathered(self, hull: HullRows, after: int, until: int) -> list[Record]:
        """What some batches after a revision come to: no more than one segment has."""
        batches = self._batches(_segment(hull, after + 1))
        return _some(gathered(batches, hull.row.settings, after, until))

    def _batches(self, segment: StoredSegment) -> Batches:
        with self._turn:
            batches = self._open.get(segment.file)
            if batches is not None:
                self._open.move_to_end(segment.file)
                return batches
        try:
            batches = read_batches(self._archive, segment)
        except DamagedError as error:
            raise DamagedError(f"revisions {segment.first} to {segment.last} cannot be read: {error}") from error
        with self._turn:
            self._open[segment.file] = batches
            while len(self._open) > KEPT_OPEN:
                self._open.popitem(last=False)
        return batches


def read_batches(archive: Archive, segment: StoredSegment) -> Batches:
    """The batches of a segment. Raises DamagedError, which names the file, or StorageError."""
    name, facts = segment.file + BATCHES, segment.facts
    columns, _, _ = from_parquet(archive.read(name, facts.bytes, facts.digest), name)
    if not len(columns) or (columns.revision[0], columns.revision[-1]) != (segment.first, segment.last):
        raise DamagedError(f"{name} has other revisions than {segment.first} to {segment.last}: restore a backup")
    return Batches(columns)


def read_state(archive: Archive, segment: StoredSegment) -> Kept:
    """The state beside a segment. Raises DamagedError, which names the file, or StorageError."""
    name, facts = segment.file + STATE, segment.facts
    columns, about, told = from_parquet(archive.read(name, facts.state_bytes, facts.state_digest), name)
    kept, _ = state_from(told)
    contents = contents_of(columns, times=about["times"] == "True", deadlines=about["deadlines"] == "True")
    return replace(kept, revision=segment.first - 1, contents=contents)


def _usable(hull: HullRows) -> list[StoredSegment]:
    """The segments that lead to the journal without a gap, from one on that begins with a state."""
    found: list[StoredSegment] = []
    expected = hull.oldest
    for segment in reversed(hull.segments):
        if segment.last != expected and not (not found and segment.last >= expected):
            break
        found.insert(0, segment)
        expected = segment.first - 1
    while found and not found[0].begins:
        del found[0]
    return found


def _segment(hull: HullRows, revision: int) -> StoredSegment:
    """The segment that has a revision."""
    found = next((each for each in _usable(hull) if each.first <= revision <= each.last), None)
    if found is None:
        raise _not_kept(hull, revision)
    return found


def _some(records: Iterator[Record]) -> list[Record]:
    """As many as are applied in some milliseconds."""
    found: list[Record] = []
    points = 0
    for record in records:
        found.append(record)
        points += 1 + len(record.rows)
        if points >= STEP_POINTS:
            break
    return found


def _not_kept(hull: HullRows, revision: int) -> DamagedError:
    return DamagedError(f"revision {revision} of hull {hull.row.name!r} is no longer kept")
