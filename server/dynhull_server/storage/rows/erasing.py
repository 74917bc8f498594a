"""Erasing keys from segments: the same batches without them, in other files."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from dynhull.keys import key_list, take_keys

from ...state.records import Contents, HeldRows, Kept, KeyRows, Keys, Record
from ..past import EraseRequest, Erasure
from ..port import NEWEST
from ..segments.archive import BATCHES, STATE, Archive
from ..segments.columns import columns_of
from .filed import named, read_batches, read_state
from .filing import MOST_ROWS, Due
from .ledger import HullRows
from .segment_rows import StoredSegment


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Consecutive segments without some keys.

    Attributes:
        segments: the segments.
        before: the state that lies beside the first, if one does.
        records: the batches.
        had: whether the segments had any of the keys.
    """

    segments: tuple[StoredSegment, ...]
    before: Kept | None
    records: list[Record]
    had: bool

    def takes(self, other: "_Stretch") -> bool:
        """Whether one segment is to have both."""
        moves, more = self._moves, other._moves
        follows = self.segments[-1].last + 1 == other.segments[0].first
        return follows and other.before is None and moves <= 2 * more and moves + more <= MOST_ROWS

    def with_next(self, other: "_Stretch") -> "_Stretch":
        """Both."""
        return _Stretch(
            self.segments + other.segments, self.before, self.records + other.records, self.had or other.had
        )

    @property
    def _moves(self) -> int:
        return sum(each.facts.moves for each in self.segments)


class Erasing:
    """Some keys that are erased from the past of a hull, up to a revision.

    Args:
        hull: the hull.
        requests: the keys. Those that several name are those of the first.
        until: the revision.
        archive: has the files.

    Attributes:
        hull, requests, archive: the same.
    """

    def __init__(self, hull: HullRows, requests: Sequence[EraseRequest], until: int, archive: Archive) -> None:
        self.hull = hull
        self.archive = archive
        self.requests = requests
        self._until = until
        self._of = {key: at for at in reversed(range(len(requests))) for key in key_list(requests[at].keys)}
        self._firsts = np.full(len(requests), NEWEST)
        self._moves = np.zeros(len(requests), np.int64)

    def segments(self) -> Iterator[tuple[tuple[StoredSegment, ...], Due]]:
        """Segments that have one of the keys, and of what to make the one that has none and takes their place.

        It takes the place of several where each but the first is without a state of its own and not much smaller than
        those before it together: so erasures, of which each ends a segment, leave few.

        Raises:
            DamagedError: a file is not as it was written.
            StorageError: it cannot be read at present.
        """
        run: _Stretch | None = None
        for segment in self.hull.segments:
            if segment.first - 1 > self._until:
                break
            read = self._read(segment)
            if run is not None and run.takes(read):
                run = run.with_next(read)
                continue
            yield from self._due(run)
            run = read
        yield from self._due(run)

    def _read(self, segment: StoredSegment) -> _Stretch:
        """A segment without the keys."""
        with named(segment, STATE):
            before = read_state(self.archive, segment) if segment.facts.state_bytes else None
        found = [] if before is None else [before.contents.keys, held_keys(before.contents)]
        owners = [each[each >= 0] for each in (self._owners(keys) for keys in found if keys is not None)]
        in_state = any(map(len, owners))
        if before is not None and in_state:
            before = replace(before, contents=self._without(before.contents))
            np.minimum.at(self._firsts, np.concatenate(owners), segment.first - 1)
        moves = self._moves.sum()
        with named(segment, BATCHES):
            batches = read_batches(self.archive, segment).between(segment.first - 1, segment.last)
        records = [self._record(each) if each.revision <= self._until else each for each in batches]
        return _Stretch((segment,), before, records, in_state or bool(self._moves.sum() > moves))

    def _due(self, run: _Stretch | None) -> Iterator[tuple[tuple[StoredSegment, ...], Due]]:
        if run is not None and run.had:
            row = self.hull.row
            yield run.segments, Due(row, columns_of(run.records, row.settings.identity), run.before)

    def done(self, now: int) -> list[tuple[EraseRequest, Erasure]]:
        """What has been erased for whom, at a time."""
        return [
            (request, Erasure(first, self._until, now, len(set(key_list(request.keys))), moves))
            for request, first, moves in zip(self.requests, self._firsts.tolist(), self._moves.tolist(), strict=True)
            if first != NEWEST
        ]

    def _owners(self, keys: Keys) -> npt.NDArray[np.intp]:
        """The places of the requests that name keys; -1 for those that are to stay."""
        return np.fromiter((self._of.get(key, -1) for key in key_list(keys)), np.intp, len(keys))

    def _record(self, record: Record) -> Record:
        rows = record.rows
        if not isinstance(rows, KeyRows):
            return record
        held = rows.held
        named = [rows.keys, rows.removes, *(() if held is None else (held.rows.keys, held.dropped))]
        owners = [self._owners(keys) for keys in named]
        erased = np.concatenate(owners)
        erased = erased[erased >= 0]
        if not len(erased):
            return record
        np.add.at(self._moves, erased, 1)
        np.minimum.at(self._firsts, erased, record.revision)
        put, removed, *of_held = (each < 0 for each in owners)  # what stays of each
        if held is not None:
            holds, drops = of_held
            held = replace(held, rows=_held(held.rows, holds), dropped=_keys(held.dropped, drops))
        left = replace(
            rows,
            keys=_keys(rows.keys, put),
            points=rows.points[put],
            removes=_keys(rows.removes, removed),
            times=None if rows.times is None else rows.times[put],
            deadlines=None if rows.deadlines is None else rows.deadlines[put],
            held=held,
            accuracies=None if rows.accuracies is None else rows.accuracies[put],
        )
        return replace(record, rows=left)

    def _without(self, contents: Contents) -> Contents:
        assert contents.keys is not None  # only hulls with keys are asked about
        left = self._owners(contents.keys) < 0
        held = contents.held
        return Contents(
            contents.points[left],
            _keys(contents.keys, left),
            None if contents.times is None else contents.times[left],
            None if contents.deadlines is None else contents.deadlines[left],
            None if held is None else _held(held, self._owners(held.keys) < 0),
            None if contents.accuracies is None else contents.accuracies[left],
        )


def held_keys(contents: Contents) -> Keys | None:
    """The keys in quarantine."""
    return None if contents.held is None else contents.held.keys


def _keys(keys: Keys, left: npt.NDArray[np.bool_]) -> Keys:
    return keys if left.all() else take_keys(keys, np.flatnonzero(left))


def _held(held: HeldRows, left: npt.NDArray[np.bool_]) -> HeldRows:
    return HeldRows(
        _keys(held.keys, left),
        held.points[left],
        held.times[left],
        held.deadlines[left],
        held.speeds[left],
        held.growths[left],
        held.revisions[left],
        held.confirmed[left],
        held.accuracies[left],
    )
