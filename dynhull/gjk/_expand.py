"""EPA: the expanding polytope algorithm, for the depth of an overlap.

Start with the simplex that contains the origin and always push out the side nearest to the origin, until that side
cannot be pushed: it belongs to the difference, and its distance is the depth.
"""

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from math import inf

from .._predicates import EPSILON
from ._difference import Corner, Difference
from ._simplex import nearest
from ._vectors import ORIGIN, Vector, combine, cross, dot, length, normal, scale, subtract, unit

MOST_ITERATIONS = 512
# A smaller push, relative to the size of the difference, is a rounding error.
GAIN = 1e-13
# The same for curved sets, whose sides would shrink below rounding before they stop growing.
CURVED_GAIN = 1e-10
# The error of a cross product, relative to its factors.
CROSS_ERROR = 4 * EPSILON
# Two sides whose distances differ by less, relative to the same size, may be confused.
DOUBT = 4 * GAIN
AXES: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Overlap:
    """The depth, the direction in which the second set leaves the first, and the deepest point of each in the other."""

    depth: float
    normal: Vector
    points: tuple[Vector, Vector]
    iterations: int


@dataclass(frozen=True, slots=True)
class Side:
    """An edge in the plane, a triangle in space, seen counter-clockwise from outside.

    Attributes:
        corners: two or three.
        normal: unit vector that points outwards.
        distance: of its line or plane from the origin; negative if the origin is outside.
        error: the rounding error of the normal, large for a thin triangle.
    """

    corners: tuple[Corner, ...]
    normal: Vector
    distance: float
    error: float

    def may_be_nearer(self, distance: float, size: float) -> bool:
        """Whether the side could be nearer to the origin than a distance, given the size of the difference."""
        return self.error == inf or self.distance - self.error * size < distance


def expand(difference: Difference, simplex: list[Corner]) -> Overlap:
    """Push out the simplex, which contains the origin up to rounding."""
    corners, flat = _full(difference, list(simplex))
    iterations = len(corners) - len(simplex)
    if flat is not None:  # moving out of their common line or plane separates them at once
        kept, weights = nearest([corner.w for corner in simplex])
        return Overlap(0.0, flat, _points(weights, [simplex[i] for i in kept]), iterations)
    size = max(length(corner.w) for corner in corners)
    sides = _outward_sides(corners)
    gain = GAIN if difference.polytopes else CURVED_GAIN
    heap = [(side.distance, i) for i, side in enumerate(sides)]
    heapify(heap)
    gone: set[int] = set()
    while True:
        _, i = heappop(heap)
        if i in gone:
            continue
        side = sides[i]
        far = difference.farthest(side.normal)
        iterations += 1
        if dot(far.w, side.normal) - side.distance <= gain * size or iterations >= MOST_ITERATIONS:
            break
        seen = _visible(sides, gone, i, far, GAIN * size) if difference.dimension == 3 else [i]
        new = _cone([sides[k] for k in seen], far)
        gone.update(seen)
        for s in new:
            heappush(heap, (s.distance, len(sides)))
            sides.append(s)
    size = max([size, *(length(corner.w) for s in sides for corner in s.corners)])
    left = [other for k, other in enumerate(sides) if k not in gone]
    if side.distance < -DOUBT * size or any(other.may_be_nearer(side.distance - DOUBT * size, size) for other in left):
        difference.doubt()
    foot = scale(side.distance, side.normal)
    kept, weights = nearest([subtract(corner.w, foot) for corner in side.corners])
    points = _points(weights, [side.corners[k] for k in kept])
    return Overlap(max(side.distance, 0.0), side.normal, points, iterations)


def _points(weights: tuple[float, ...], corners: list[Corner]) -> tuple[Vector, Vector]:
    return combine(weights, [c.p for c in corners]), combine(weights, [c.q for c in corners])


def _full(difference: Difference, corners: list[Corner]) -> tuple[list[Corner], Vector | None]:
    """The corners of a full simplex, or of a smaller one and a direction in which the difference has no extent."""
    while len(corners) <= difference.dimension:
        for direction in _across(corners, difference.dimension):
            found = [difference.farthest(scale(sign, direction)) for sign in (1.0, -1.0)]
            reach = [abs(dot(subtract(far.w, corners[0].w), direction)) for far in found]
            if max(reach) > GAIN * max(length(corner.w) for corner in (*corners, *found)):
                corners = [*corners, found[reach[1] > reach[0]]]
                break
        else:
            return corners, direction
    return corners, None


def _across(corners: list[Corner], dimension: int) -> list[Vector]:
    """Unit vectors at right angles to a point, a segment or a triangle."""
    ways = [subtract(corner.w, corners[0].w) for corner in corners[1:]]
    if not ways:
        return list(AXES[:dimension])
    if dimension == 2:
        return [unit((-ways[0][1], ways[0][0], 0.0))]
    if len(ways) == 2:
        return [unit(cross(*ways))]
    least = min(AXES, key=lambda axis: abs(dot(axis, ways[0])))
    one = unit(cross(ways[0], least))
    return [one, unit(cross(ways[0], one))]


def _side(corners: tuple[Corner, ...]) -> Side:
    if len(corners) == 2:
        way = subtract(corners[1].w, corners[0].w)
        outwards, error = unit((way[1], -way[0], 0.0)), EPSILON
    else:
        a, b, c = (corner.w for corner in corners)
        across = normal(a, b, c)
        outwards = unit(across)
        lengths = length(subtract(b, a)) * length(subtract(c, a))
        error = CROSS_ERROR * lengths / length(across) if any(across) else inf
    if outwards == ORIGIN:  # without area: never the nearest, never visible
        return Side(corners, outwards, inf, error)
    # The corners' distances are equal up to rounding; the one nearest to the origin is the most accurate.
    return Side(corners, outwards, dot(outwards, min((c.w for c in corners), key=lambda w: dot(w, w))), error)


def _outward_sides(corners: list[Corner]) -> list[Side]:
    a, b, c = (corner.w for corner in corners[:3])
    if len(corners) == 3:
        if normal(a, b, c)[2] < 0:
            corners.reverse()
        return [_side((corners[i - 1], corners[i])) for i in range(3)]
    if dot(normal(a, b, c), subtract(corners[3].w, a)) > 0:
        corners = [corners[0], corners[2], corners[1], corners[3]]
    i, j, k, top = corners
    return [_side(face) for face in ((i, j, k), (i, top, j), (j, top, k), (k, top, i))]


def _visible(sides: list[Side], gone: set[int], first: int, far: Corner, rounding: float) -> list[int]:
    """The indices of the faces that the new corner sees, connected to the face from which it was found."""
    seen, edges = {first}, {}
    for i, side in enumerate(sides):
        if i not in gone:
            for k in range(3):
                edges[side.corners[k - 1], side.corners[k]] = i
    waiting = [first]
    while waiting:
        corners = sides[waiting.pop()].corners
        for k in range(3):
            i = edges[corners[k], corners[k - 1]]
            # A face in one plane with the new corner counts as visible: a new face beside it might have no area.
            if i not in seen and dot(sides[i].normal, far.w) >= sides[i].distance - rounding:
                seen.add(i)
                waiting.append(i)
    return list(seen)


def _cone(seen: list[Side], far: Corner) -> list[Side]:
    """New sides from the rim of the visible ones to the new corner."""
    if len(far_side := seen[0].corners) == 2:
        return [_side((far_side[0], far)), _side((far, far_side[1]))]
    edges = {(side.corners[k - 1], side.corners[k]) for side in seen for k in range(3)}
    return [_side((a, b, far)) for a, b in edges if (b, a) not in edges]
