"""A watcher's own copy of a hull."""

from __future__ import annotations

from math import inf
from threading import Lock
from time import monotonic
from typing import TYPE_CHECKING, Any

import grpc
import numpy as np

from dynhull import DynamicHull, GeoHull
from dynhull._shown import Shown

from ._errors import HullNotFoundError, HullUnsuitableError, StaleCopyError
from ._messages import Change, Deleted, Snapshot, shown_geometry, shown_svg

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from dynhull.arrays import Points

    from ._keys import KeyTuple
    from ._messages import Event


class HullCopy(Shown):
    """A copy of a watched hull, updated event by event, that answers questions without a call.

    Its answers are those of a `dynhull.DynamicHull` of the vertices: exact, and at the revision of the last event. They
    take the time of the library, O(log h) each; the first one after a snapshot takes O(h log h). Without a hull, before
    the first snapshot and after a deletion, questions raise HullNotFoundError.

    A copy of a geographic hull answers as `dynhull.GeoHull` does, in degrees and metres. Questions that this class does
    not answer raise HullUnsuitableError.

    Threads may share a copy: an answer is of one revision, that before or after an event that another thread applies.
    For several answers at the same revision, ask a `copy()`. It has a GeoJSON geometry and a picture, as `Hull` has.

    Args:
        max_staleness: seconds without an event after which questions raise StaleCopyError; None for never. The time is
            that since the copy was updated: a program that stops reading its watch has a stale copy, too.

    Attributes:
        uid: identifies the hull; empty before the first snapshot and after a deletion.
        revision: the revision of the last event; 0 before the first.
        points: the number of points at that revision, duplicates included.
        vertices: (h, 2) counter-clockwise from the lexicographically smallest; exactly the hull's at that revision.
            Read-only.
        vertex_keys: the key of each vertex; None unless the watch has `keys=True`.
        center: longitude and latitude of the centre of a geographic hull; None for a plane.
        max_staleness: as given; it may be changed.
    """

    uid: str
    revision: int
    points: int
    vertices: Points
    vertex_keys: KeyTuple | None
    center: tuple[float, float] | None
    _hull: DynamicHull | GeoHull | None

    def __init__(self, *, max_staleness: float | None = None) -> None:
        if max_staleness is not None and not 0 < max_staleness < inf:
            raise ValueError(f"max_staleness must be positive and finite, got {max_staleness}")
        self.max_staleness = max_staleness
        self._updated = -inf
        self._updating = Lock()
        self._clear()

    def update(self, event: Event) -> None:
        """Apply an event. O(h)."""
        with self._updating:
            if isinstance(event, Deleted):
                self._clear()
                return
            if isinstance(event, Snapshot):
                self.vertices, self.uid, self.vertex_keys = event.vertices, event.uid, event.vertex_keys
                self._hull, self._known = None, True
            elif isinstance(event, Change):
                self.vertex_keys = _changed_keys(self.vertex_keys, len(self.vertices), event)
                if self._hull is not None:
                    _apply(self._hull, self.vertices[event.removed_rows], event.added)
                self.vertices = _changed(self.vertices, event)
            if event.center != self.center:
                self._hull = None
            self.revision, self.points, self.center = event.revision, event.points, event.center
            self._updated = monotonic()

    def clear(self) -> None:
        """Hold no hull, as after its deletion."""
        with self._updating:
            self._clear()

    def follow(self, watch: Iterator[Event], revision: int) -> None:
        """Apply events of the watch until the copy has reached the revision or a later one."""
        while self.revision < revision:
            self.update(next(watch))

    def copy(self) -> HullCopy:
        """A copy that no watch updates, at one revision. O(h)."""
        new = HullCopy(max_staleness=self.max_staleness)
        with self._updating:
            new.__setstate__(self.__getstate__())
        return new

    @property
    def age(self) -> float:
        """The seconds since the last event; infinite before the first. The copy was up to date when it was sent."""
        return monotonic() - self._updated

    # Questions

    def locate(self, xy: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """(k,) signs of (k, 2) points: +1 inside, 0 on the boundary, -1 outside. Exact."""
        return self._held().locate(xy)

    def contains(self, xy: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(k,) booleans: which of (k, 2) points are inside or on the boundary. Exact."""
        return self._held().contains(xy)

    def support(self, directions: npt.ArrayLike) -> Points:
        """(k, 2) extreme vertices, one for each of (k, 2) directions. Exact. ValueError for a hull without points."""
        return self._flat().support(directions)

    def tangents(self, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k, 2, 2) left and right tangent points seen from each of (k, 2) points; NaN if not outside. Exact."""
        return self._held().tangents(xy)

    def distance(self, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k,) distances of (k, 2) points: 0.0 inside and on the boundary, inf from a hull without points."""
        return self._held().distance(xy)

    def intersect_lines(self, p: npt.ArrayLike, q: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k, 2, 2) points where the lines through (k, 2) points p and q enter and leave the hull; NaN if they miss."""
        return self._flat().intersect_lines(p, q)

    @property
    def area(self) -> float:
        """Area, the exact value rounded once."""
        return self._held().area

    @property
    def perimeter(self) -> float:
        """Length of the boundary; two vertices count twice."""
        return self._held().perimeter

    @property
    def centroid(self) -> tuple[float, float]:
        """Centre of area; NaN without points."""
        return self._flat().centroid

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least x, least y, greatest x, greatest y; on the globe west, south, east, north. NaN without points."""
        return self._held().bounds

    def label_point(self) -> tuple[float, float]:
        """A point strictly inside, for a label; a vertex where there is none."""
        return self._held().label_point()

    def diameter(self) -> float:
        """The greatest distance of two points."""
        return self._held().diameter()

    def width(self) -> float:
        """The least distance of parallel lines with all points between."""
        return self._flat().width()

    def min_box(self) -> Points:
        """(4, 2) corners, counter-clockwise, of the box of least area in any orientation."""
        return self._flat().min_box()

    def min_perimeter_box(self) -> Points:
        """(4, 2) corners of the box of least perimeter."""
        return self._flat().min_perimeter_box()

    def min_circle(self) -> tuple[tuple[float, float], float]:
        """Centre and radius of the smallest enclosing circle."""
        return self._flat().min_circle()

    # As a value

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry."""
        return shown_geometry(self.vertices, self.center)

    def __repr__(self) -> str:
        return f"<HullCopy at revision {self.revision}: {self.points} points, {len(self.vertices)} vertices>"

    def _repr_svg_(self) -> str:
        return shown_svg(self.vertices, self.center, repr(self))

    def __getstate__(self) -> dict[str, Any]:
        """Without the lock, and without what can be made again."""
        return {name: value for name, value in vars(self).items() if name not in ("_hull", "_updating")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _hull=None, _updating=Lock())

    def _held(self) -> DynamicHull | GeoHull:
        """The hull, if it is there and not too old."""
        if self.max_staleness is not None and monotonic() - self._updated > self.max_staleness:
            self._require_hull()
            raise _stale(self.age, self.max_staleness)
        hull = self._hull
        return self._made() if hull is None else hull

    def _made(self) -> DynamicHull | GeoHull:
        with self._updating:
            self._require_hull()
            if self._hull is None:
                center = self.center
                self._hull = DynamicHull(self.vertices) if center is None else GeoHull(self.vertices, center)
            return self._hull

    def _flat(self) -> DynamicHull:
        """The same for a question that a hull on the globe does not answer."""
        hull = self._held()
        if isinstance(hull, DynamicHull):
            return hull
        message = (
            "a copy of a geographic hull answers locate, contains, tangents, distance, area, perimeter, bounds, "
            "label_point and diameter; ask the server for the rest"
        )
        raise HullUnsuitableError(message, grpc.StatusCode.FAILED_PRECONDITION, "", {})

    def _require_hull(self) -> None:
        if not self._known:
            message = "the copy holds no hull: it has received none, or the hull was deleted"
            raise HullNotFoundError(message, grpc.StatusCode.NOT_FOUND, "", {})

    def _clear(self) -> None:
        self.uid = ""
        self.revision = 0
        self.points = 0
        self.vertices = np.empty((0, 2))
        self.vertex_keys = None
        self.center = None
        self._hull = None
        self._known = False


def _apply(hull: DynamicHull | GeoHull, removed: Points, added: Points) -> None:
    """Change the vertices by one batch: no question sees a part of it."""
    ops = np.repeat(np.array([-1, 1], np.int8), (len(removed), len(added)))
    hull.apply(ops, np.concatenate((removed, added)))


def _stale(age: float, limit: float) -> StaleCopyError:
    message = f"the copy was updated {age:.3g} s ago, which is more than its max_staleness of {limit:g} s"
    return StaleCopyError(message, grpc.StatusCode.UNAVAILABLE, "", {"value": f"{age:.3g}"})


def _changed(vertices: Points, change: Change) -> Points:
    changed: Points = _edited(vertices, change.added, change)
    changed.flags.writeable = False
    return changed


def _changed_keys(keys: KeyTuple | None, count: int, change: Change) -> KeyTuple | None:
    """The keys after a change; those of a copy that had none are all among the renamed ones."""
    if change.added_keys is None or change.renamed_keys is None:
        return None
    before = np.empty(count, object) if keys is None else np.array(keys, object)
    changed = _edited(before, np.array(change.added_keys, object), change)
    changed[change.renamed_rows] = change.renamed_keys
    return tuple(changed.tolist())


def _edited(rows: npt.NDArray[Any], added: npt.NDArray[Any], change: Change) -> npt.NDArray[Any]:
    kept = np.roll(np.delete(rows, change.removed_rows, axis=0), -change.rotation, axis=0)
    changed = np.empty((len(kept) + len(added), *rows.shape[1:]), rows.dtype)
    is_added = np.zeros(len(changed), np.bool_)
    is_added[change.added_rows] = True
    changed[is_added] = added
    changed[~is_added] = kept
    return changed
