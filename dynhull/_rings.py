"""Polygons as callers give them: rings of corners, checked exactly before they are used."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ._exact import exact
from ._implementation import kernel
from ._predicates import Point, orient2d
from .arrays import as_points, as_tuples, repr_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from fractions import Fraction

    import numpy.typing as npt

    from ._exact import Exact
    from .arrays import Points

    Heights = npt.NDArray[np.float64]
    Signs = npt.NDArray[np.int8]
    Rows = npt.NDArray[np.intp]

CORNERS_OF_A_RING = 3  # at least
PAIRS_AT_A_TIME = 1 << 18  # of edges, or of points and edges: bounds the memory of a check
POINTS_AT_A_TIME = 1 << 10


class _Edges(NamedTuple):
    """The edges of all rings of a polygon: ends, ring, number in the ring, and the ring's number of edges."""

    a: Points
    b: Points
    ring: Rows
    number: Rows
    size: Rows


class CheckedPolygons:
    """Polygons with holes that have been checked: what takes polygons takes these without another look.

    Args:
        polygons: polygons, each a sequence of rings, the exterior first, then holes; each ring (k, 2) array-like.

    Attributes:
        rings: the rings of each polygon, which cannot be changed.

    Raises:
        ValueError, TypeError: as `FenceIndex.set_polygons`.
    """

    __slots__ = ("rings",)

    rings: list[list[Points]]

    def __init__(self, polygons: Any) -> None:
        self.rings = [[ring.copy() for ring in polygon] for polygon in as_polygons(polygons)]
        for polygon in self.rings:
            for ring in polygon:
                ring.setflags(write=False)


def as_polygons(polygons: Any) -> list[list[Points]]:
    """Polygons as lists of rings, exterior first: (k, 2) arrays without repeated corners, the closing one included.

    Args:
        polygons: polygons, each a sequence of rings, each a (k, 2) array-like of corners in either direction; or
            `CheckedPolygons`.

    Raises:
        ValueError: there is no polygon, or a ring is not valid. The message names polygon, ring and reason.
        TypeError: an argument is not a sequence, or a coordinate is not a number.

    O(k log k) for k corners of valid polygons, by the kernel. Without it, and to say what is wrong with others, the
    same if few edges overlap in x or few in y, at worst O(k²).
    """
    if isinstance(polygons, CheckedPolygons):
        return polygons.rings
    checked = [
        _as_polygon(polygon, f"polygon {number}") for number, polygon in enumerate(_sequence(polygons, "polygons"))
    ]
    if not checked:
        raise ValueError("polygons must hold at least one polygon, got none")
    return checked


def _sequence(values: Any, name: str) -> Iterable[Any]:
    if isinstance(values, str | bytes | dict) or not isinstance(values, Iterable):
        raise TypeError(f"{name} must be a sequence, got {repr_of(values)}")
    return values


def _as_polygon(polygon: Any, name: str) -> list[Points]:
    given = list(_sequence(polygon, name))
    if kernel is not None and given:
        given = [as_points(ring, f"{name} ring {number}") for number, ring in enumerate(given)]
        opened = [_without_closing_corner(ring) for ring in given]
        turnings = kernel.turnings_if_valid(opened)
        if turnings:
            return [
                ring if (turning > 0) == (number == 0) else np.ascontiguousarray(ring[::-1])
                for number, (ring, turning) in enumerate(zip(opened, turnings, strict=True))
            ]
    rings = [_as_ring(ring, f"{name} ring {number}") for number, ring in enumerate(given)]
    if not rings:
        raise ValueError(f"{name} has no ring: the first one is its exterior")
    _refuse_meeting_edges(rings, name)
    rings = [_turned(ring, left=number == 0) for number, ring in enumerate(rings)]
    if len(rings) > 1:
        _refuse_holes(rings, name)
    return rings


def _without_closing_corner(ring: Points) -> Points:
    return ring[1:] if len(ring) > CORNERS_OF_A_RING and tuple(ring[0]) == tuple(ring[-1]) else ring


def _as_ring(ring: Any, name: str) -> Points:
    given = as_points(ring, name)
    distinct = len(set(as_tuples(given)))
    if distinct < CORNERS_OF_A_RING:
        raise ValueError(f"{name} has {distinct} distinct corners: a ring needs at least {CORNERS_OF_A_RING}")
    corners: Points = np.ascontiguousarray(given[(given != np.roll(given, 1, axis=0)).any(axis=1)])
    if not np.any(orient2d(corners[0], corners[1], corners)):
        raise ValueError(f"{name} has no area: all of its corners are on one line")
    return corners


