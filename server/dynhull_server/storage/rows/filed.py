"""Reading hulls as they were before what the journal has: from segments."""

import logging
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import chain, zip_longest
from threading import Lock, Thread

from ...state.contents.joining import in_one
from ...state.errors import words_for_callers
from ...state.records import CommitStamp, Contents, Kept, Keys, Parts, Record
from ...state.tracks import KeyChanges
from ...state.ways import KeyWays
from ..of_keys import changes_of_keys
from ..past import Found, Hole, Moment, created
from ..port import DamagedError, StorageError
from ..segments.archive import BATCHES, STATE, Archive
from ..segments.by_key import RowsByKey
from ..segments.columns import Batches, contents_of
from ..segments.gathered import gathered
from ..segments.parquet import (
    RowsOfKeys,
    columns_of_keys,
    keys_from_parquet,
    rows_from_parquet,
    state_from_parquet,
    ways_from_parquet,
)
from .chunks import state_from
from .ledger import HullRows
from .past_rows import STEP_POINTS
from .segment_rows import StoredSegment

log = logging.getLogger(__name__)

# Segments whose columns stay in memory, since what is read next is mostly in the same: these, and more of few rows, as
# those of many hulls that are read in the order of their commits.
KEPT_OPEN, KEPT_ROWS = 3, 2**20
# Segments that are looked at for some keys in one read.
TOGETHER = 16


