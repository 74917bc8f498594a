"""The short way for the messages of Stream that come most often: points to insert or to delete, and nothing else.

Such a message is read, and the response to it written, as bytes: as messages they take as long as all else that is done
for a single point.
"""

from collections.abc import Callable
from typing import Any

from dynhull.arrays import Points, packed_points
from dynhull_proto.v1 import hull_service_pb2 as pb

from ..compiled import native
from ..state.batch import NO_POINTS, Applied, Batch
from .calls import Received
from .encode import encode_applied

# Larger messages are decoded in another thread.
MOST_BYTES = 2**18


class PointsMessage:
    """A message with points to insert or to delete.

    Attributes:
        name: the name that it has of the hull; empty if it has none.
        batch: the batch.
    """

    __slots__ = ("_data", "batch", "name")

    def __init__(self, data: bytes, name: bytes, batch: Batch) -> None:
        self._data = data
        self.name = name
        self.batch = batch

    def whole(self) -> Any:
        """The message."""
        return pb.StreamRequest.FromString(self._data)


def received(whole: Callable[[bytes], Received]) -> Callable[[bytes], Received]:
    """A deserializer of StreamRequest which reads what is short itself, and leaves the others to `whole`."""
    if native is None:
        return whole
    points_message = native.points_message

    def deserialize(data: bytes) -> Received:
        if len(data) <= MOST_BYTES:
            found = points_message(data)
            if found is not None:
                name, inserts, start = found
                xy: Points | None = packed_points(data[start:])
                if xy is not None:  # all coordinates are finite
                    batch = Batch(xy, NO_POINTS, 0, False) if inserts else Batch(NO_POINTS, xy, 0, False)
                    return PointsMessage(data, name, batch), len(data)
        return whole(data)

    return deserialize


def acknowledgement(sequence: int, applied: Applied) -> bytes:
    """The response to a batch, serialized."""
    if native is not None and applied.plain and not applied.duplicate:
        return native.acknowledged(
            sequence,
            applied.revision,
            applied.inserted,
            applied.deleted,
            applied.missing,
            applied.hull_changed,
            applied.points,
        )
    response = pb.StreamResponse(sequence=sequence)
    encode_applied(applied, response.result)
    data: bytes = response.SerializeToString()
    return data
