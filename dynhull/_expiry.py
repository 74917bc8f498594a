"""The tree of a window, whose oldest points leave: the readable reference.

Points with times are held in order of time, equal times in order of arrival. Most points arrive in this order: they
wait in a queue. A point that is older than the queue's last one waits in a heap. The oldest point is at the front of
the queue or on top of the heap.

A delete by coordinates does not search for its copy. It records a tombstone, the point and the number of arrivals at
that time. Copies come out of the order oldest first, and the oldest was taken by the first delete after its arrival: it
consumes that tombstone.
"""

from bisect import bisect_right, insort
from collections import Counter, deque
from heapq import heappop, heappush
from math import inf, nextafter
from typing import Self

import numpy as np
import numpy.typing as npt

from ._predicates import Point
from ._tree import HullTree
from .arrays import Points, as_times, as_tuples

Item = tuple[float, int, Point]  # the time, the number of arrivals before, and the point
Times = npt.NDArray[np.float64]
Totals = tuple[int, int, int, int]  # changes, expired, evicted, late

NEVER = -inf  # the time of a point that came before any time was known
MOST_TOMBSTONES = 1024  # beyond the number of points, before the order is built anew without them


def horizon(now: float, max_age: float) -> float:
    """The greatest double that is at most now - max_age, exactly; -inf if there is none.

    Knuth's error-free sum: the difference is `rounded` plus `error`.
    """
    rounded = now - max_age
    if rounded == -inf:
        return rounded
    taken = now - rounded
    error = (now - (rounded + taken)) - (max_age - taken)
    return nextafter(rounded, -inf) if error < 0 else rounded


class Order:
    """Points in the order in which they leave a window. O(1) an operation in order of time, otherwise O(log n)."""

    def __init__(self) -> None:
        self._queue: deque[Item] = deque()
        self._heap: list[Item] = []
        self._tombstones: dict[Point, list[int]] = {}
        self.deleted = 0  # items that a tombstone has taken, not yet removed

    def push(self, item: Item) -> None:
        """Add an item, later in arrival than all others."""
        if self._queue and item < self._queue[-1]:
            heappush(self._heap, item)
        else:
            self._queue.append(item)

    def front(self) -> Item | None:
        """The oldest item; None if there is none."""
        while True:
            queue, heap = self._queue, self._heap
            if heap and not (queue and queue[0] < heap[0]):
                item = heap[0]
            elif queue:
                item = queue[0]
            else:
                return None
            if not (self.deleted and self._consume(self._tombstones, item)):
                return item
            self.deleted -= 1
            self._remove(item)

    def pop(self) -> Item:
        """Remove and return the oldest item."""
        item = self.front()
        assert item is not None
        self._remove(item)
        return item

    def pop_until(self, time: float) -> list[Item]:
        """Remove and return the items of this time or before."""
        leaving = []
        while (item := self.front()) is not None and item[0] <= time:
            self._remove(item)
            leaving.append(item)
        return leaving

    def delete(self, p: Point, arrivals: int, live: int) -> None:
        """Take the oldest copy of a point that the order holds. `live` is the number of items left."""
        insort(self._tombstones.setdefault(p, []), arrivals)
        self.deleted += 1
        if self.deleted > live + MOST_TOMBSTONES:
            self._queue, self._heap, self._tombstones, self.deleted = deque(self.items()), [], {}, 0

    def items(self) -> list[Item]:
        """The items that no tombstone has taken, oldest first. O(n log n)."""
        tombstones = {p: arrivals.copy() for p, arrivals in self._tombstones.items()}
        return [item for item in sorted([*self._queue, *self._heap]) if not self._consume(tombstones, item)]

    def _remove(self, oldest: Item) -> None:
        if self._queue and self._queue[0] is oldest:
            self._queue.popleft()
        else:
            heappop(self._heap)

    @staticmethod
    def _consume(tombstones: dict[Point, list[int]], oldest: Item) -> bool:
        """Whether a tombstone has taken the oldest item; the tombstone goes with it."""
        _, arrival, p = oldest
        arrivals = tombstones.get(p, [])
        i = bisect_right(arrivals, arrival)
        if i == len(arrivals):
            return False
        del arrivals[i]
        if not arrivals:
            del tombstones[p]
        return True


