"""What a static algorithm did, as data: pass a list as `trace` and it is filled with these."""

from dataclasses import dataclass
from typing import Literal

from ..predicates import Point


@dataclass(frozen=True, slots=True)
class Turn:
    """One orientation evaluated: which way a, b, c turn."""

    a: Point
    b: Point
    c: Point
    sign: int


@dataclass(frozen=True, slots=True)
class Push:
    """A point put on top of the chain."""

    point: Point


@dataclass(frozen=True, slots=True)
class Pop:
    """A point taken off the chain."""

    point: Point


@dataclass(frozen=True, slots=True)
class Round:
    """One round of Chan's algorithm.

    Attributes:
        guess: the guessed number of vertices; groups have at most this many points.
        groups: how many groups.
        steps: vertices found by gift wrapping before the round closed or was thrown away.
        cost: the round's cost estimate, n log2(guess).
        closed: whether the hull closed within `guess` steps.
    """

    guess: int
    groups: int
    steps: int
    cost: float
    closed: bool


Event = Turn | Push | Pop | Round
Trace = list[Event]
Collinear = Literal["drop", "keep"]