def _turned(ring: Points, left: bool) -> Points:
    """A simple ring in the direction in which its inside is on the left, or on the right."""
    least = int(np.lexsort(ring.T[::-1])[0])
    before, at, after = (ring[(least + step) % len(ring)] for step in (-1, 0, 1))
    turns_left = orient2d(before, at, after) == 1  # never 0, as the edges do not overlap
    return ring if turns_left == left else np.ascontiguousarray(ring[::-1])


# Edges that meet


def _refuse_meeting_edges(rings: list[Points], name: str) -> None:
    edges = _edges_of(rings)
    low, high = np.minimum(edges.a, edges.b), np.maximum(edges.a, edges.b)
    for i, j in _near_pairs(low, high):
        a, b, c, d = edges.a[i], edges.b[i], edges.a[j], edges.b[j]
        signs = [np.asarray(orient2d(*corners)) for corners in ((a, b, c), (a, b, d), (c, d, a), (c, d, b))]
        across = (signs[0] * signs[1] <= 0) & (signs[2] * signs[3] <= 0)
        proper = (signs[0] * signs[1] < 0) & (signs[2] * signs[3] < 0)
        collinear = ~np.any(signs, axis=0)
        longer = (np.minimum(np.maximum(a, b), np.maximum(c, d)) > np.maximum(np.minimum(a, b), np.minimum(c, d))).any(
            axis=1
        )
        overlap = collinear & longer
        step = np.abs(edges.number[i] - edges.number[j])
        same = edges.ring[i] == edges.ring[j]
        adjacent = same & ((step == 1) | (step == edges.size[i] - 1))
        for what, bad in (("overlap", overlap), ("cross", proper), ("touch", across & same & ~adjacent)):
            rows = np.flatnonzero(bad)
            if rows.size:
                first, second = min(
                    (min(pair), max(pair)) for pair in zip(i[rows].tolist(), j[rows].tolist(), strict=True)
                )
                raise ValueError(f"{name} {_pair(edges, first, second)} {what}")


def _pair(edges: _Edges, i: int, j: int) -> str:
    ring, other, first, second = (int(of[e]) for of in (edges.ring, edges.number) for e in (i, j))
    return f"{f'ring {ring}' if ring == other else f'rings {ring} and {other}'}: edges {first} and {second}"


def _edges_of(rings: list[Points]) -> _Edges:
    sizes = [len(ring) for ring in rings]
    return _Edges(
        np.concatenate(rings),
        np.concatenate([np.roll(ring, -1, axis=0) for ring in rings]),
        np.repeat(np.arange(len(rings)), sizes),
        np.concatenate([np.arange(size) for size in sizes]),
        np.repeat(sizes, sizes),
    )


def _near_pairs(low: Points, high: Points) -> Iterator[tuple[Rows, Rows]]:
    """All pairs of boxes that meet, in portions: along the axis along which fewer of them overlap."""
    order, later = min((_overlapping(low[:, axis], high[:, axis]) for axis in (0, 1)), key=lambda each: each[1].sum())
    ends = np.cumsum(later)
    start = 0
    while start < len(order):
        done = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, done + PAIRS_AT_A_TIME, side="right")), start + 1)
        counts = later[start:stop]
        first = np.repeat(np.arange(start, stop), counts)
        second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
        i, j = order[first], order[second]
        near = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        if near.any():
            yield i[near], j[near]
        start = stop


def _overlapping(low: Heights, high: Heights) -> tuple[Rows, Rows]:
    """Intervals in the order of their low ends, and for each of them how many of the following ones it meets."""
    order = np.argsort(low, kind="stable")
    return order, np.searchsorted(low[order], high[order], side="right") - np.arange(len(order)) - 1


# Where a ring is that no edge of the other crosses


def _refuse_holes(rings: list[Points], name: str) -> None:
    """Refuse holes that are not inside of the exterior, or that overlap; no edges cross."""
    exterior = rings[0]
    signs = np.split(ring_signs(exterior, np.concatenate(rings[1:])), np.cumsum([len(ring) for ring in rings[1:-1]]))
    in_order = exterior[np.argsort(exterior[:, 0], kind="stable")]
    low, high = (np.array([end(ring, axis=0) for ring in rings[1:]]) for end in (np.min, np.max))
    first = np.searchsorted(in_order[:, 0], low[:, 0], side="left").tolist()
    after = np.searchsorted(in_order[:, 0], high[:, 0], side="right").tolist()
    for number, ring in enumerate(rings[1:], start=1):
        near = in_order[first[number - 1] : after[number - 1]]
        near = near[(near[:, 1] >= low[number - 1, 1]) & (near[:, 1] <= high[number - 1, 1])]
        if not len(near) and (signs[number - 1] > 0).all():
            continue
        if any(sign < 0 for sign in _sides(exterior, ring, signs[number - 1], near)):
            raise ValueError(f"{name} ring {number} is a hole that is not inside the exterior")
    overlapping = [
        (max(one, two), min(one, two))
        for i, j in _near_pairs(low, high)
        for one, two in zip((i + 1).tolist(), (j + 1).tolist(), strict=True)
        if _overlap(rings[one], rings[two])
    ]
    if overlapping:
        number, other = min(overlapping)
        raise ValueError(f"{name} rings {other} and {number} are holes that overlap")


