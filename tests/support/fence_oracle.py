"""Who is inside of which fence, by definition and in rational arithmetic: slow, and without code of the library.

An area is ("polygons", [[ring, ...], ...]), ("circle", (x, y), radius) or ("hull", vertices).
"""

from fractions import Fraction
from itertools import pairwise
from math import nextafter

import oracle
from oracle import exact, segment_distance


def edges(ring):
    return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def winding(ring, p):
    """The winding number of a ring around a rational point; None on the ring."""
    px, py = p
    number = 0
    for a, b in edges(ring):
        if not min(a[1], b[1]) <= py <= max(a[1], b[1]):
            continue
        (ax, ay), (bx, by) = exact(a), exact(b)
        turn = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
        if turn == 0 and min(ax, bx) <= px <= max(ax, bx):
            return None
        if ay <= py < by and turn > 0:
            number += 1
        if by <= py < ay and turn < 0:
            number -= 1
    return number


def where_in_polygon(polygon, p):
    numbers = [winding(ring, p) for ring in polygon]
    if numbers[0] == 0:
        return -1
    if any(number is None for number in numbers):
        return 0 if numbers[0] is None or not any(numbers[1:]) else -1
    return -1 if any(numbers[1:]) else 1


class Area:
    """An area as the oracle sees it: open areas without inner points are empty."""

    def __init__(self, described, closed):
        self.kind, *self.parts = described
        self.closed = closed
        if self.kind == "hull":
            (vertices,) = self.parts
            if len(vertices) > 2:
                self.kind, self.parts = "polygons", [[[vertices]]]
            elif not vertices or not closed:
                self.kind, self.parts = "polygons", [[]]
        elif self.kind == "circle" and not closed and self.parts[1] == 0:
            self.kind, self.parts = "polygons", [[]]

    def where(self, p):
        """+1, 0, -1 of a rational point."""
        if self.kind == "circle":
            (x, y), radius = exact(self.parts[0]), Fraction(self.parts[1])
            more = (p[0] - x) ** 2 + (p[1] - y) ** 2 - radius**2
            return (more < 0) - (more > 0)
        if self.kind == "hull":
            return 0 if squared(p, self.parts[0][0], self.parts[0][-1]) == 0 else -1
        return max((where_in_polygon(polygon, p) for polygon in self.parts[0]), default=-1)

    def holds(self, p):
        return self.where(exact(p)) >= (0 if self.closed else 1)

    def segments(self):
        if self.kind == "hull":
            return [(self.parts[0][0], self.parts[0][-1])]
        return [edge for polygon in self.parts[0] for ring in polygon for edge in edges(ring)]

    def within(self, p, margin):
        if self.where(exact(p)) >= 0:
            return True
        if self.kind == "circle":
            reach = Fraction(self.parts[1]) + Fraction(margin)
            return squared(exact(p), self.parts[0], self.parts[0]) <= reach**2
        return any(segment_distance(p, a, b) <= Fraction(margin) ** 2 for a, b in self.segments())

    def is_rounded_distance(self, p, value):
        """Whether a double is the distance of p, rounded to nearest."""
        if self.where(exact(p)) >= 0:
            return value == 0
        if self.kind != "circle" and not self.segments():
            return value == float("inf")
        less = Fraction(0)
        if self.kind == "circle":
            square, less = squared(exact(p), self.parts[0], self.parts[0]), Fraction(self.parts[1])
        else:
            square = min(segment_distance(p, a, b) for a, b in self.segments())
        if value == float("inf"):  # the distance is at least halfway beyond the greatest double
            return root_at_least(square, less + Fraction(2) ** 1024 - Fraction(2) ** 970)
        below = (Fraction(value) + Fraction(nextafter(value, -1.0))) / 2 if value > 0 else Fraction(0)
        after = nextafter(value, float("inf"))
        above = (Fraction(value) + (Fraction(after) if after != float("inf") else Fraction(2) ** 1024)) / 2
        return root_at_least(square, less + below) and not square > (less + above) ** 2

    def meets(self, p, q):
        """Whether the segment has a point of the area: of its ends, its meetings with edges, and what is between."""
        start, end = exact(p), exact(q)
        if self.kind == "circle":
            square = segment_distance(self.parts[0], p, q)
            return square <= Fraction(self.parts[1]) ** 2 if self.closed else square < Fraction(self.parts[1]) ** 2
        shares = {Fraction(0), Fraction(1)}
        for a, b in self.segments():
            shares |= set(meetings(start, end, exact(a), exact(b)))
        ordered = sorted(share for share in shares if 0 <= share <= 1)
        tried = ordered + [(s + t) / 2 for s, t in pairwise(ordered)]
        at = [tuple(s + share * (e - s) for s, e in zip(start, end, strict=True)) for share in tried]
        return any(self.where(point) >= (0 if self.closed else 1) for point in at)