class WindowTree(HullTree):
    """A tree of points with times, of which the oldest leave.

    Args:
        max_age: the age at which a point leaves; None for any.
        max_points: the greatest number of points; None for any.
    """

    def __init__(self, max_age: float | None, max_points: int | None) -> None:
        super().__init__()
        self._max_age = max_age
        self._max_points = max_points
        self._now = NEVER
        self._arrivals = 0
        self._order = Order()
        self.expired = 0
        self.evicted = 0
        self.late = 0

    @property
    def max_age(self) -> float | None:
        """The age at which a point leaves; None for any."""
        return self._max_age

    @property
    def max_points(self) -> int | None:
        """The greatest number of points; None for any."""
        return self._max_points

    @property
    def now(self) -> float | None:
        """The greatest time seen; None before."""
        return _known(self._now)

    @property
    def oldest(self) -> float | None:
        """The time of the oldest point; None if there is none, or if it has no time."""
        front = self._order.front()
        return None if front is None else _known(front[0])

    def add(self, xy: npt.ArrayLike, times: npt.ArrayLike | None) -> int:
        """Add the points that are not late, and remove those that are too old or too many, as one batch.

        Returns:
            The number of points added.
        """
        points = as_tuples(self._as_points(xy))
        moments = [self._now] * len(points) if times is None else as_times(times, len(points)).tolist()
        with self._in_frame(points):
            return self._add(points, moments)

    def _add(self, points: list[Point], moments: list[float]) -> int:
        now = max(moments, default=self._now)
        now = max(now, self._now)
        limit = self._limit(now)
        first = self._arrivals
        entering = [
            (time, first + row, p)
            for row, (time, p) in enumerate(zip(moments, points, strict=True))
            if limit is None or time > limit
        ]
        expired = [] if limit is None else self._order.pop_until(limit)
        surplus = 0 if self._max_points is None else len(self) - len(expired) + len(entering) - self._max_points
        for item in entering:
            self._order.push(item)
        evicted = [self._order.pop() for _ in range(surplus)]
        self._arrivals += len(points)
        self._now = now
        self.expired += len(expired)
        self.evicted += len(evicted)
        self.late += len(points) - len(entering)
        self._replace_points(expired + evicted, entering)
        return len(entering)

    def advance(self, now: float) -> int:
        """Move the clock. Returns the number of points that left. ValueError if time would go back."""
        if now < self._now:
            raise ValueError(f"now is {now!r}, before the window's time {self._now!r}: time does not go back")
        limit = self._limit(now)
        self._now = now
        return 0 if limit is None else self.expire(limit)

    def expire(self, until: float) -> int:
        """Remove the points of this time or before, as one batch. Returns their number."""
        expired = self._order.pop_until(until)
        self.expired += len(expired)
        self._replace_points(expired, [])
        return len(expired)

    def delete(self, x: float, y: float) -> bool:
        """Remove the oldest copy of a point. True if the hull changed; KeyError if the point is missing. O(log² n)."""
        p = self._as_point(x, y)
        changed = super().delete(*p)
        self._order.delete(p, self._arrivals, len(self))
        return changed

    def delete_many(self, xy: npt.ArrayLike, ignore_missing: bool) -> int:
        """Remove the oldest copies of points as one batch, like `apply`. Returns the number of points removed."""
        points = self._as_points(xy)
        rows = Counter(as_tuples(points))
        copies = {p: min(count, self._count(p)) for p, count in rows.items()}
        removed = super().apply(-1, points, ignore_missing)
        for p, count in copies.items():
            for _ in range(count):
                self._order.delete(p, self._arrivals, len(self))
        return removed

    def clear(self) -> None:
        """Remove every point. The clock stays."""
        super().clear()
        self._order = Order()

    def times(self) -> Times:
        """The times of the points in the order of `points`, copies of a point in order of time. O(n log n)."""
        return np.array([time for _, time in sorted((p, time) for time, _, p in self._order.items())])

    def state(self) -> tuple[Points, Times, float | None, Totals]:
        """What `restore` needs: points in the order in which they leave, their times, now, the totals. O(n log n)."""
        items = self._order.items()
        points = np.array([p for _, _, p in items], dtype=np.float64).reshape(-1, 2)
        times = np.array([time for time, _, _ in items], dtype=np.float64)
        return points, times, self.now, (self.changes, self.expired, self.evicted, self.late)

    def restore(self, points: Points, times: Times, now: float | None, totals: Totals) -> None:
        """Fill an empty tree with the state of another."""
        entries = as_tuples(points)
        for arrival, (time, p) in enumerate(zip(times.tolist(), entries, strict=True)):
            self._order.push((time, arrival, p))
        self._arrivals = len(entries)
        self._apply_net(Counter(entries))
        self._now = NEVER if now is None else now
        self.changes, self.expired, self.evicted, self.late = totals

    def copy(self) -> Self:
        """An independent tree of the same points and times. O(n log n)."""
        new = type(self)(self._max_age, self._max_points)
        new.restore(*self.state())
        return new

    def check(self) -> None:
        """Raise AssertionError if an invariant of the tree or of the window is broken. O(n log n) orientations."""
        super().check()
        items = self._order.items()
        if Counter(p for _, _, p in items) != Counter(as_tuples(self.points())):
            raise AssertionError("the order holds other points than the tree")
        limit = self._limit(self._now)
        if items and limit is not None and items[0][0] <= limit:
            raise AssertionError(f"a point of time {items[0][0]} is older than {limit}")
        if items and items[-1][0] > self._now:
            raise AssertionError(f"a point of time {items[-1][0]} is later than now, {self._now}")
        if self._max_points is not None and len(self) > self._max_points:
            raise AssertionError(f"{len(self)} points, at most {self._max_points} are allowed")

    def _limit(self, now: float) -> float | None:
        """The time of the youngest points that are too old; None if age does not matter."""
        return None if self._max_age is None else horizon(now, self._max_age)

    def _replace_points(self, leaving: list[Item], entering: list[Item]) -> None:
        if not leaving and not entering:
            return
        ops = np.repeat(np.array([-1, 1], dtype=np.int8), [len(leaving), len(entering)])
        self.apply(ops, [p for _, _, p in leaving + entering], ignore_missing=False)


def _known(time: float) -> float | None:
    return None if time == NEVER else time
