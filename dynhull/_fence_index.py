"""FenceIndex: many areas against the entities of a keyed hull, and who crosses their boundaries."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any

import numpy as np

from ._crossings import NO_CROSSINGS, Crossings, PackedCrossings, only_shared, pack
from ._entities import Entities
from ._fences import Fences
from ._implementation import kernel
from ._keyed import KeyedHull
from ._metres import MOST_METRES, Metres
from ._predicates import orient2d
from ._rings import as_polygons
from .arrays import as_coordinate, as_points
from .keys import Keys, as_keys, key_list, take_keys

if TYPE_CHECKING:
    import numpy.typing as npt

    from . import _kernel
    from ._globe import Gnomonic
    from .arrays import Points

LEAST_FENCE, GREATEST_FENCE = -(2**63), 2**63 - 1


class FenceIndex:
    """Fences, each a number and an area, and which subjects are inside: the entities of a keyed hull. Exact.

    The hull keeps the index informed from now on: every change of the hull is seen by the next `take`, which returns
    the crossings since the last one. Only the states before and after count. A subject enters at the area, and leaves
    when it is farther than the fence's margin from it.

    Args:
        subjects: the hull whose entities are the subjects. A hull has one index at a time. A copy of it has none.
        frame: the projection (`dynhull.globe.Gnomonic`) of which the plane is. Margins and distances are then metres on
            WGS 84, within a micrometre up to 250 km, and the same on every machine; a distance of more is inf, and a
            margin is at most that. Places are within reach of the projection, areas within 88 degrees of its centre. No
            disks, and no `without_self`.

    Raises:
        ValueError: the hull has an index already.
        TypeError: the subjects are no `KeyedHull`.

    A subject that stays away from all boundaries costs O(1) a move, others O(log n) for each fence nearby. A new or
    changed area costs O(log n) for each of its edges that changed, and for each subject near those. The implementation
    in Python looks at every changed subject for every fence.

    Areas are closed (their boundary belongs to them) or open. The methods that set one take

    * fence: any integer of 64 bits; the area of a fence that is there is replaced;
    * closed: whether a subject on the boundary is inside;
    * margin: how far outside of the area a subject that is inside has to be to leave; finite, not negative;
    * cross: whether `take` reports subjects that pass through, outside before and after;
    * inside: for a fence restored, the keys that are inside, in any order; those that are not there are ignored. None
      for a new fence: a subject is inside if it is in the area, whatever the margin; and for a replaced area: the
      subjects that were inside.

    The first state of a new fence is decided at once and is no crossing. Where the keys inside are given, what
    contradicts them is reported by the next `take`, as when an area is replaced.

    >>> import dynhull
    >>> fleet = dynhull.KeyedHull()
    >>> fences = dynhull.FenceIndex(fleet)
    >>> fences.set_polygons(7, [[[[0, 0], [4, 0], [0, 4]]]])
    >>> fleet.put("UA17", 1, 1)
    True
    >>> found = fences.take()
    >>> found.fences.tolist(), found.changes.tolist(), list(found.keys), found.causes.tolist()
    ([7], [1], ['UA17'], [4])
    """

    __slots__ = ("_carried", "_fences", "_on_globe", "_subjects")

    def __init__(self, subjects: KeyedHull, frame: Gnomonic | None = None) -> None:
        if not isinstance(subjects, KeyedHull):
            raise TypeError(
                f"subjects is a {type(subjects).__name__}: must be a KeyedHull, whose places are in the plane"
            )
        tree = subjects._tree
        self._subjects = subjects
        self._on_globe = frame is not None
        self._carried: dict[str | int, FenceIndex] = {}  # keys from other indexes, since crossings were last taken
        self._fences: Fences | _kernel.Fences
        if isinstance(tree, Entities):
            self._fences = Fences(tree, None if frame is None else Metres(frame))
        else:
            assert kernel is not None
            self._fences = kernel.Fences(tree, None if frame is None else (frame._sin[0], frame._cos[0]))

    def detach(self) -> None:
        """Let the hull forget the index, which sees no more of its changes."""
        self._fences.detach()

    # Areas

    def set_polygons(
        self,
        fence: int,
        polygons: Any,
        *,
        closed: bool = True,
        margin: float = 0.0,
        cross: bool = False,
        inside: Any = None,
    ) -> None:
        """Set the area to polygons with holes, joined by "or". All rings are boundary.

        Args:
            fence: the number.
            polygons: polygons, each a sequence of rings, the exterior first, then holes; each ring (k, 2) array-like,
                in either direction, with or without the first corner at its end. Edges of a polygon may touch at their
                ends, but those of a ring only its neighbours. Or `dynhull.polygons.CheckedPolygons`.
            closed: see above, as the others.
            margin: see above.
            cross: see above.
            inside: see above.

        Raises:
            ValueError: a ring has fewer than three corners, no area, edges that cross or overlap, or is a hole that is
                not inside its exterior or overlaps another; a coordinate is not finite; the margin is bad. The message
                names the polygon and the ring. Nothing has changed.
        """
        self._fences.set_polygons(
            _number(fence),
            as_polygons(polygons),
            bool(closed),
            self._margin(margin),
            bool(cross),
            self._keys(inside),
        )

    def set_circle(
        self,
        fence: int,
        x: float,
        y: float,
        radius: float,
        *,
        closed: bool = True,
        margin: float = 0.0,
        cross: bool = False,
        inside: Any = None,
    ) -> None:
        """Set the area to a disk: all points whose distance from (x, y) is at most, if open below, the radius.

        Raises:
            ValueError: a coordinate is not finite, or the radius or the margin is negative; or the index has a `frame`.
                Nothing has changed.
        """
        if self._on_globe:
            raise ValueError("a disk of the plane is none on the globe: set the polygon that stands for it")
        self._fences.set_circle(
            _number(fence),
            as_coordinate(x, "x"),
            as_coordinate(y, "y"),
            as_length(radius, "radius"),
            bool(closed),
            as_length(margin, "margin"),
            bool(cross),
            self._keys(inside),
        )

    def set_hull(
        self,
        fence: int,
        vertices: npt.ArrayLike,
        *,
        closed: bool = True,
        margin: float = 0.0,
        cross: bool = False,
        without_self: bool = False,
        inside: Any = None,
    ) -> None:
        """Set the area to a convex polygon. To be called again with all vertices when it has changed.

        Args:
            fence: the number.
            vertices: (h, 2) as `vertices` of a hull returns them: counter-clockwise from the least, strictly convex.
                No vertices: an empty area. One or two: a point or a segment, which hold what lies on them if closed.
            closed: see above, as the others.
            margin: see above.
            cross: see above.
            without_self: the area is the hull of the subjects themselves, at any time: `vertices` are not read, and
                the fence need not be set again. A subject is compared with the hull of the others, so that one that
                is a vertex leaves when it is farther from them than the margin, which must be positive.
            inside: see above.

        Raises:
            ValueError: the vertices are not those of a convex polygon, or not finite; the margin is bad; or
                `without_self` without a margin or with an open area. Nothing has changed.
        """
        number, corners, distance = _number(fence), as_points(vertices, "vertices"), self._margin(margin)
        if without_self and self._on_globe:
            raise ValueError("without_self is for the plane: the index has a frame")
        if without_self and not distance > 0:
            raise ValueError(
                "margin is 0.0: without_self needs a positive margin, as no vertex is inside of the others"
            )
        if without_self and not closed:
            raise ValueError("closed is False: with without_self the area is closed")
        if not without_self:
            require_convex(corners)
        self._fences.set_hull(
            number, corners, bool(closed), distance, bool(cross), bool(without_self), self._keys(inside)
        )

    def drop(self, fence: int) -> Keys:
        """Remove a fence. Returns the keys that were inside, ascending, as `inside` does."""
        return self._fences.drop(self._present(fence))

    # Reading

    def inside(self, fence: int) -> Keys:
        """The keys inside at the last `take` or when the fence was set, ascending: `PackedKeys` or uint64.

        Raises:
            KeyError: there is no such fence.
        """
        return self._fences.inside(self._present(fence))

    def count(self, fence: int) -> int:
        """The number of keys inside, like `inside`. O(1)."""
        return self._fences.count(self._present(fence))

    def distances(self, fence: int, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """The distances of points to the area of a fence, as `take` returns those of subjects. O(log n) a point.

        With `without_self` that is the hull without the only subject at the point, if there is one.

        Args:
            fence: the number.
            xy: (k, 2) points.

        Returns:
            (k,) each the exact value rounded once: 0.0 inside and on the boundary, inf from an empty area. With a
            `frame`, metres as above.

        Raises:
            KeyError: there is no such fence.
            ValueError: a point is not finite.

        >>> import dynhull
        >>> fences = dynhull.FenceIndex(dynhull.KeyedHull())
        >>> fences.set_polygons(7, [[[[0, 0], [4, 0], [0, 4]]]])
        >>> fences.distances(7, [[1, 1], [4, -3], [-3, -4]]).tolist()
        [0.0, 3.0, 5.0]
        """
        return self._fences.distances(self._present(fence), as_points(xy, "xy"))

    def clear(self, fence: int, xy: npt.ArrayLike, errors: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether positions that may be wrong by an error are certainly on their side of the boundary.

        A point inside is if its distance to the rings of a polygon that it is in, or to the circle, is more than its
        error; one outside, if its distance to the area is more than the fence's margin and its error together. O(log n)
        a point, and O(1) for each edge so near. With `without_self` the area is the hull without the only subject at
        the point, if there is one. In the plane it is exact; with a `frame`, errors are in metres, and distances are
        those of `distances`.

        Args:
            fence: the number.
            xy: (k, 2) points.
            errors: (k,) how far each may be from where it really is; finite, not negative. With a `frame`, at most
                250,000 less the margin: a greater distance is not known.

        Returns:
            (k,) True for a point without an error, wherever it is, and for all of an empty area.

        Raises:
            KeyError: there is no such fence.
            ValueError: a number is not finite, or an error is negative or too great.

        >>> import dynhull
        >>> fences = dynhull.FenceIndex(dynhull.KeyedHull())
        >>> fences.set_circle(7, 0, 0, 10)
        >>> fences.clear(7, [[3, 4], [3, 4], [9, 12], [9, 12]], [5, 4.5, 5, 4.5]).tolist()
        [False, True, False, True]
        """
        points, radii = as_points(xy, "xy"), np.asarray(errors, np.float64)
        if radii.shape != (len(points),):
            raise ValueError(f"errors have the shape {radii.shape}: must be ({len(points)},), one for each point")
        bad = ~((radii >= 0) & (radii < np.inf))
        if bad.any():
            row = int(np.argmax(bad))
            raise ValueError(f"errors row {row} is {radii[row]}: must be finite and not negative")
        number = self._present(fence)
        if self._on_globe:
            most = MOST_METRES - self._fences.margin(number)
            if (radii > most).any():
                row = int(np.argmax(radii > most))
                raise ValueError(
                    f"errors row {row} is {radii[row]}: at most {most:g} metres with the margin of the fence"
                )
        return self._fences.clear(number, points, np.ascontiguousarray(radii))

    def __contains__(self, fence: object) -> bool:
        """Whether there is a fence of this number."""
        return isinstance(fence, int | np.integer) and self._fences.has(int(fence))

    def __len__(self) -> int:
        """The number of fences."""
        return len(self._fences)

    def carry(self, source: FenceIndex, keys: Any) -> npt.NDArray[np.bool_]:
        """Let entities that were removed from one hull and put into another have moved, in fences of both indexes.

        To be called when both hulls have changed, before `take`. Such a subject takes its state along: the next `take`
        of this index compares it with its place in the other hull, and reports the change 2 if it was inside there and
        is inside here; that of `source` does not report that it left. For other fences it is gone there, and new here.

        Args:
            source: the index of the other hull.
            keys: n keys that both hulls may have.

        Returns:
            (n,) which of them have moved: those that were removed from the other hull, other than by `expire` and
            `evict`, and are new in this one, and that no other `carry` has taken.

        Raises:
            ValueError: `source` is this index, or the keys of the hulls are of different types.

        O(k) for k keys, the subjects that have left there and those that have come or moved here since the last `take`.

        >>> import dynhull
        >>> yard, road = dynhull.KeyedHull(), dynhull.KeyedHull()
        >>> before, after = dynhull.FenceIndex(yard), dynhull.FenceIndex(road)
        >>> yard.put("van", 1, 1)
        True
        >>> for fences in before, after:
        ...     fences.set_circle(7, 0, 0, 5)
        ...     _ = fences.take()  # from now on the van is known
        >>> yard.remove("van"), road.put("van", 2, 2)
        (True, True)
        >>> after.carry(before, ["van"]).tolist()
        [True]
        >>> found = after.take()
        >>> found.changes.tolist(), found.previous.tolist(), len(before.take())
        ([2], [[1.0, 1.0]], 0)
        """
        if source is self or source._subjects.key_type != self._subjects.key_type:
            raise ValueError("source must be the index of another hull with keys of the same type")
        own = as_keys(keys, self._subjects.key_type, "keys")
        carried = self._fences.carry(source._fences, own)  # type: ignore[arg-type]  # both are of one implementation
        if carried.any():
            self._carried.update(dict.fromkeys(key_list(take_keys(own, np.flatnonzero(carried))), source))
        return carried

    def take(self) -> Crossings:
        """The crossings since the last `take`: of each fence and subject what differs between then and now.

        A key that was removed and put again has moved. A key that is gone leaves the fences that it was inside of.
        O(1) if nothing has come near a boundary and no area has changed.

        Raises:
            MemoryError: memory does not suffice. No crossing is lost: the next call returns it.
        """
        packed = self.take_packed()
        return NO_CROSSINGS[self._subjects.key_type] if packed is None else packed.unpack()

    def take_packed(self) -> PackedCrossings | None:
        """The crossings as `take` has them, packed: for who passes many on and looks at few. None if there are none."""
        taken = self._fences.take()
        if self._carried:
            carried, self._carried = self._carried, {}
            if taken is not None:
                taken = pack(only_shared(PackedCrossings._make(taken).unpack(), carried))
        return None if taken is None else PackedCrossings._make(taken)

    def _margin(self, margin: float) -> float:
        length = as_length(margin, "margin")
        if self._on_globe and length > MOST_METRES:
            raise ValueError(f"margin is {length!r}: at most {MOST_METRES:g} metres on the globe")
        return length

    def _keys(self, inside: Any) -> Keys | None:
        return None if inside is None else as_keys(inside, self._subjects.key_type, "inside")

    def _present(self, fence: int) -> int:
        number = _number(fence)
        if not self._fences.has(number):
            raise KeyError(f"there is no fence {number}")
        return number


