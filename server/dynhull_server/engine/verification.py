"""The live hull against Chan's algorithm."""

from dataclasses import dataclass

from dynhull.arrays import Points
from dynhull.static import chan
from dynhull.static.trace import Round, Rounds


@dataclass(frozen=True, slots=True)
class Difference:
    """The first place where two lists of vertices differ; (0, 2) where a list has ended."""

    index: int
    live: Points
    recomputed: Points


@dataclass(frozen=True, slots=True)
class Verification:
    """What Chan's algorithm made of the points; no `difference` where the live hull has the same vertices."""

    points: int
    vertices: int
    rounds: list[Round]
    difference: Difference | None


def verify(points: Points, vertices: Points) -> Verification:
    """Compare `vertices`, a live hull's, with the hull of `points` computed anew."""
    trace = Rounds()
    recomputed = chan(points, trace=trace)
    rounds = [event for event in trace if isinstance(event, Round)]
    return Verification(len(points), len(vertices), rounds, first_difference(vertices, recomputed))


def first_difference(live: Points, recomputed: Points) -> Difference | None:
    """The first row in which two lists of vertices differ, None where they are the same."""
    for i in range(max(len(live), len(recomputed))):
        if live[i : i + 1].tolist() != recomputed[i : i + 1].tolist():
            return Difference(i, live[i : i + 1], recomputed[i : i + 1])
    return None
