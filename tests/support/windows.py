"""The windows that the tests run on, and what a window should hold: a list, and rational arithmetic."""

from collections import Counter
from fractions import Fraction
from math import inf

import oracle

from dynhull import WindowHull
from dynhull._expiry import WindowTree
from dynhull._implementation import kernel


class PythonWindow(WindowHull):
    __slots__ = ()
    _tree_type = WindowTree


WINDOWS = {"python": PythonWindow}

if kernel is not None:

    class KernelWindow(WindowHull):
        __slots__ = ()
        _tree_type = kernel.WindowTree

    WINDOWS["cpp"] = KernelWindow


class Model:
    """A list of (time, arrival, point), searched from one end to the other."""

    def __init__(self, max_age=None, max_points=None):
        self.max_age, self.max_points = max_age, max_points
        self.now = None
        self.items = []
        self.arrivals = 0
        self.expired = self.evicted = self.late = 0

    def too_old(self, time):
        return self.max_age is not None and Fraction(time) <= Fraction(self.now) - Fraction(self.max_age)

    def add(self, points, times=None):
        moments = [-inf if self.now is None else self.now] * len(points) if times is None else times
        if times:
            self.now = max(times if self.now is None else [*times, self.now])
        self.expired += self.expire_old()
        late = 0
        for (x, y), time in zip(points, moments, strict=True):
            if self.too_old(time):
                late += 1
            else:
                self.items.append((time + 0.0, self.arrivals, (x + 0.0, y + 0.0)))
            self.arrivals += 1
        while self.max_points is not None and len(self.items) > self.max_points:
            self.items.remove(min(self.items))
            self.evicted += 1
        self.late += late
        return len(points) - late

    def advance(self, now):
        self.now = now
        left = self.expire_old()
        self.expired += left
        return left

    def expire_old(self):
        before = len(self.items)
        self.items = [item for item in self.items if not self.too_old(item[0])]
        return before - len(self.items)

    def expire(self, until):
        before = len(self.items)
        self.items = [item for item in self.items if item[0] > until]
        self.expired += before - len(self.items)
        return before - len(self.items)

    def delete(self, p):
        """The oldest copy; False where there is none."""
        copies = [item for item in self.items if item[2] == p]
        if copies:
            self.items.remove(min(copies))
        return bool(copies)

    def points(self):
        return Counter(p for _, _, p in self.items)


def assert_as(window, model):
    """All that a user can ask a window about its points and times is as the model has it."""
    window.check()
    expected = sorted((p, time) for time, _, p in model.items)
    assert list(map(tuple, window.points().tolist())) == [p for p, _ in expected]
    assert window.times().tolist() == [time for _, time in expected]
    assert list(map(tuple, window.vertices().tolist())) == oracle.hull(model.points())
    oldest = min((time for time, _, _ in model.items), default=-inf)
    assert window.oldest == (None if oldest == -inf else oldest)
    assert window.now == model.now
    assert (window.expired, window.evicted, window.late) == (model.expired, model.evicted, model.late)
