"""One side of a hull: the pass of the monotone chain algorithm, which the tree also makes in its leaves."""

from collections.abc import Sequence

from .._predicates import Point, orientation


def half_chain(points: Sequence[Point], sign: int) -> list[Point]:
    """The strict upper (sign +1) or lower (sign -1) chain of distinct points in lexicographic order. O(n)."""
    chain: list[Point] = []
    for p in points:
        while len(chain) > 1 and sign * orientation(chain[-2], chain[-1], p) >= 0:
            chain.pop()
        chain.append(p)
    return chain
