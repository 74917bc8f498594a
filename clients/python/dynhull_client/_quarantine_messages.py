"""The quarantine of a keyed hull: its rules, and the positions that it holds out."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from dynhull_proto.v1 import hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._accuracies import decode_accuracies
from ._keys import decode_names
from ._times import decode_times


@dataclass(frozen=True, slots=True)
class Quarantine:
    """The rules by which a keyed hull holds positions out, so that one bad position does not spoil it.

    Each position of a batch is judged alone, by the hull before the batch. One that breaks a rule waits in quarantine:
    neither the hull nor its watches and fences see it, until later positions of its key confirm it, one that breaks no
    rule contradicts it, or `release` and `drop` decide.

    Attributes:
        max_speed: the greatest speed of a key, in units of the coordinates a second, or in metres a second in a
            geographic hull; None for no such rule.
        max_growth: the factor, at least 1, by which one position may enlarge the area of the hull; None for no such
            rule.
        confirmations: the number of later positions in succession, each consistent with the one before, that let a key
            in: 0 to 1000, 0 for none: only by request.
    """

    max_speed: float | None = None
    max_growth: float | None = None
    confirmations: int = 1


@dataclass(frozen=True, slots=True)
class HeldPosition:
    """A position in quarantine.

    Attributes:
        key: its key.
        position: x and y, or longitude and latitude.
        time: its time; 1970-01-01 for a position without one, None if no position of the page has one.
        speed: the speed since the position that was let in, infinite for a move in no time; None if it is not too fast.
        growth: the factor by which it would enlarge the area of the hull; None if that is not too much.
        revision: the revision that has held it.
        confirmations: how often it has been confirmed so far.
        accuracy: how far it may be from where its key really is.
    """

    key: str | int
    position: tuple[float, float]
    time: datetime | None
    speed: float | None
    growth: float | None
    revision: int
    confirmations: int
    accuracy: float = 0.0

    @property
    def breaks(self) -> tuple[str, ...]:
        """The rules that it breaks: "max_speed", "max_growth" or both."""
        broken = {"max_speed": self.speed, "max_growth": self.growth}
        return tuple(rule for rule, value in broken.items() if value is not None)


def encode_quarantine(rules: Quarantine) -> hull_pb2.Quarantine:
    """The rules in the form of a message."""
    if not isinstance(rules, Quarantine):
        raise TypeError(f"quarantine is {rules!r}: must be a Quarantine")
    return hull_pb2.Quarantine(
        max_speed=rules.max_speed, max_growth=rules.max_growth, confirmations=rules.confirmations
    )


def decode_quarantine(message: hull_pb2.Quarantine) -> Quarantine:
    """The rules as received."""
    return Quarantine(
        message.max_speed if message.HasField("max_speed") else None,
        message.max_growth if message.HasField("max_growth") else None,
        message.confirmations if message.HasField("confirmations") else 1,
    )


def decode_held(message: pb.ListHeldResponse) -> list[HeldPosition]:
    """A page of the positions in quarantine."""
    keys = decode_names(message.keys)
    positions = np.frombuffer(message.positions.packed, "<f8").reshape(-1, 2).tolist()
    times: list[datetime | None] = [None] * len(keys)
    if message.HasField("times"):
        times = [each.replace(tzinfo=UTC) for each in decode_times(message.times).tolist()]
    accuracies = decode_accuracies(message)
    columns = zip(
        keys,
        positions,
        times,
        message.speeds,
        message.growths,
        message.revisions,
        message.confirmations,
        [0.0] * len(keys) if accuracies is None else accuracies.tolist(),
        strict=True,
    )
    return [
        HeldPosition(key, (x, y), time, _broken(speed), _broken(growth), revision, confirmed, accuracy)
        for key, (x, y), time, speed, growth, revision, confirmed, accuracy in columns
    ]


def _broken(value: float) -> float | None:
    """What breaks a rule; None for NaN."""
    return None if math.isnan(value) else value