class Filed:
    """The segments of hulls, read beside commits.

    Args:
        archive: has their files.

    Attributes:
        unreadable: the names of the files that could not be read, and have not been read as a whole since.
    """

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self.unreadable: set[str] = set()
        self._turn = Lock()
        self._open: OrderedDict[str, Future[RowsByKey]] = OrderedDict()
        self._ahead: Thread | None = None  # reads what is needed next

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

    def state_revision(self, hull: HullRows, until: int) -> int:
        """The revision of the newest state beside a segment that is not after another one."""
        return _begins(hull, until).first - 1

    def state(self, hull: HullRows, until: int) -> tuple[Kept, Parts]:
        """The newest state that lies beside a segment and is not after a revision, and its contents."""
        segment = _begins(hull, until)
        if segment.first == 1:
            return Kept(), Parts(0, [Contents()])
        with self._named(segment, STATE):
            kept, parts = state_in_parts(self._archive, segment)
        return kept, replace(parts, parts=self._parts(segment, parts.parts))

    def _parts(self, segment: StoredSegment, parts: Iterable[Contents]) -> Iterator[Contents]:
        with self._named(segment, STATE):
            yield from parts
        self._readable(segment.file + STATE)

    def batches(self, hull: HullRows, after: int, until: int) -> list[Record]:
        """Some batches after a revision: no more than one segment has."""
        return _some(self._rows_after(hull, after, until).next_batches(after).between(after, until))

    def gathered(self, hull: HullRows, after: int, until: int) -> list[Record]:
        """What some batches after a revision come to: no more than one segment has."""
        rows, settings = self._rows_after(hull, after, until), hull.row.settings
        record = rows.last_places(settings, after, until)
        if record is not None:
            return [record]
        return _some(gathered(rows.batches_between(after, until), settings, after, until))

    def key_state(self, hull: HullRows, keys: Keys, until: int) -> tuple[Kept, Parts]:
        """The newest state that lies beside a segment, with the points of some keys alone."""
        segment = _begins(hull, until)
        if segment.first == 1:
            return Kept(), Parts(0, [Contents()])
        with self._named(segment, STATE):
            return _key_state(self._archive, segment, keys)

    def key_changes(self, hull: HullRows, keys: Keys, after: int, until: int) -> tuple[int, KeyChanges]:
        """What the batches of some segments do to some keys, from a revision on."""
        segments = _run(hull, after + 1, until)[:TOGETHER]
        found: list[RowsOfKeys] = []
        for each in self._rows_of_keys(segments, keys) if self._archive.has_parts else self._apart(segments, keys):
            if isinstance(each, StorageError) and not found:
                raise each
            if not isinstance(each, RowsOfKeys):  # what is before it comes first
                break
            found.append(each)
        last = min(until, segments[len(found) - 1].last)
        columns = columns_of_keys(found)
        return last, changes_of_keys(columns.between(after, last), keys)

    def _apart(self, segments: list[StoredSegment], keys: Keys) -> Iterator[RowsOfKeys | StorageError | None]:
        """The same as `_rows_of_keys`, half of it read beside the caller, where to read is to wait.

        From a disk that took longer: two threads that need the interpreter again and again wait for each other.
        """
        beside: Future[list[RowsOfKeys | StorageError]] = Future()
        read = partial(self._rows_of_keys, segments[1::2], keys)
        begin_beside(Thread(target=_settle, args=(beside, read), name="read beside"))
        return chain.from_iterable(zip_longest(self._rows_of_keys(segments[::2], keys), beside.result()))

    def _rows_of_keys(self, segments: list[StoredSegment], keys: Keys) -> list[RowsOfKeys | StorageError]:
        """The rows of keys in some segments: of the first, and of others until that are many, or one fails."""
        found: list[RowsOfKeys | StorageError] = []
        rows = 0
        for segment in segments:
            name = segment.file + BATCHES
            try:
                with self._named(segment, BATCHES), self._archive.parts(name, segment.facts.wrote) as file:
                    some = keys_from_parquet(file, name, keys)
            except StorageError as error:
                return [*found, error]
            found.append(some)
            rows += len(some.table)
            if rows >= STEP_POINTS:
                break
        return found

    def ways(
        self, hull: HullRows, after: int, until: int, read: Callable[[Iterator[KeyWays]], Found]
    ) -> tuple[int, Found | None]:
        """What a function makes of the moves of keys of one segment, from a revision on."""
        segment = _segment(hull, after + 1)
        name, last = segment.file + BATCHES, min(until, segment.last)
        with self._named(segment, BATCHES):
            content = self._archive.read(name, segment.facts.wrote)
            self._readable(name)
            ways = ways_from_parquet(content, name, after, last)
            return last, None if ways is None else read(ways)

    def forget(self, file: str) -> None:
        """Forget what a file had, which is there no more."""
        with self._turn:
            self._open.pop(file, None)

    def _rows_after(self, hull: HullRows, after: int, until: int) -> RowsByKey:
        """The segment with the batches that follow a revision. The next one is read meanwhile if it is needed, too."""
        segment = _segment(hull, after + 1)
        rows = self._rows(segment)
        if segment.last < min(until, hull.start):
            self._read_ahead(_segment(hull, segment.last + 1))
        return rows

    def _batches(self, segment: StoredSegment) -> Batches:
        return self._rows(segment).batches()

    def _rows(self, segment: StoredSegment) -> RowsByKey:
        reading, begins = self._reading(segment)
        if begins:
            self._read(segment, reading)
        with self._named(segment, BATCHES):
            return reading.result()

    def _reading(self, segment: StoredSegment) -> "tuple[Future[RowsByKey], bool]":
        """What has been read of a segment, or is being read; and whether the caller is to read it."""
        with self._turn:
            reading = self._open.get(segment.file)
            if reading is not None:
                self._open.move_to_end(segment.file)
                return reading, False
            reading = self._open[segment.file] = Future()
            rows = sum(map(_count, self._open.values()))
            while len(self._open) > KEPT_OPEN and rows > KEPT_ROWS:
                rows -= _count(self._open.popitem(last=False)[1])
            return reading, True

    def _read(self, segment: StoredSegment, reading: "Future[RowsByKey]") -> None:
        """Read a segment. Others wait for it; if it cannot be read, who needs it next tries again."""
        try:
            found = read_rows(self._archive, segment)
            self._readable(segment.file + BATCHES)
            reading.set_result(found)
        except Exception as error:
            self.forget(segment.file)
            reading.set_exception(error)

    def _read_ahead(self, segment: StoredSegment) -> None:
        """Read a segment beside the caller, unless another one is being read so."""
        if self._ahead is not None and self._ahead.is_alive():
            return
        reading, begins = self._reading(segment)
        if begins:
            self._ahead = Thread(target=self._read, args=(segment, reading), name="read ahead")
            begin_beside(self._ahead)

    @contextmanager
    def _named(self, segment: StoredSegment, end: str) -> Iterator[None]:
        """Say which revisions cannot be read without a file, and take note that it cannot."""
        try:
            with named(segment, end):
                yield
        except StorageError as error:
            with self._turn:
                told = segment.file + end in self.unreadable
                self.unreadable.add(segment.file + end)
            if not told:
                log.warning("a part of the past cannot be read", extra={"reason": str(error)})
            raise

    def _readable(self, file: str) -> None:
        """Take note that all of a file has been read: what is in memory, or a part of it, says nothing of the rest."""
        with self._turn:
            self.unreadable.discard(file)


