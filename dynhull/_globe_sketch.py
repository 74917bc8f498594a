"""A few vertices of a hull on the globe that show its shape."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

import numpy as np

from ._ellipsoid import GREATEST_RADIUS, unit_vectors

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._predicates import Floats
    from .arrays import Points

# Radians: far above the errors of vectors and of projections, and less than a micrometre.
SLACK = 1e-14


def sketch(vertices: Points, most: int) -> tuple[Points, float]:
    """At most that many of (h, 2) vertices, at least 1, and the metres by which the hull reaches beyond them, at most.

    Begins with the first vertex, and adds the one farthest from what there is. What lies beyond an edge of a convex
    set, and in a convex set with the same corners, is nearest to that edge. O(h) an edge in the worst case, as a rule
    O(h log most).
    """
    if len(vertices) <= most:
        return vertices, 0.0
    places = unit_vectors(vertices)
    chosen = [0]
    beyond: list[tuple[float, int, int, int]] = []  # how far, from which row to which other one, and the farthest

    def consider(start: int, end: int) -> None:
        if end - start > 1:
            chain = places[np.arange(start, end + 1) % len(places)]
            farthest, angle = _reach(chain)
            heappush(beyond, (-angle, start, end, start + farthest))

    consider(0, len(vertices))
    while len(chosen) < most:
        _, start, end, farthest = heappop(beyond)
        chosen.append(farthest)
        consider(start, farthest)
        consider(farthest, end)
    return vertices[sorted(chosen)], GREATEST_RADIUS * (SLACK - beyond[0][0])


def _reach(chain: Floats) -> tuple[int, float]:
    """Of (k, 3) places on the boundary, the row farthest from the arc between their ends, and the angle they reach.

    The distance may be greatest between two of them: where an edge passes over the arc, or the antipode of an end.
    """
    start, end = chain[0], chain[-1]
    distances = _distances(chain[1:-1], start, end)
    farthest = float(distances.max())
    normal = np.cross(start, end - start)
    for pole in (normal, -normal, -start, -end):
        peaks = _peaks(chain, pole)
        farthest = max(farthest, float(_distances(peaks, start, end).max(initial=0.0)))
    return 1 + int(distances.argmax()), farthest


def _peaks(chain: Floats, pole: Floats) -> Floats:
    """The places inside of the edges of a chain that are nearer to a pole than others of their edge."""
    start, end = chain[:-1], chain[1:]
    across = np.cross(start, end - start)
    peaks = np.cross(across, np.cross(pole, across))
    with np.errstate(invalid="ignore", divide="ignore"):
        peaks /= np.linalg.norm(peaks, axis=1)[:, None]
    after, before = ((np.cross(*pair) * across).sum(axis=1) > 0 for pair in ((start, peaks), (peaks, end)))
    inside: Floats = peaks[after & before]
    return inside


def _distances(places: Floats, start: Floats, end: Floats) -> Floats:
    """(k,) angles between places and an arc."""
    at_ends = np.minimum(_angles(places, start), _angles(places, end))
    normal = np.cross(start, end - start)
    length = float(np.linalg.norm(normal))
    if length == 0:
        return at_ends
    beside: npt.NDArray[np.bool_] = (places @ np.cross(normal, start) > 0) & (places @ np.cross(end, normal) > 0)
    heights = np.arcsin(np.clip(np.abs((places - start) @ normal) / length, 0, 1))
    distances: Floats = np.where(beside, heights, at_ends)
    return distances


def _angles(places: Floats, place: Floats) -> Floats:
    """Angles from their chords."""
    angles: Floats = 2 * np.arcsin(np.clip(np.linalg.norm(places - place, axis=1) / 2, 0, 1))
    return angles
