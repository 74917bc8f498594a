"""Batches as messages."""

from collections.abc import Sequence
from typing import Literal

import numpy.typing as npt

from dynhull.arrays import as_points
from dynhull_proto.v1 import batch_pb2, points_pb2

from ._messages import encode_points

Missing = Literal["raise", "count"]
BYTES_PER_POINT = 16


def encode_batch(
    insert: npt.ArrayLike | None,
    delete: npt.ArrayLike | None,
    move: tuple[npt.ArrayLike, npt.ArrayLike] | None,
    missing: Missing,
) -> batch_pb2.Batch:
    """Arrays as a batch; ValueError or TypeError names the argument and the first bad row."""
    if missing not in ("raise", "count"):
        raise ValueError(f'missing must be "raise" or "count", got {missing!r}')
    batch = batch_pb2.Batch()
    if missing == "count":
        batch.missing_points = batch_pb2.MISSING_POINT_POLICY_COUNT
    if insert is not None:
        batch.inserts.CopyFrom(encode_points(as_points(insert, "insert")))
    if delete is not None:
        batch.deletes.CopyFrom(encode_points(as_points(delete, "delete")))
    if move is not None:
        origins, destinations = as_points(move[0], "move[0]"), as_points(move[1], "move[1]")
        if len(origins) != len(destinations):
            raise ValueError(f"move has {len(origins)} origins and {len(destinations)} destinations")
        batch.moves.origins.CopyFrom(encode_points(origins))
        batch.moves.destinations.CopyFrom(encode_points(destinations))
    return batch


def batch_rows(batch: batch_pb2.Batch) -> int:
    """The number of rows of its arrays."""
    return sum(len(points.packed) for points in _parts(batch)) // BYTES_PER_POINT


def join_batches(batches: Sequence[batch_pb2.Batch]) -> batch_pb2.Batch:
    """One batch with the effect of all these, which have the same policy for missing points."""
    joined = batch_pb2.Batch(missing_points=batches[0].missing_points)
    for whole, *pieces in zip(_parts(joined), *map(_parts, batches), strict=True):
        packed = b"".join(piece.packed for piece in pieces)
        if packed:
            whole.packed = packed
    return joined


def _parts(batch: batch_pb2.Batch) -> tuple[points_pb2.Points, ...]:
    return batch.inserts, batch.deletes, batch.moves.origins, batch.moves.destinations
