"""The past of a hull, and its messages."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from dynhull_proto.v1 import hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._times import as_timedelta, decode_time


@dataclass(frozen=True, slots=True)
class Erasure:
    """Keys were erased from the past of a hull. Which ones is kept nowhere.

    Attributes:
        time: when.
        first_revision, last_revision: as of these revisions, and those between, the hull may lack keys that it had.
        keys: the number of keys that were named.
        moves: how often batches had put, removed or held one of them.
    """

    time: datetime
    first_revision: int
    last_revision: int
    keys: int
    moves: int


@dataclass(frozen=True, slots=True)
class History:
    """What is there of the past of a hull.

    Attributes:
        first_revision: the oldest revision that can be read; of a hull over shards the newest one.
        first_time: the time of its commit; None where an early version of the server did not store it.
        last_revision: the newest revision.
        last_time: the time of its commit; None as before.
        bytes: the size of the files of its segments. What is newer than these is in the journal of the server.
        batches: the number of batches in them.
        moves: the number of points and keys that these batches write.
        history: for how long the past is kept; True for ever, None for not at all.
        history_bytes: in how many bytes it is kept at most; None for any number.
        erasures: what was erased from it, the oldest first.
    """

    first_revision: int
    first_time: datetime | None
    last_revision: int
    last_time: datetime | None
    bytes: int
    batches: int
    moves: int
    history: timedelta | bool | None = None
    history_bytes: int | None = None
    erasures: tuple[Erasure, ...] = ()


def encode_history(history: Any, history_bytes: int | None) -> hull_pb2.History | None:
    """How much is kept in the form of a message; None for nothing.

    Raises:
        ValueError, TypeError: it is no time span, or no number of bytes.
    """
    if history is None or history is False:
        if history_bytes is not None:
            raise ValueError("history_bytes is given with history")
        return None
    if history_bytes is not None and (isinstance(history_bytes, bool) or not isinstance(history_bytes, int)):
        raise TypeError(f"history_bytes is {history_bytes!r}, not a whole number")
    if history_bytes is not None and not 1 <= history_bytes < 2**63:
        raise ValueError(f"history_bytes is {history_bytes}, but must be from 1 to 2**63 - 1")
    message = hull_pb2.History(max_bytes=history_bytes or 0)
    if history is not True:
        span = as_timedelta(history, "history")
        if span <= timedelta():
            raise ValueError(f"history is {history!r}, but must be more than 0")
        message.max_age.FromTimedelta(span)
    return message


def decode_history(response: pb.GetHistoryResponse) -> History:
    """What there is as received."""
    kept = response.history
    age: timedelta | bool | None = None
    if response.HasField("history"):
        age = kept.max_age.ToTimedelta() if kept.HasField("max_age") else True
    return History(
        response.first_revision,
        decode_time(response.first_time) if response.HasField("first_time") else None,
        response.last_revision,
        decode_time(response.last_time) if response.HasField("last_time") else None,
        response.bytes,
        response.batches,
        response.moves,
        age,
        kept.max_bytes or None,
        tuple(map(_erasure, response.erasures)),
    )


def decode_erasure(response: pb.EraseHistoryResponse) -> Erasure | None:
    """What has been erased as received; None for nothing."""
    return _erasure(response.erasure) if response.HasField("erasure") else None


def _erasure(message: hull_pb2.Erasure) -> Erasure:
    revisions = message.first_revision, message.last_revision
    return Erasure(decode_time(message.time), *revisions, message.keys, message.moves)