@contextmanager
def named(segment: StoredSegment, end: str) -> Iterator[None]:
    """Say which revisions cannot be read without a file."""
    first, last = segment.first, segment.last
    what = f"revisions {first} to {last}" if end == BATCHES else f"the state at revision {first - 1}"
    try:
        require_known(segment)
        yield
    except StorageError as error:
        why = "is missing or damaged" if isinstance(error, DamagedError) else words_for_callers(error)
        plainly = f"{what} cannot be read: segment {segment.file} {why}"
        raise type(error)(f"{what} cannot be read: {error}", for_callers=plainly) from error


def require_known(segment: StoredSegment) -> None:
    """Raise DamagedError if it is not known any more what the files of a segment were written with."""
    if not segment.facts.bytes:
        raise DamagedError(f"{segment.file}: its row in the database was damaged: restore a backup")


def read_rows(archive: Archive, segment: StoredSegment) -> RowsByKey:
    """The rows of a segment. Raises DamagedError, which names the file, or StorageError."""
    name, facts = segment.file + BATCHES, segment.facts
    rows, _, _ = rows_from_parquet(archive.read(name, facts.wrote), name)
    if not len(rows) or (rows.first, rows.first + len(rows.starts) - 2) != (segment.first, segment.last):
        raise DamagedError(f"{name} has other revisions than {segment.first} to {segment.last}: restore a backup")
    return rows


def read_batches(archive: Archive, segment: StoredSegment) -> Batches:
    """The batches of a segment. Raises the errors of `read_rows`."""
    return read_rows(archive, segment).batches()


def read_state(archive: Archive, segment: StoredSegment) -> Kept:
    """The state beside a segment. Raises the errors of `state_in_parts`."""
    kept, parts = state_in_parts(archive, segment)
    return replace(kept, contents=in_one(parts.parts))


def state_in_parts(archive: Archive, segment: StoredSegment) -> tuple[Kept, Parts]:
    """The state beside a segment without its contents, and these.

    Raises DamagedError, which names the file, or StorageError; the first also when a part is read.
    """
    name, facts = segment.file + STATE, segment.facts
    parts, told = state_from_parquet(archive.read(name, facts.state_wrote), name)
    kept, _ = state_from(told)
    return replace(kept, revision=segment.first - 1), parts


def _key_state(archive: Archive, segment: StoredSegment, keys: Keys) -> tuple[Kept, Parts]:
    """The same with some keys alone."""
    name, facts = segment.file + STATE, segment.facts
    with archive.parts(name, facts.state_wrote) as file:
        some = keys_from_parquet(file, name, keys)
    kept, _ = state_from(some.state)
    contents = contents_of(columns_of_keys([some]), some.about)
    return replace(kept, revision=segment.first - 1), Parts(len(contents), [contents])


def holes(hulls: Mapping[int, HullRows], files: Set[str]) -> Iterator[Hole]:
    """What is missing of the past of hulls while these files cannot be read."""
    for number, hull in hulls.items():
        for segment in hull.segments:
            if segment.file + BATCHES in files:
                yield Hole(number, segment.first, segment.last)
            elif segment.file + STATE in files:
                yield Hole(number, segment.first - 1, segment.first - 1)


def begin_beside(thread: Thread) -> None:
    """Start a thread, or do its work here where the system has no more threads: others wait for what it is to read."""
    try:
        thread.start()
    except RuntimeError:
        thread.run()


def _settle(future: "Future[Found]", function: Callable[[], Found]) -> None:
    """Have a future end as a function does."""
    try:
        future.set_result(function())
    except BaseException as error:
        future.set_exception(error)


def _begins(hull: HullRows, until: int) -> StoredSegment:
    """The last segment beside which there is a state that is not after a revision."""
    begins = [each for each in _usable(hull) if each.begins and each.first - 1 <= until]
    if not begins:
        raise _not_kept(hull, until)
    return begins[-1]


def _usable(hull: HullRows) -> list[StoredSegment]:
    """The segments that lead to the journal without a gap, from one on that begins with a state."""
    found: list[StoredSegment] = []
    expected = hull.start
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


def _run(hull: HullRows, first: int, last: int) -> list[StoredSegment]:
    """The segments that have some revisions, from the first of these on."""
    found = [each for each in _usable(hull) if first <= each.last and each.first <= last]
    if not found or found[0].first > first:
        raise _not_kept(hull, first)
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


def _count(reading: "Future[RowsByKey]") -> int:
    """The rows of a segment that has been read; 0 of one that is being read."""
    return len(reading.result()) if reading.done() and reading.exception() is None else 0
