"""The rules of a quarantine in rational numbers, as its documentation states them."""

from fractions import Fraction

import numpy as np

from dynhull import convex_hull

SECOND = 1_000_000  # in microseconds


def doubled_area(points):
    corners = [(Fraction(x), Fraction(y)) for x, y in convex_hull(np.array(points, float).reshape(-1, 2)).tolist()]
    pairs = zip(corners, corners[1:] + corners[:1], strict=True)
    return sum((ax * by - ay * bx for (ax, ay), (bx, by) in pairs), Fraction(0))


class Model:
    """The rules as the documentation states them."""

    def __init__(self, rules, *, ordered):
        self.rules, self.ordered = rules, ordered
        self.there, self.held = {}, {}  # by key: x, y and time; of held ones also the confirmations

    def breaks(self, at, before, points):
        x, y, time = at
        if self.rules.max_speed is not None and before is not None:
            squared = (Fraction(x) - Fraction(before[0])) ** 2 + (Fraction(y) - Fraction(before[1])) ** 2
            elapsed = Fraction(abs(int(time * SECOND) - int(before[2] * SECOND)), SECOND)
            if squared > (Fraction(self.rules.max_speed) * elapsed) ** 2:
                return True
        area = doubled_area(points)
        grown = self.rules.max_growth is not None and area
        return bool(grown) and doubled_area([*points, (x, y)]) > Fraction(self.rules.max_growth) * area

    def put(self, rows, removes):
        points = [at[:2] for at in self.there.values()]
        there, held, out, released = dict(self.there), dict(self.held), [], 0
        for row, (key, *at) in enumerate(rows):
            before, waiting = self.there.get(key), self.held.get(key)
            if self.ordered and before is not None and at[2] < before[2]:
                continue
            if not self.breaks(at, before, points):
                there[key] = tuple(at)
                if waiting is not None and at[2] >= waiting[2]:
                    held.pop(key)
                continue
            confirmed = 0
            if waiting is not None:
                if self.ordered and at[2] < waiting[2]:
                    continue
                if at[2] > waiting[2] and not self.breaks(at, waiting[:3], [*points, waiting[:2]]):
                    confirmed = waiting[3] + 1
                if 0 < self.rules.confirmations <= confirmed:
                    there[key] = tuple(at)
                    held.pop(key)
                    released += 1
                    continue
            held[key] = (*at, confirmed)
            out.append(row)
        for key in removes:
            there.pop(key, None)
            held.pop(key, None)
        self.there, self.held = there, held
        return out, released

    def release(self, keys):
        """How many are let in by hand."""
        waiting = [key for key in keys if key in self.held]
        for key in waiting:
            self.there[key] = self.held.pop(key)[:3]
        return len(waiting)

    def drop(self, keys):
        """How many are dropped by hand."""
        return sum(self.held.pop(key, None) is not None for key in keys)