def _number(fence: int) -> int:
    number = operator.index(fence)
    if not LEAST_FENCE <= number <= GREATEST_FENCE:
        raise ValueError(f"fence is {number}: must be an integer of 64 bits")
    return number


def as_length(value: float, name: str) -> float:
    length = as_coordinate(value, name)
    if length < 0:
        raise ValueError(f"{name} is {length!r}: must not be negative")
    return length


def require_convex(vertices: Points) -> None:
    """Raise ValueError unless these are what `vertices` of a hull may return. O(h)."""
    if len(vertices) < 2:
        return
    after = np.roll(vertices, -1, axis=0)
    ascends = (vertices[:, 0] < after[:, 0]) | ((vertices[:, 0] == after[:, 0]) & (vertices[:, 1] < after[:, 1]))
    last = max(int(np.argmin(ascends)), 1)  # the greatest vertex, if the chains go up to it and back down
    turns = np.asarray(orient2d(vertices, after, np.roll(vertices, -2, axis=0)))
    wrong = np.flatnonzero(ascends != (np.arange(len(vertices)) < last))
    if len(vertices) > 2:
        wrong = np.concatenate([wrong, np.flatnonzero(turns <= 0)])
    if wrong.size:
        row = int(wrong.min())
        raise ValueError(
            f"vertices row {row} is {vertices[row].tolist()}: not those of a hull, counter-clockwise from the least"
        )
