"""Batches as messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from google.protobuf.message import Message

from dynhull.arrays import as_points
from dynhull.keys import take_keys
from dynhull_proto.v1 import batch_pb2, points_pb2

from ._accuracies import DOUBLE, as_accuracies
from ._keys import checked_keys, decode_keys, encode_keys, plain_keys
from ._times import encode_duration, encode_times

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import timedelta

    import numpy.typing as npt

Missing = Literal["raise", "count"]
"""The treatment of a point to delete, or of a key to remove, that the hull does not hold."""

Only = Literal["absent", "present"]
"""The keys to put: only new ones, or only known ones."""

CONDITIONS = {
    None: batch_pb2.PUT_CONDITION_UNSPECIFIED,
    "absent": batch_pb2.PUT_CONDITION_IF_ABSENT,
    "present": batch_pb2.PUT_CONDITION_IF_PRESENT,
}
BYTES_PER_POINT = 16
BYTES_PER_TIME = 8


class Batch:
    """Changes that are applied to a hull together, for `HullClient.transfer`: all of them or none, as one revision.

    Args:
        keys: n keys to put, as for `HullClient.put`,
        points: (n, 2) their positions,
        times: and their event times or, with `insert`, those of the points.
        remove: keys to remove.
        insert: (n, 2) points to insert, in a hull without keys.
        delete: (n, 2) points to delete.
        move: origins and destinations, (n, 2) each.
        only: as for `HullClient.put`.
        ttl: as for `HullClient.put`.
        expire_times: as for `HullClient.put`.
        accuracies: as for `HullClient.put`.
        release: keys in quarantine to let in. Without keys to put and to remove, as `drop`.
        drop: keys in quarantine whose held position is dropped.
        missing: for a key to remove or a point to delete that the hull does not hold, "raise" refuses the batch and
            "count" skips the row and counts it. By default "count" for keys and "raise" for points.

    Raises:
        ValueError, TypeError: an argument has a bad value. The message names the argument and the first bad row.
    """

    def __init__(
        self,
        *,
        keys: Any = None,
        points: npt.ArrayLike | None = None,
        times: Any = None,
        remove: Any = None,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        only: Only | None = None,
        ttl: float | timedelta | str | None = None,
        expire_times: Any = None,
        accuracies: Any = None,
        release: Any = None,
        drop: Any = None,
        missing: Missing | None = None,
    ) -> None:
        self._message = batch_pb2.Batch()
        self._rows = 0
        if missing is not None:
            self._set_policy(missing)
        if (keys is None) != (points is None):
            raise ValueError("keys and points are given together: the position of each key")
        if not (keys is None and remove is None and release is None and drop is None) and not (
            insert is None and delete is None and move is None
        ):
            raise ValueError("a batch either puts and removes keys, or inserts, deletes and moves points")
        if insert is not None:
            inserted = as_points(insert, "insert", on_globe=None)
            self._fill(self._message.inserts, inserted)
            if times is not None:
                self._message.insert_times.CopyFrom(encode_times(times, len(inserted), "times"))
        elif points is not None:
            self._put(keys, as_points(points, "points", on_globe=None), times)
        elif times is not None:
            raise ValueError("times are given with the points to put or to insert")
        if delete is not None:
            self._fill(self._message.deletes, as_points(delete, "delete", on_globe=None))
        if move is not None:
            self._move(
                as_points(move[0], "move[0]", on_globe=None),
                as_points(move[1], "move[1]", on_globe=None),
            )
        for argument, named in (("remove", remove), ("release", release), ("drop", drop)):
            if named is not None:
                checked = checked_keys(named, argument)
                getattr(self._message, f"{argument}s").CopyFrom(encode_keys(checked))
                self._rows += len(checked)
        if not (only is None and ttl is None and expire_times is None):
            self._set_conditions(only, ttl, expire_times)
        if accuracies is not None:
            self._set_accuracies(accuracies)

    @property
    def message(self) -> batch_pb2.Batch:
        """The batch as a protobuf message."""
        return self._message

    @property
    def rows(self) -> int:
        """The number of rows of its arrays."""
        return self._rows

    def __repr__(self) -> str:
        return f"<Batch of {self._rows} rows>"

    def _fill(self, message: points_pb2.Points, xy: npt.NDArray[Any]) -> None:
        message.packed = np.asarray(xy, DOUBLE).tobytes()
        self._rows += len(xy)

    def _set_policy(self, missing: Missing) -> None:
        if missing not in ("raise", "count"):
            raise ValueError(f'missing must be "raise" or "count", got {missing!r}')
        if missing == "count":
            self._message.missing_points = batch_pb2.MISSING_POINT_POLICY_COUNT
        if missing == "raise":
            self._message.missing_keys = batch_pb2.MISSING_KEY_POLICY_REFUSE

    def _put(self, keys: Any, positions: npt.NDArray[Any], times: Any) -> None:
        checked = checked_keys(keys)
        if len(checked) != len(positions):
            raise ValueError(f"there are {len(checked)} keys and {len(positions)} points")
        self._message.puts.keys.CopyFrom(encode_keys(checked))
        self._fill(self._message.puts.points, positions)
        if times is not None:
            self._message.puts.times.CopyFrom(encode_times(times, len(checked), "times"))

    def _move(self, origins: npt.NDArray[Any], destinations: npt.NDArray[Any]) -> None:
        if len(origins) != len(destinations):
            raise ValueError(f"move has {len(origins)} origins and {len(destinations)} destinations")
        self._fill(self._message.moves.origins, origins)
        self._fill(self._message.moves.destinations, destinations)

    def _set_conditions(self, only: Only | None, ttl: float | timedelta | str | None, expire_times: Any) -> None:
        if not self._message.HasField("puts"):
            raise ValueError("only, ttl and expire_times are given with keys to put")
        if only not in CONDITIONS:
            raise ValueError(f'only must be "absent" or "present", got {only!r}')
        if ttl is not None and expire_times is not None:
            raise ValueError("give either ttl or expire_times, not both")
        puts = self._message.puts
        puts.condition = CONDITIONS[only]
        if ttl is not None:
            puts.ttl.CopyFrom(encode_duration(ttl, "ttl"))
        if expire_times is not None:
            rows = len(puts.points.packed) // BYTES_PER_POINT
            puts.expire_times.CopyFrom(encode_times(expire_times, rows, "expire_times"))

    def _set_accuracies(self, accuracies: Any) -> None:
        if not self._message.HasField("puts"):
            raise ValueError("accuracies are given with keys to put")
        rows = len(self._message.puts.points.packed) // BYTES_PER_POINT
        found = as_accuracies(accuracies, rows)
        if len(found):
            self._message.puts.accuracies.packed = np.asarray(found, DOUBLE).tobytes()


def join_batches(batches: Sequence[batch_pb2.Batch]) -> batch_pb2.Batch:
    """One batch with the effect of all these, which have the same policies.

    Either all rows that are put or inserted have a time, or none has.
    """
    if len(batches) == 1:
        return batches[0]
    joined = batch_pb2.Batch()
    _concatenate(joined, batches)
    return joined


def keep_last_rows(batch: batch_pb2.Batch) -> None:
    """Keep the last row of each key that is put."""
    keys = decode_keys(batch.puts.keys)
    rows = np.array(sorted({key: row for row, key in enumerate(plain_keys(keys))}.values()), np.intp)
    if len(rows) == len(keys):
        return
    kept = encode_keys(take_keys(keys, rows))
    puts = batch.puts
    columns: tuple[tuple[Any, int], ...] = (
        (puts.points, BYTES_PER_POINT),
        (puts.times, BYTES_PER_TIME),
        (puts.expire_times, BYTES_PER_TIME),
    )
    if puts.HasField("accuracies"):
        columns += ((puts.accuracies, BYTES_PER_TIME),)
    taken = [np.frombuffer(each.packed, f"V{width}")[rows].tobytes() if each.packed else b"" for each, width in columns]
    puts.keys.CopyFrom(kept)  # only now: there may be no memory for a column
    for (each, _), packed in zip(columns, taken, strict=True):
        each.packed = packed


def _concatenate(whole: Message, pieces: Sequence[Message]) -> None:
    """Set the bytes in a message and its parts to those of all the pieces, one after the other.

    Anything else is the same in all pieces that have it.
    """
    parts: dict[str, list[Any]] = {}
    for piece in pieces:
        for field, value in piece.ListFields():
            parts.setdefault(field.name, []).append(value)
    for name, values in parts.items():
        if isinstance(values[0], bytes):
            setattr(whole, name, b"".join(values))
        elif isinstance(values[0], Message):
            part = getattr(whole, name)
            part.SetInParent()  # though nothing may be in it
            _concatenate(part, values)
        else:
            setattr(whole, name, values[0])
