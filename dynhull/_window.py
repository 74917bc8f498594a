"""Hulls whose points have times, and whose oldest points leave: WindowHull in the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from ._base import UNMEASURED, Hull, Live
from ._expiry import WindowTree
from ._hull import MissingPointError
from ._implementation import kernel
from .arrays import as_count, as_time

if TYPE_CHECKING:
    from . import _kernel
    from .arrays import Points


class Windowed(Live):
    """A live hull of recent points."""

    __slots__ = ()
    _tree: WindowTree | _kernel.WindowTree

    # Time

    @property
    def max_age(self) -> float | None:
        """The age at which a point leaves; None if age does not matter. O(1)."""
        return self._tree.max_age

    @property
    def max_points(self) -> int | None:
        """The greatest number of points; None if it is not limited. O(1)."""
        return self._tree.max_points

    @property
    def now(self) -> float | None:
        """The greatest time that `add` or `advance` received; None before the first. O(1)."""
        return self._tree.now

    @property
    def oldest(self) -> float | None:
        """The time of the oldest point; None without points, or if it came before any time. Amortised O(log n)."""
        return self._tree.oldest

    @property
    def expired(self) -> int:
        """The number of points that have left because of their age. O(1)."""
        return self._tree.expired

    @property
    def evicted(self) -> int:
        """The number of points that have left because there were more than `max_points`. O(1)."""
        return self._tree.evicted

    @property
    def late(self) -> int:
        """The number of points that `add` did not insert because they were too old already. O(1)."""
        return self._tree.late

    def times(self) -> npt.NDArray[np.float64]:
        """(n,) times of the points, in the order of `points()`. O(n log n).

        Copies of a point are in order of time; -inf for points that came before any time.
        """
        return self._tree.times()

    def oldest_first(self) -> tuple[Points, npt.NDArray[np.float64]]:
        """(n, 2) points and (n,) times in the order in which they leave. O(n log n)."""
        points, times, _, _ = self._tree.state()
        return points, times

    # Updates

    def add(self, xy: npt.ArrayLike, times: npt.ArrayLike | None = None) -> int:
        """Move the clock to the greatest time, remove the points that are too old, and add the others, as one batch.

        Rows that are too old are not added but counted in `late`; the times of the batch's other rows count, too. Then
        the oldest points leave until at most `max_points` are left; rows of the batch may be among them.

        O(log² n) a point that is added or leaves, O((n + k) log k) in all for k >= n, and O(log n) for its place in
        the order of time, O(1) for points in this order.

        Args:
            xy: (k, 2) array-like, as for DynamicHull.
            times: (k,) finite numbers, in any order. None, allowed only without `max_age`, stands for `now`: the order
                of arrival.

        Returns:
            The number of points added: k without the late ones.
        """
        if times is None and self.max_age is not None:
            raise ValueError("times is None: a window with max_age needs the time of each point")
        return self._tree.add(xy, times)

    def advance(self, now: float) -> int:
        """Move the clock, and remove the points that are too old as one batch. Returns their number. O(log² n) each.

        Raises:
            ValueError: `now` is before the window's present time.
        """
        return self._tree.advance(as_time(now, "now"))

    def expire(self, until: float) -> int:
        """Remove every point with a time of at most `until`, as one batch. Returns their number. O(log² n) each.

        For windows whose clock is kept elsewhere; `now` stays. Points that came before any time leave, too.
        """
        return self._tree.expire(as_time(until, "until"))

    def delete(self, x: float, y: float) -> bool:
        """Remove the oldest copy of a point. Returns whether the hull changed. O(log² n).

        Raises:
            MissingPointError: the window does not hold the point.
        """
        try:
            return self._tree.delete(x, y)
        except KeyError:
            raise MissingPointError(self._as_point(x, y)) from None

    def delete_many(self, xy: npt.ArrayLike, missing: Literal["raise", "ignore"] = "raise") -> int:
        """Remove the oldest copies of points as one batch. Returns the number of points removed. O(log² n) each.

        Args:
            xy: (k, 2) array-like.
            missing: for a row with more copies of a point than the window holds, "raise" raises MissingPointError with
                the row, before anything changes; "ignore" skips the row.
        """
        if missing not in ("raise", "ignore"):
            raise ValueError(f'missing must be "raise" or "ignore", got {missing!r}')
        try:
            return self._tree.delete_many(xy, missing == "ignore")
        except KeyError as error:
            if len(error.args) != 3:  # raised by the caller's own array-like
                raise
            x, y, row = error.args
            raise MissingPointError((x, y), row) from None

    def clear(self) -> None:
        """Remove every point. The clock and the totals stay. O(n)."""
        self._tree.clear()

    # As a value

    def __eq__(self, other: object) -> bool:
        """Whether the other window holds the same points with the same times, limits and present time. O(n log n)."""
        if not isinstance(other, Windowed):
            return NotImplemented
        mine, others = ((w.max_age, w.max_points, w.now, len(w)) for w in (self, other))
        return (
            self._same_frame(other)
            and mine == others
            and np.array_equal(self.points(), other.points())
            and np.array_equal(self.times(), other.times())
        )


class WindowHull(Windowed, Hull):
    """The convex hull of recent points: those younger than `max_age`, the `max_points` youngest, or both.

    Args:
        max_age: a finite positive number in the unit of the times. At time t, no point of time t - max_age or before is
            in the window; the comparison is exact.
        max_points: an integer, at least 1. The oldest points leave until this many are left; of equally old points, the
            one that arrived first.

    At least one of the two is required.

    The window has a clock of its own, `now`, the greatest time that it has seen; it never goes back. A real-time window
    is moved with `advance`.

    Every method raises ValueError or TypeError for bad input, which names the first bad row, and nothing changes. The
    queries and measures are those of DynamicHull.

    >>> from dynhull import WindowHull
    >>> window = WindowHull(max_age=60.0)
    >>> window.add([[0, 0], [4, 0], [0, 3]], times=[0.0, 10.0, 20.0])
    3
    >>> window.area
    6.0
    >>> window.advance(60.0)
    1
    >>> window.points().tolist(), window.times().tolist()
    ([[0.0, 3.0], [4.0, 0.0]], [20.0, 10.0])
    """

    __slots__ = ()
    _tree_type: ClassVar[type[WindowTree | _kernel.WindowTree]] = WindowTree if kernel is None else kernel.WindowTree

    def __init__(self, max_age: float | None = None, max_points: int | None = None) -> None:
        self._tree = self._tree_type(*checked_limits(max_age, max_points))
        self._measured = UNMEASURED

    # As a value

    def __getstate__(self) -> tuple[Any, ...]:
        return self.max_age, self.max_points, self._tree.state()

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        max_age, max_points, contents = state
        self._tree = self._tree_type(max_age, max_points)
        self._tree.restore(*contents)
        self._measured = UNMEASURED


def checked_limits(max_age: float | None, max_points: int | None) -> tuple[float | None, int | None]:
    """The limits of a window, checked."""
    if max_age is None and max_points is None:
        raise ValueError("max_age and max_points are both None: a window needs at least one of them")
    return _as_age(max_age), None if max_points is None else as_count(max_points, "max_points", least=1)


def _as_age(max_age: float | None) -> float | None:
    if max_age is None:
        return None
    age = as_time(max_age, "max_age")
    if age <= 0:
        raise ValueError(f"max_age is {age!r}: must be positive")
    return age
