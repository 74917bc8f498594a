"""The events of a static algorithm, which appends them to the list given as `trace`."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from .._predicates import Point


@dataclass(frozen=True, slots=True)
class Scan:
    """A pass over the points begins, with an empty chain.

    Attributes:
        name: what the pass finds: "hull", "lower chain" or "upper chain".
        points: all points of the pass in the order in which it takes them.
    """

    name: str
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Turn:
    """One orientation evaluated: which way a, b, c turn."""

    a: Point
    b: Point
    c: Point
    sign: int

    @property
    def cross(self) -> Fraction:
        """The cross product (b - a) x (c - a), twice the triangle's signed area, without rounding."""
        (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in (self.a, self.b, self.c))
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@dataclass(frozen=True, slots=True)
class Push:
    """A point put on top of the chain."""

    point: Point


@dataclass(frozen=True, slots=True)
class Pop:
    """A point taken off the chain."""

    point: Point


@dataclass(frozen=True, slots=True)
class Groups:
    """A round of Chan's algorithm begins, with an empty chain.

    Attributes:
        guess: the guessed number of vertices; groups have at most this many points.
        hulls: the vertices of each group's hull, counter-clockwise from the lexicographically smallest.
    """

    guess: int
    hulls: tuple[tuple[Point, ...], ...]


@dataclass(frozen=True, slots=True)
class Wrap:
    """One step of Chan's gift wrapping.

    Attributes:
        vertex: the hull's vertex to go on from.
        tangents: for each group, the point where its tangent from the vertex touches it.
        best: the tangent point with all others to the left, the next vertex.
    """

    vertex: Point
    tangents: tuple[Point, ...]
    best: Point


@dataclass(frozen=True, slots=True)
class Round:
    """The end of a round of Chan's algorithm.

    Attributes:
        guess: the guessed number of vertices; groups have at most this many points.
        groups: the number of groups.
        steps: vertices found by gift wrapping before the round closed or was discarded.
        cost: the round's cost estimate, n log2(guess).
        closed: whether the hull closed within `guess` steps.
    """

    guess: int
    groups: int
    steps: int
    cost: float
    closed: bool


Event = Scan | Turn | Push | Pop | Groups | Wrap | Round
Trace = list[Event]
Collinear = Literal["drop", "keep"]


class Rounds(Trace):
    """A trace for `chan` that records each `Round` but no single steps: as fast as no trace."""