def _overlap(one: Points, two: Points) -> bool:
    """Whether two rings have inner points in common; no edges cross."""
    return any(sign > 0 for ring, other in ((one, two), (two, one)) for sign in _sides(ring, other))


def _sides(ring: Points, other: Points, of_corners: Signs | None = None, near: Points | None = None) -> Iterator[int]:
    """The signs of the parts into which `ring` divides the edges of `other`: +1 inside, -1 outside.

    Args:
        ring: the ring that divides.
        other: the ring whose edges are divided.
        of_corners: the signs of its corners, if known.
        near: the corners of `ring` in the box of `other`, if known.
    """
    signs = (ring_signs(ring, other) if of_corners is None else of_corners).tolist()
    corners = as_tuples(other)
    near = ring if near is None else near
    touching = as_tuples(near[ring_signs(other, near) == 0]) if len(near) else []
    for k, a in enumerate(corners):
        b = corners[(k + 1) % len(corners)]
        stops = [(a, signs[k])]
        on_edge = [p for p in touching if p not in (a, b) and _on_segment(p, a, b)]
        stops += [(p, 0) for p in (sorted(on_edge) if a < b else sorted(on_edge, reverse=True))]
        stops.append((b, signs[(k + 1) % len(corners)]))
        for (p, before), (q, after) in pairwise(stops):
            yield before or after or _sign_between(ring, p, q)


def _on_segment(p: Point, a: Point, b: Point) -> bool:
    return min(a, b) <= p <= max(a, b) and orient2d(a, b, p) == 0


def _sign_between(ring: Points, p: Point, q: Point) -> int:
    """The sign of the middle of p and q, in rational numbers."""
    (px, py), (qx, qy) = exact(p), exact(q)
    x, y = (px + qx) / 2, (py + qy) / 2
    corners: Sequence[Exact] = [exact(corner) for corner in as_tuples(ring)]
    inside = False
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (ay > y) != (by > y):
            turn: Fraction = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            inside ^= (turn > 0) == (by > ay)
    return 1 if inside else -1


def ring_signs(ring: Points, points: Points) -> Signs:
    """(n,) signs of (n, 2) points: +1 inside of a simple ring, 0 on it, -1 outside. Exact.

    O(n log n + k) for k corners, and O(1) for each pair of a point and an edge that overlap in y: at worst O(n k).
    """
    a, b = ring, np.roll(ring, -1, axis=0)
    low, high = np.minimum(a, b), np.maximum(a, b)
    passed = np.zeros(len(points), np.bool_)
    on = np.zeros(len(points), np.bool_)
    for rows, edges in at_one_height(points, low[:, 1], high[:, 1]):
        near = points[rows]
        y = near[:, None, 1]
        p, e = np.nonzero((low[edges, 1] <= y) & (y <= high[edges, 1]) & (near[:, None, 0] <= high[edges, 0]))
        e, at = edges[e], near[p]
        turns = np.asarray(orient2d(a[e], b[e], at))
        on[rows[p[(turns == 0) & (at[:, 0] >= low[e, 0])]]] = True
        rises, ends_below = a[e, 1] <= at[:, 1], b[e, 1] <= at[:, 1]
        crossed = p[(rises != ends_below) & ((turns > 0) == rises)]
        passed[rows] ^= np.bincount(crossed, minlength=len(rows)) % 2 == 1
    signs: Signs = np.where(on, 0, np.where(passed, 1, -1)).astype(np.int8)
    return signs


def at_one_height(points: Points, low: Heights, high: Heights) -> Iterator[tuple[Rows, Rows]]:
    """Rows of points, and of edges from height `low` to `high`, that may meet: each such pair in one portion."""
    order = np.argsort(points[:, 1], kind="stable")
    for start in range(0, len(order), POINTS_AT_A_TIME):
        rows = order[start : start + POINTS_AT_A_TIME]
        edges = np.flatnonzero((low <= points[rows[-1], 1]) & (high >= points[rows[0], 1]))
        for first in range(0, len(edges), PAIRS_AT_A_TIME // len(rows)):
            yield rows, edges[first : first + PAIRS_AT_A_TIME // len(rows)]
