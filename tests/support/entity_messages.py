"""Messages of keyed hulls, written briefly."""

from collections.abc import Sequence

from google.protobuf.duration_pb2 import Duration

from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2

STRINGS, INTEGERS = hull_pb2.IDENTITY_STRING_KEYS, hull_pb2.IDENTITY_INTEGER_KEYS
COORDINATES = points_pb2.POINT_ENCODING_COORDINATES
SECOND = 1_000_000  # in the unit of times


def points(*xy: float) -> points_pb2.Points:
    return points_pb2.Points(coordinates=xy)


def keys(*names: str | int) -> points_pb2.Keys:
    """Strings or integers, as a list."""
    if names and isinstance(names[0], int):
        return points_pb2.Keys(integers=names)
    return points_pb2.Keys(strings=names)


def times(*microseconds: int) -> points_pb2.Times:
    return points_pb2.Times(packed=b"".join(each.to_bytes(8, "little", signed=True) for each in microseconds))


def puts(places: dict[str, tuple[float, float]], at: Sequence[int] = (), **parts: object) -> batch_pb2.Batch:
    """A batch that puts keys at places, with event times if there are any; `parts` are those of Puts."""
    coordinates = [each for place in places.values() for each in place]
    if at:
        parts["times"] = times(*at)
    return batch_pb2.Batch(puts=batch_pb2.Puts(keys=keys(*places), points=points(*coordinates), **parts))


def window(seconds: float = 0, **parts: object) -> hull_pb2.Window:
    """A window with a limit on the age."""
    if seconds:
        parts["max_age"] = duration(seconds)
    return hull_pb2.Window(**parts)


def duration(seconds: float) -> Duration:
    message = Duration()
    message.FromMicroseconds(round(seconds * SECOND))
    return message
