"""An admitted batch, divided among shards; and what the shards did, or why they refuse, as that of one hull."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from dynhull.keys import PackedKeys
from dynhull_server.state.batch import Applied, Batch
from dynhull_server.state.contents import gate, key_rows, windowed
from dynhull_server.state.contents.multiset import missing_point
from dynhull_server.state.errors import KeyMissingError, PointMissingError, RefusedError
from dynhull_server.state.records import KeyRows, Keys
from dynhull_surface.counts import COUNTS

from .placement import Hashes, key_hashes, point_hashes, shards_of

Admitted = Batch | windowed.AdmittedRows | gate.AdmittedPuts
RowNumbers = npt.NDArray[np.intp]
NO_ROWS: RowNumbers = np.empty(0, np.intp)


@dataclass(frozen=True, slots=True)
class Part:
    """The rows of a batch that belong to one shard.

    Attributes:
        admitted: these rows, admitted.
        removals: which of the batch's deletes or removes they have.
    """

    admitted: Admitted
    removals: RowNumbers


def refusable(admitted: Admitted) -> bool:
    """Whether it depends on the points of a shard whether it refuses the batch."""
    if isinstance(admitted, gate.AdmittedPuts):
        return admitted.refuse_missing and len(admitted.rows.removes) > 0
    batch = _batch(admitted)
    return not batch.count_missing and len(batch.deletes) > 0


def most_growth(admitted: Admitted) -> int:
    """The largest increase in the number of points."""
    return len(admitted.rows.keys) if isinstance(admitted, gate.AdmittedPuts) else _batch(admitted).growth


def refuse_repeated(rows: KeyRows) -> None:
    """Raise KeyRepeatedError if a key comes twice. O(k log k), and O(k) Python objects only where hashes are equal."""
    hashes = np.sort(np.concatenate([key_hashes(rows.keys), key_hashes(rows.removes)]))
    if (hashes[1:] == hashes[:-1]).any():
        key_rows.refuse_repeated(rows)


def divided(admitted: Admitted, count: int) -> dict[int, Part]:
    """The part of each shard that has one. O(k + count)."""
    if isinstance(admitted, gate.AdmittedPuts):
        rows = admitted.rows
        puts = _by_shard(key_hashes(rows.keys), count)
        removes = _by_shard(key_hashes(rows.removes), count)
        return {shard: _keyed_part(admitted, *rows) for shard, rows in _joined(puts, removes).items()}
    inserts = _by_shard(point_hashes(_batch(admitted).inserts), count)
    deletes = _by_shard(point_hashes(_batch(admitted).deletes), count)
    return {shard: _points_part(admitted, *rows) for shard, rows in _joined(inserts, deletes).items()}


def merged(
    admitted: Admitted, effects: Sequence[Applied], revision: int, *, hull_changed: bool, points: int
) -> Applied:
    """The effect of a batch whose parts had these effects."""
    applied = Applied(revision, 0, 0, 0, hull_changed, points)
    for name in COUNTS.keys() - {"held"}:  # a hull over shards has no quarantine
        setattr(applied, name, sum(getattr(each, name) for each in effects))
    if not isinstance(admitted, Batch):
        applied.late, applied.clamped, applied.clock = admitted.late, admitted.clamped, admitted.clock
    return applied


def first_refusal(admitted: Admitted, refusals: Sequence[tuple[Part, RefusedError]]) -> RefusedError:
    """The refusal of a batch of which some parts are refused: because of its first such row."""
    rows = []
    for part, error in refusals:
        if not isinstance(error, KeyMissingError | PointMissingError):
            return error
        rows.append((int(part.removals[error.row]), error))
    row, error = min(rows, key=lambda each: each[0])
    if isinstance(error, KeyMissingError):
        return KeyMissingError(row, error.key)
    assert not isinstance(admitted, gate.AdmittedPuts)  # it has no points to delete
    return missing_point(_batch(admitted), row, error.point)


def _batch(admitted: Batch | windowed.AdmittedRows) -> Batch:
    return admitted if isinstance(admitted, Batch) else admitted.batch


def _by_shard(hashes: Hashes, count: int) -> dict[int, RowNumbers]:
    """The rows of each shard that has any, ascending. O(k + count)."""
    shards = shards_of(hashes, count)
    order = np.argsort(shards, kind="stable")  # a radix sort, because the numbers are small ones
    ends = np.cumsum(np.bincount(shards, minlength=count)).tolist()
    return {shard: order[begin:end] for shard, (begin, end) in enumerate(pairwise([0, *ends])) if begin < end}


def _joined(one: dict[int, RowNumbers], other: dict[int, RowNumbers]) -> dict[int, tuple[RowNumbers, RowNumbers]]:
    return {shard: (one.get(shard, NO_ROWS), other.get(shard, NO_ROWS)) for shard in sorted({*one, *other})}


def _points_part(admitted: Batch | windowed.AdmittedRows, inserts: RowNumbers, deletes: RowNumbers) -> Part:
    batch = _batch(admitted)
    # Origin and destination of a move may belong to different shards, so a part has inserts and deletes alone.
    part = Batch(batch.inserts[inserts], batch.deletes[deletes], 0, batch.count_missing)
    if isinstance(admitted, Batch):
        return Part(part, deletes)
    return Part(windowed.AdmittedRows(part, admitted.times[inserts], admitted.clock, 0, 0), deletes)


def _keyed_part(admitted: gate.AdmittedPuts, puts: RowNumbers, removes: RowNumbers) -> Part:
    rows = admitted.rows
    part = KeyRows(
        keys_at(rows.keys, puts),
        rows.points[puts],
        keys_at(rows.removes, removes),
        None if rows.times is None else rows.times[puts],
        None if rows.deadlines is None else rows.deadlines[puts],
        rows.condition,
        accuracies=None if rows.accuracies is None else rows.accuracies[puts],
    )
    return Part(gate.AdmittedPuts(part, admitted.clock, 0, 0, admitted.refuse_missing), removes)


def keys_at(keys: Keys, rows: RowNumbers) -> Keys:
    """The keys of some rows. O(the length of these)."""
    if not isinstance(keys, PackedKeys):
        return keys[rows]
    lengths = np.frombuffer(keys.lengths, np.uint8)
    chosen = lengths[rows].astype(np.intp)
    starts = np.cumsum(lengths, dtype=np.intp)[rows] - chosen
    offsets = np.arange(chosen.sum()) + np.repeat(starts - (np.cumsum(chosen) - chosen), chosen)
    return PackedKeys(lengths[rows], np.frombuffer(keys.data, np.uint8)[offsets])
