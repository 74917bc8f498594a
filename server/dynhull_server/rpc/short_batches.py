"""The short way for the messages of Stream that come most often: points to insert or to delete, or keys to put.

Such a message is read, and the response to it written, as bytes: as messages they take as long as all else that is done
for a single point.
"""

from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from dynhull.arrays import Points, packed_points
from dynhull.keys import PackedKeys
from dynhull_proto.v1 import hull_service_pb2 as pb

from ..compiled import native
from ..state.batch import NO_POINTS, Applied, Batch, KeyedBatch
from .calls import Received
from .decode_batch import NO_INTEGERS, NO_STRINGS, UNSIGNED
from .encode import encode_applied

# What the result of a batch has, in the order of the fields of a message; then what only few results have.
FIELDS = attrgetter(
    "revision",
    "inserted",
    "deleted",
    "missing",
    "hull_changed",
    "points",
    "duplicate",
    "moved",
    "stale",
    "late",
    "skipped",
    "clamped",
    "evicted",
    "released",
    "dropped",
    "clock",
    "held",
)
# Larger messages are decoded in another thread.
MOST_BYTES = 2**18


@dataclass(slots=True)
class PointsMessage(Batch):
    """A message with points to insert or to delete, which is the batch itself: for speed.

    Attributes:
        name: the name that it has of the hull; empty if it has none.
        data: its bytes.
    """

    name: bytes = b""
    data: bytes = b""

    def whole(self) -> Any:
        """The message."""
        return pb.StreamRequest.FromString(self.data)


class PutsMessage:
    """A message with batches that put keys.

    Attributes:
        name: the name that it has of the hull; empty if it has none.
        several: whether it may have several batches.
        batches: their numbers, 0 where they have none, and the batches.
    """

    __slots__ = ("_data", "batches", "name", "several")

    def __init__(self, data: bytes, name: bytes, several: bool, batches: list[tuple[int, KeyedBatch]]) -> None:
        self._data = data
        self.name = name
        self.several = several
        self.batches = batches

    def whole(self) -> Any:
        """The message."""
        return pb.StreamRequest.FromString(self._data)


def received(whole: Callable[[bytes], Received]) -> Callable[[bytes], Received]:
    """A deserializer of StreamRequest which reads what is short itself, and leaves the others to `whole`."""
    if native is None:
        return whole
    points_message, puts_message = native.points_message, native.puts_message

    def deserialize(data: bytes) -> Received:
        if len(data) <= MOST_BYTES:
            found = points_message(data)
            if found is not None:
                name, inserts, start = found
                xy: Points | None = packed_points(data[start:])
                if xy is not None:  # all coordinates are finite
                    rows = (xy, NO_POINTS) if inserts else (NO_POINTS, xy)
                    return PointsMessage(*rows, 0, False, None, name, data), len(data)
            elif (puts := puts_message(data)) is not None:
                name, several, columns = puts
                batches = _keyed(columns)
                if batches is not None:
                    return PutsMessage(data, name, several, batches), len(data)
        return whole(data)

    return deserialize


def _keyed(rows: list[tuple[int, bytes | None, bytes, bytes, bytes]]) -> list[tuple[int, KeyedBatch]] | None:
    """The batches of a message; None if a coordinate is not finite, or a string no key."""
    batches = []
    for sequence, integers, lengths, text, points in rows:
        xy = packed_points(points)
        if xy is None:
            return None
        if integers is not None:
            numbers = np.frombuffer(integers, UNSIGNED).astype(np.uint64, copy=False)
            batch = KeyedBatch("int", numbers, xy, NO_INTEGERS)
        else:
            try:
                batch = KeyedBatch("str", PackedKeys(lengths, text), xy, NO_STRINGS)
            except ValueError:
                return None
        batches.append((sequence, batch))
    return batches


def acknowledgement(sequence: int, applied: Applied) -> bytes:
    """The response to a batch, serialized."""
    data = None if native is None else native.acknowledged(sequence, FIELDS(applied))
    if data is None:
        response = pb.StreamResponse(sequence=sequence)
        encode_applied(applied, response.result)
        data = response.SerializeToString()
    return data


def acknowledgements(outcomes: list[tuple[int, Applied]], most_bytes: int) -> pb.StreamResponse | bytes:
    """The response to several batches, perhaps serialized: then it has at most so many bytes."""
    if native is not None:
        data = native.results([(sequence, FIELDS(applied)) for sequence, applied in outcomes])
        if data is not None and len(data) <= most_bytes:
            return data
    response = pb.StreamResponse()
    for sequence, applied in outcomes:
        encode_applied(applied, response.results.add(sequence=sequence).result)
    return response
