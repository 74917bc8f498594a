"""Batches and states as columns: a row for each point or key, in the order in which a batch has them."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from itertools import chain
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys

from ...state.records import (
    FOREVER,
    NO_TIME,
    Accuracies,
    Cause,
    CommitStamp,
    Contents,
    Expiry,
    HeldChange,
    HeldRows,
    Identity,
    KeyRows,
    Keys,
    PointRows,
    QuarantineRules,
    Record,
    Rows,
    Times,
)

# What a row is about, and what it does: the words of the files. "division" is for hulls over shards, which have no
# segments so far.
Kind = Literal["rows", "expiry", "held", "dropped", "settings", "centre", "division"]
Op = Literal["insert", "delete", "put", "remove", "expire", "hold", "drop"]
KINDS: tuple[Kind, ...] = get_args(Kind)
OPS: tuple[Op, ...] = get_args(Op)
CAUSES: tuple[Cause, ...] = get_args(Cause)
NONE = -1  # in place of an index into one of these
ROWS, EXPIRY, HELD, DROPPED, SETTINGS, CENTRE = range(6)
INSERT, DELETE, PUT, REMOVE, EXPIRE, HOLD, DROP = range(7)
MOVES = (INSERT, DELETE, PUT, REMOVE)

Integers = npt.NDArray[np.int64]
Codes = npt.NDArray[np.int8]


@dataclass(slots=True)
class SegmentColumns:
    """Rows of one hull, ordered by revision and by their place in it.

    Attributes:
        identity: what identifies a point of the hull.
        revision: the revision of each row.
        commit, committed: the number and the time of its commit; NO_TIME where they are not known.
        cause: what made the revision, as an index into CAUSES; NONE where it is not known.
        clock: the clock of the hull after the revision; NO_TIME for none.
        place: the place of the row in its revision.
        kind, op: indexes into KINDS and OPS; NONE for none.
        keyed: whether the row has a key.
        keys: the keys of the rows that have one.
        points: (n, 2) positions, NaN for none.
        event_time, expire_time: the times of these; NO_TIME and FOREVER for none.
        accuracy: how far each position may be from where it really is; 0 for not at all.
        detail: what no column has, as JSON; None for nothing.
    """

    identity: Identity
    revision: Integers
    commit: Integers
    committed: Integers
    cause: Codes
    clock: Integers
    place: Integers
    kind: Codes
    op: Codes
    keyed: npt.NDArray[np.bool_]
    keys: Keys
    points: Points
    event_time: Times
    expire_time: Times
    accuracy: Accuracies
    detail: list[str | None]

    def __len__(self) -> int:
        return len(self.revision)

    def rows(self, first: int, last: int) -> "SegmentColumns":
        """Some of the rows."""
        before = int(np.count_nonzero(self.keyed[:first]))
        keys = slice(before, before + int(np.count_nonzero(self.keyed[first:last])))
        return SegmentColumns(
            self.identity,
            *(getattr(self, name)[keys if name == "keys" else slice(first, last)] for name in COLUMNS),
        )

    def between(self, after: int, until: int) -> "SegmentColumns":
        """The rows of the batches after one revision up to another one."""
        first, last = np.searchsorted(self.revision, [after, until], side="right").tolist()
        return self.rows(first, max(first, last))

    @property
    def moves(self) -> int:
        """The number of points and keys that these batches write."""
        return int(np.isin(self.op, MOVES).sum())


COLUMNS = tuple(each.name for each in fields(SegmentColumns) if each.name != "identity")


@dataclass(slots=True)
class _Piece:
    """Rows of one kind in one record."""

    kind: int
    op: int
    count: int
    keys: Keys | None = None
    points: Points | None = None
    times: Times | None = None
    deadlines: Times | None = None
    details: Sequence[dict[str, Any]] = ()
    accuracies: Accuracies | None = None


@dataclass(slots=True)
class _Heads:
    """What all rows of a record have in common, and how many pieces it has."""

    revision: list[int] = field(default_factory=list)
    commit: list[int] = field(default_factory=list)
    committed: list[int] = field(default_factory=list)
    clock: list[int] = field(default_factory=list)
    cause: list[int] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)


def columns_of(records: Iterable[Record], identity: Identity) -> SegmentColumns:
    """Batches as columns. O(their rows). ValueError for those of a hull over shards."""
    heads, pieces = _Heads(), list[_Piece]()
    for record in records:
        number, time = record.committed or (NO_TIME, NO_TIME)
        heads.revision.append(record.revision)
        heads.commit.append(number)
        heads.committed.append(time)
        heads.clock.append(NO_TIME if record.clock is None else record.clock)
        heads.cause.append(NONE if record.cause is None else CAUSES.index(record.cause))
        before = len(pieces)
        pieces += _pieces(record)
        heads.numbers.append(len(pieces) - before)
    return _joined(heads, pieces, identity)


def joined(parts: Sequence[SegmentColumns], identity: Identity) -> SegmentColumns:
    """The rows of several columns, one after the other."""
    if len(parts) == 1:
        return parts[0]
    empty = columns_of([], identity)
    keys = _joined_keys([part.keys for part in parts], identity)
    detail = list(chain.from_iterable(part.detail for part in parts))
    arrays = {
        name: np.concatenate([getattr(empty, name), *(getattr(part, name) for part in parts)])
        for name in COLUMNS
        if name not in ("keys", "detail")
    }
    return SegmentColumns(identity, **arrays, keys=keys, detail=detail)


def columns_of_state(
    contents: Contents, revision: int, commit: CommitStamp | None, identity: Identity
) -> SegmentColumns:
    """The contents of a hull at a revision as columns."""
    op = INSERT if identity == "multiset" else PUT
    columns = contents.keys, contents.points, contents.times, contents.deadlines
    pieces = [_Piece(ROWS, op, len(contents), *columns, accuracies=contents.accuracies)]
    if contents.held is not None:
        pieces.append(_held(contents.held))
    number, time = commit or (NO_TIME, NO_TIME)
    return _joined(_Heads([revision], [number], [time], [NO_TIME], [NONE], [len(pieces)]), pieces, identity)


def records_of(columns: SegmentColumns) -> Iterator[Record]:
    """The batches in columns, in order, without who has numbered them. ValueError if they are none."""
    yield from Batches(columns).between(0, FOREVER)


def contents_of(columns: SegmentColumns, about: Mapping[str, str]) -> Contents:
    """The contents of a hull in columns, with times and with deadlines if their file says so."""
    reader = Batches(columns)
    rows = int((columns.kind == ROWS).sum())
    return Contents(
        columns.points[:rows],
        None if columns.identity == "multiset" else reader.keys(0, rows),
        np.ascontiguousarray(columns.event_time[:rows]) if about["times"] == "True" else None,
        np.ascontiguousarray(columns.expire_time[:rows]) if about["deadlines"] == "True" else None,
        reader.held(rows, len(columns)) if rows < len(columns) else None,
        _accuracies(columns.accuracy[:rows]),
    )


def _pieces(record: Record) -> list[_Piece]:
    """The rows of a record; at least one."""
    if record.shares is not None:
        raise ValueError("a hull over shards has no segments")
    said: dict[str, Any] = {}
    found = _rows(record.rows, said)
    if record.center is not None:
        found.insert(0, _Piece(CENTRE, NONE, 1, points=np.array([record.center])))
    if said or not found:
        found.insert(0, _Piece(ROWS, NONE, 1, details=[said]))
    return found


def _rows(rows: Rows, said: dict[str, Any]) -> list[_Piece]:
    if isinstance(rows, Expiry):
        until = None if rows.until is None else np.array([rows.until])
        return [_Piece(EXPIRY, EXPIRE, 1, times=until, details=[{"points": rows.points}])]
    found = []
    if _says_nothing(rows.times, NO_TIME):
        said["times"] = True
    if isinstance(rows, PointRows):
        if rows.lenient:
            said["lenient"] = True
        if len(rows.inserts):
            found.append(_Piece(ROWS, INSERT, len(rows.inserts), None, rows.inserts, rows.times))
        if len(rows.deletes):
            found.append(_Piece(ROWS, DELETE, len(rows.deletes), None, rows.deletes))
        return found
    if _says_nothing(rows.deadlines, FOREVER):
        said["deadlines"] = True
    if rows.condition is not None:
        said["condition"] = rows.condition
    if len(rows.keys):
        of_puts = rows.keys, rows.points, rows.times, rows.deadlines
        found.append(_Piece(ROWS, PUT, len(rows.keys), *of_puts, accuracies=rows.accuracies))
    if len(rows.removes):
        found.append(_Piece(ROWS, REMOVE, len(rows.removes), rows.removes))
    if rows.held is not None:
        said["held"] = True
        found += _changed(rows.held)
    return found


def _changed(change: HeldChange) -> list[_Piece]:
    found = []
    if len(change.dropped):
        found.append(_Piece(DROPPED, DROP, len(change.dropped), change.dropped))
    if len(change.rows):
        found.append(_held(change.rows))
    if change.rules is not None:
        found.append(_Piece(SETTINGS, NONE, 1, details=[asdict(change.rules)]))
    return found


def _says_nothing(times: Times | None, none: int) -> bool:
    """Whether there is a column of times that has no time: `detail` then says that there is one."""
    return times is not None and bool((times == none).all())


def _held(held: HeldRows) -> _Piece:
    numbers = (held.speeds, held.growths, held.revisions, held.confirmed)
    details = [
        {"speed": _number(speed), "growth": _number(growth), "revision": revision, "confirmed": confirmed}
        for speed, growth, revision, confirmed in zip(*(column.tolist() for column in numbers), strict=True)
    ]
    columns = held.keys, held.points, held.times, held.deadlines, details, held.accuracies
    return _Piece(HELD, HOLD, len(held), *columns)


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value


def _joined(heads: _Heads, pieces: list[_Piece], identity: Identity) -> SegmentColumns:
    counts = np.array([piece.count for piece in pieces], np.int64)
    ends = np.cumsum(counts)
    total = int(counts.sum())
    lasts = np.cumsum(np.array(heads.numbers, np.int64)) - 1  # the last piece of each record
    sizes = np.diff(ends[lasts], prepend=0)
    detail: list[str | None] = [None] * total
    for piece, end in zip(pieces, ends.tolist(), strict=True):
        for place, said in enumerate(piece.details, end - piece.count):
            detail[place] = json.dumps(said) if said else None
    return SegmentColumns(
        identity,
        np.repeat(np.array(heads.revision, np.int64), sizes),
        np.repeat(np.array(heads.commit, np.int64), sizes),
        np.repeat(np.array(heads.committed, np.int64), sizes),
        np.repeat(np.array(heads.cause, np.int8), sizes),
        np.repeat(np.array(heads.clock, np.int64), sizes),
        np.arange(total) - np.repeat(ends[lasts] - sizes, sizes),
        np.repeat(np.array([piece.kind for piece in pieces], np.int8), counts),
        np.repeat(np.array([piece.op for piece in pieces], np.int8), counts),
        np.repeat(np.array([piece.keys is not None for piece in pieces], np.bool_), counts),
        _joined_keys([piece.keys for piece in pieces if piece.keys is not None], identity),
        np.concatenate([np.empty((0, 2)), *(_points(piece) for piece in pieces)]),
        _joined_times([(piece.count, piece.times) for piece in pieces], NO_TIME),
        _joined_times([(piece.count, piece.deadlines) for piece in pieces], FOREVER),
        _joined_accuracies(pieces),
        detail,
    )


def _points(piece: _Piece) -> Points:
    return np.full((piece.count, 2), np.nan) if piece.points is None else piece.points


def _joined_keys(parts: list[Keys], identity: Identity) -> Keys:
    if identity == "int":
        return np.concatenate([np.empty(0, np.uint64), *(part for part in parts if isinstance(part, np.ndarray))])
    strings = [part for part in parts if isinstance(part, PackedKeys)]
    return PackedKeys(b"".join(part.lengths for part in strings), b"".join(part.data for part in strings))


def _joined_times(parts: list[tuple[int, Times | None]], none: int) -> Times:
    if all(times is None for _, times in parts):
        return np.full(sum(count for count, _ in parts), none, np.int64)
    columns = [np.full(count, none, np.int64) if times is None else times for count, times in parts]
    return np.concatenate([np.empty(0, np.int64), *columns])


def _joined_accuracies(pieces: list[_Piece]) -> Accuracies:
    if all(piece.accuracies is None for piece in pieces):
        return np.zeros(sum(piece.count for piece in pieces))
    return np.concatenate([np.zeros(each.count) if each.accuracies is None else each.accuracies for each in pieces])


def _accuracies(column: Accuracies) -> Accuracies | None:
    return np.ascontiguousarray(column) if column.any() else None


class Batches:
    """Batches that lie in columns, read as records one after the other.

    Args:
        columns: the columns.

    Attributes:
        columns: the same.
        starts: the first row of each batch, and the number of rows.
    """

    def __init__(self, columns: SegmentColumns) -> None:
        self.columns = columns
        revision = columns.revision
        begins = np.flatnonzero(revision[1:] != revision[:-1]) + 1
        self.starts = np.concatenate([[0], begins, [len(columns)]] if len(columns) else [[0]])
        self._revisions = revision[self.starts[:-1]]
        self._committed = columns.committed[self.starts[:-1]]
        # The number of keys before each row; None where every row has one.
        self._keys_before = None if columns.keyed.all() else np.concatenate([[0], np.cumsum(columns.keyed)])

    def between(self, after: int, until: int) -> Iterator[Record]:
        """The batches after one revision up to another one."""
        return map(self.at, range(*self.places(after, until)))

    def places(self, after: int, until: int) -> tuple[int, int]:
        """The place of the first batch after a revision, and of the first one after another."""
        first, last = np.searchsorted(self._revisions, [after, until], side="right").tolist()
        return first, max(first, last)

    def rows(self, first: int, last: int) -> slice:
        """The rows of the batches from one place up to another one."""
        return slice(int(self.starts[first]), int(self.starts[last]))

    def at(self, place: int) -> Record:
        """The batch at a place."""
        return self._record(int(self.starts[place]), int(self.starts[place + 1]))

    def until(self, time: int) -> tuple[int, CommitStamp] | None:
        """The last revision committed at or before a time, and its commit; None if there is none."""
        last = int(np.searchsorted(self._committed, time, side="right")) - 1
        if last < 0 or self._committed[last] == NO_TIME:
            return None
        return int(self._revisions[last]), self._commit(int(self.starts[last]))

    def _commit(self, row: int) -> CommitStamp:
        return CommitStamp(int(self.columns.commit[row]), int(self.columns.committed[row]))

    def keys(self, start: int, end: int) -> Keys:
        """The keys of some rows."""
        before = self._keys_before
        if before is None:
            return self.columns.keys[start:end]
        return self.columns.keys[int(before[start]) : int(before[end])]

    def _record(self, start: int, end: int) -> Record:
        """The record in some rows, which are all that it has."""
        columns = self.columns
        said, center = {}, None
        at = start
        if columns.kind[at] == ROWS and columns.op[at] == NONE:
            said = json.loads(columns.detail[at] or "{}")
            at += 1
        if at < end and columns.kind[at] == CENTRE:
            center = (float(columns.points[at, 0]), float(columns.points[at, 1]))
            at += 1
        commit, clock, cause = int(columns.commit[start]), int(columns.clock[start]), int(columns.cause[start])
        return Record(
            int(columns.revision[start]),
            self._rows(at, end, said),
            clock=None if clock == NO_TIME else clock,
            center=center,
            cause=None if cause == NONE else CAUSES[cause],
            committed=None if commit == NO_TIME else self._commit(start),
        )

    def _rows(self, start: int, end: int, said: dict[str, Any]) -> Rows:
        columns = self.columns
        if start < end and columns.kind[start] == EXPIRY:
            until = int(columns.event_time[start])
            points = json.loads(columns.detail[start] or "")["points"]
            return Expiry(None if until == NO_TIME else until, points)
        ops = columns.op[start:end]
        first, second = (INSERT, DELETE) if columns.identity == "multiset" else (PUT, REMOVE)
        added = start + int((ops == first).sum())
        removed = added + int((ops == second).sum())
        times = self._times(columns.event_time[start:added], NO_TIME, always=said.get("times", False))
        points = columns.points[start:added]
        if columns.identity == "multiset":
            return PointRows(points, columns.points[added:removed], said.get("lenient", False), times)
        deadlines = self._times(columns.expire_time[start:added], FOREVER, always=said.get("deadlines", False))
        return KeyRows(
            self.keys(start, added),
            points,
            self.keys(added, removed),
            times,
            deadlines,
            said.get("condition"),
            self._change(removed, end) if said.get("held") else None,
            _accuracies(columns.accuracy[start:added]),
        )

    def _change(self, start: int, end: int) -> HeldChange:
        kinds = self.columns.kind[start:end]
        dropped = start + int((kinds == DROPPED).sum())
        held = dropped + int((kinds == HELD).sum())
        rules = QuarantineRules(**json.loads(self.columns.detail[held] or "")) if held < end else None
        return HeldChange(self.held(dropped, held), self.keys(start, dropped), rules)

    def held(self, start: int, end: int) -> HeldRows:
        """The positions in quarantine in some rows."""
        columns = self.columns
        details = [json.loads(detail or "") for detail in columns.detail[start:end]]

        def numbers(name: str, kind: type) -> npt.NDArray[Any]:
            return np.array([np.nan if each[name] is None else each[name] for each in details], kind)

        return HeldRows(
            self.keys(start, end),
            columns.points[start:end],
            columns.event_time[start:end],
            columns.expire_time[start:end],
            numbers("speed", np.float64),
            numbers("growth", np.float64),
            numbers("revision", np.int64),
            numbers("confirmed", np.int64),
            np.ascontiguousarray(columns.accuracy[start:end]),
        )

    def _times(self, times: Times, none: int, *, always: bool) -> Times | None:
        return np.ascontiguousarray(times) if always or bool((times != none).any()) else None