def root_at_least(square, value):
    return value <= 0 or square >= value**2


def squared(p, a, b):
    """Like `segment_distance`, of a rational point."""
    (ax, ay), (bx, by) = exact(a), exact(b)
    ux, uy = bx - ax, by - ay
    share = ((p[0] - ax) * ux + (p[1] - ay) * uy) / (ux * ux + uy * uy) if (ux, uy) != (0, 0) else 0
    share = max(min(share, Fraction(1)), Fraction(0))
    return (p[0] - ax - share * ux) ** 2 + (p[1] - ay - share * uy) ** 2


def meetings(start, end, a, b):
    """The shares of the way at which it is on the line through a and b, or at the height of their ends along it."""
    wx, wy = end[0] - start[0], end[1] - start[1]
    ux, uy = b[0] - a[0], b[1] - a[1]
    turn = wx * uy - wy * ux
    if turn != 0:
        yield ((a[0] - start[0]) * uy - (a[1] - start[1]) * ux) / turn
    elif (wx, wy) != (0, 0):
        for x, y in (a, b):
            yield ((x - start[0]) * wx + (y - start[1]) * wy) / (wx * wx + wy * wy)


class Fence:
    def __init__(self, described, closed, margin, cross, own):
        self.described, self.closed, self.margin, self.cross, self.own = described, closed, margin, cross, own

    def settings(self):
        area = Area(self.described, self.closed)
        return area.kind, area.parts, self.closed, self.margin

    def area(self, places, key=None):
        if not self.own:
            return Area(self.described, self.closed)
        others = [p for other, p in places.items() if other != key]
        return Area(("hull", oracle.hull(others)), True)


class Model:
    """Fences with the state of each subject, carried from one `take` to the next."""

    def __init__(self):
        self.places, self.before, self.gone = {}, {}, {}
        self.fences, self.inside, self.decided, self.born = {}, {}, {}, {}

    def put(self, key, p):
        self.places[key] = (p[0] + 0.0, p[1] + 0.0)

    def remove(self, key, cause):
        del self.places[key]
        self.gone[key] = cause

    def set(self, number, fence, inside=None):
        if number in self.fences and inside is None:
            self.fences[number] = fence
            return
        self.fences[number] = fence
        self.born[number] = dict(self.places)
        if inside is None:
            self.inside[number] = {k for k, p in self.places.items() if fence.area(self.places, k).holds(p)}
            self.decided[number] = self.settled(fence)
        else:
            self.inside[number] = {k for k in inside if k in self.places}
            self.decided[number] = None

    def drop(self, number):
        for each in (self.fences, self.decided):
            del each[number]
        self.born.pop(number, None)
        return sorted(self.inside.pop(number))

    def settled(self, fence):
        if not fence.own:
            return fence.settings()
        return "own", Fence(("hull", oracle.hull(self.places.values())), True, fence.margin, False, False).settings()

    def take(self):
        """Rows (fence, change, causes, key, point or None, previous or None, area or None)."""
        rows = []
        for number, fence in sorted(self.fences.items()):
            changed = self.settled(fence) != self.decided[number]
            inside = self.inside[number]
            for key in sorted({*self.places, *inside}):
                p, previous = self.places.get(key), self.before.get(key)
                if p is None:
                    inside.discard(key)
                    rows.append((number, -1, self.gone[key] | 2 * changed, key, None, previous, None))
                    continue
                area = fence.area(self.places, key)
                was = key in inside
                now = area.within(p, fence.margin) if was and fence.margin else area.holds(p)
                start = self.born[number].get(key) if number in self.born else previous
                crosses = fence.cross and not was and not now and start not in (None, p) and area.meets(start, p)
                if now == was and not crosses:
                    continue
                cause = 4 if previous is None else 1 if previous != p else 0
                cause |= 2 if changed or not cause else 0
                rows.append((number, (now > was) - (now < was), cause, key, p, previous, area))
                (inside.add if now else inside.discard)(key)
            self.decided[number] = self.settled(fence)
        self.before, self.gone, self.born = dict(self.places), {}, {}
        return rows
