"""The hull tree in C++, with the same results as the one in Python."""

from typing import Annotated, Any, overload

import numpy
import numpy.typing
from numpy.typing import NDArray

import dynhull.arrays
import dynhull.keys


class LastVertices:
    """The vertices that a hull had when they were last taken."""

    def __init__(self) -> None: ...

    def __len__(self) -> int: ...

    def points(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """The vertices."""

    @property
    def changes(self) -> int:
        """The hull's number of changes when they were taken; -1 before that."""

class VertexTaker:
    """Takes the vertices of a hull where a sign of it is as it was."""

    def take(self) -> bool:
        """Take them, and say whether that was so. O(h log n), or O(h²) of few."""

class HullTree:
    """
    A multiset of points and its convex hull: see dynhull's tree in Python.
    """

    def __init__(self, xy: object | None = None) -> None: ...

    def __len__(self) -> int: ...

    @property
    def distinct(self) -> int:
        """The number of different points."""

    @property
    def changes(self) -> int:
        """The number of updates that changed the hull."""

    @changes.setter
    def changes(self, arg: int, /) -> None: ...

    def count(self, x: float, y: float) -> int:
        """The number of copies of the point. O(log n)."""

    def count_many(self, xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.int64], dict(shape=(None,))]:
        """The number of copies of each point. O(log n) a row."""

    def clear(self) -> None:
        """Remove every point."""

    def points(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """All points in lexicographic order, with multiplicity. O(n)."""

    def vertices(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """The hull's vertices, counter-clockwise from the least. O(h log n)."""

    def take_vertices(self, last: LastVertices) -> None:
        """Take the vertices. O(h log n)."""

    def vertex_taker(self, last: LastVertices, measure: str, bound: float, least: int, most: int) -> VertexTaker:
        """
        What takes the vertices where the sign of a measure less a bound is certain, as `sign_of_measure` has it, and at least `least` and at most `most`.
        """

    def chain(self, side: int) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """The upper (0) or lower (1) chain from left to right. O(h log n)."""

    def locate(self, xy: object) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]:
        """For each row +1 inside, 0 on the boundary, -1 outside. O(log n) a row."""

    def support(self, directions: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """
        The farthest vertex in each direction, the lexicographically smaller of two. O(log n) a row.
        """

    def tangents(self, xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2, 2))]:
        """
        The left and the right tangent point seen from each row, NaN unless the row is outside. O(log n) a row.
        """

    def distance(self, xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
        """
        The distance of each row to the hull, rounded once; infinite without points. O(log n) a row.
        """

    def intersect_lines(self, p: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], q: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2, 2))]:
        """
        Where the line through p and q of each row enters and leaves the hull; NaN if it misses. p and q differ. O(log n) a row.
        """

    def layers(self, count: int) -> list[Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]]:
        """
        The vertices of the outermost convex layers, each counter-clockwise from the least. O(log² n) a vertex.
        """

    def influence(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
        """
        For each vertex the area that goes with it, rounded once. O(log² n) a vertex.
        """

    def sketch(self, most: int) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None, 2))], Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]]:
        """
        At most that many vertices, at least 4; and three rows for each edge of theirs beyond which the hull has others: its ends and the farthest of those. O(most log n).
        """

    def copy(self) -> HullTree:
        """An independent tree of the same points. O(n)."""

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken. O(n log n)."""

    @property
    def memory(self) -> tuple[int, int]:
        """The bytes that the tree uses, and the bytes that it reserves."""

    def insert(self, x: float, y: float) -> bool:
        """Add a point. True if the hull changed. O(log² n)."""

    def delete(self, x: float, y: float) -> bool:
        """
        Remove one copy of a point. True if the hull changed; KeyError if the point is missing. O(log² n).
        """

    @overload
    def apply(self, op: int, xy: object | None, ignore_missing: bool, together: bool | None = None) -> int:
        """Insert all rows (+1) or delete all rows (-1)."""

    @overload
    def apply(self, ops: Annotated[NDArray[numpy.int8], dict(shape=(None,), order='C', device='cpu', writable=False)], xy: object | None, ignore_missing: bool, together: bool | None = None) -> int:
        """
        Insert the rows with +1 and delete those with -1, as a set. Returns the number of rows applied. A row that deletes a missing point raises KeyError(x, y, row), unless `ignore_missing`. `together` forces divide and conquer (True) or one change after the other (False); by default the batch decides.
        """

class PackedEntities:
    """Entities that nobody has used since they were loaded."""

    def __len__(self) -> int: ...

    @property
    def distinct(self) -> int:
        """The number of distinct places."""

    @property
    def vertex_count(self) -> int:
        """The number of vertices."""

    def entities(self) -> Entities:
        """The entities, which are put together when they are used."""

class Entities:
    """Entities and their convex hull: see dynhull's class in Python."""

    def __init__(self, key_type: dynhull.keys.KeyType = 'str', ordered: bool = False) -> None: ...

    def __len__(self) -> int: ...

    @property
    def distinct(self) -> int:
        """The number of different points."""

    @property
    def changes(self) -> int:
        """The number of updates that changed the hull."""

    @changes.setter
    def changes(self, arg: int, /) -> None: ...

    def count(self, x: float, y: float) -> int:
        """The number of copies of the point. O(log n)."""

    def count_many(self, xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.int64], dict(shape=(None,))]:
        """The number of copies of each point. O(log n) a row."""

    def clear(self) -> None:
        """Remove every point."""

    def points(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """All points in lexicographic order, with multiplicity. O(n)."""

    def vertices(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """The hull's vertices, counter-clockwise from the least. O(h log n)."""

    def take_vertices(self, last: LastVertices) -> None:
        """Take the vertices. O(h log n)."""

    def vertex_taker(self, last: LastVertices, measure: str, bound: float, least: int, most: int) -> VertexTaker:
        """
        What takes the vertices where the sign of a measure less a bound is certain, as `sign_of_measure` has it, and at least `least` and at most `most`.
        """

    def chain(self, side: int) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """The upper (0) or lower (1) chain from left to right. O(h log n)."""

    def locate(self, xy: object) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]:
        """For each row +1 inside, 0 on the boundary, -1 outside. O(log n) a row."""

    def support(self, directions: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """
        The farthest vertex in each direction, the lexicographically smaller of two. O(log n) a row.
        """

    def tangents(self, xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2, 2))]:
        """
        The left and the right tangent point seen from each row, NaN unless the row is outside. O(log n) a row.
        """

    def distance(self, xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
        """
        The distance of each row to the hull, rounded once; infinite without points. O(log n) a row.
        """

    def intersect_lines(self, p: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], q: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2, 2))]:
        """
        Where the line through p and q of each row enters and leaves the hull; NaN if it misses. p and q differ. O(log n) a row.
        """

    def layers(self, count: int) -> list[Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]]:
        """
        The vertices of the outermost convex layers, each counter-clockwise from the least. O(log² n) a vertex.
        """

    def influence(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
        """
        For each vertex the area that goes with it, rounded once. O(log² n) a vertex.
        """

    def sketch(self, most: int) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None, 2))], Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]]:
        """
        At most that many vertices, at least 4; and three rows for each edge of theirs beyond which the hull has others: its ends and the farthest of those. O(most log n).
        """

    def copy(self) -> Entities:
        """An independent tree of the same points. O(n)."""

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken. O(n log n)."""

    @property
    def memory(self) -> tuple[int, int]:
        """The bytes that the tree uses, and the bytes that it reserves."""

    @property
    def key_type(self) -> dynhull.keys.KeyType:
        """The kind of the keys, "str" or "int"."""

    @property
    def ordered(self) -> bool:
        """Whether a put that is older than the entity changes nothing."""

    def update(self, keys: object | None, xy: object | None, times: object | None, only: object | None) -> tuple[int, int, int, int, int]:
        """
        Insert or move the entity of each row, as one batch. Returns the numbers of rows that were new, moved, unmoved, stale and skipped.
        """

    def load(self, keys: object | None, xy: object | None, times: object | None) -> None:
        """Put all rows; a time that is NaN means none."""

    def begin_load(self, room: int = 0) -> None:
        """
        Put off the tree, for some calls of `load` and `remove_many`; with room for that many entities.
        """

    def end_load(self) -> None:
        """Build the tree. O(n log n)."""

    def packed(self, most: int) -> PackedEntities | None:
        """
        What was loaded, in place of `end_load`; None if it is more than so many entities. O(n log n).
        """

    def put(self, key: object, x: float, y: float, time: float | None, only: str | None) -> bool:
        """Insert or move one entity. True if the hull changed. O(log² n)."""

    def remove(self, key: object | None) -> bool:
        """
        Remove one entity. True if the hull changed; MissingKeyError if there is none. O(log² n).
        """

    def remove_many(self, keys: object | None, ignore_missing: bool) -> int:
        """Remove entities as one batch. Returns their number."""

    def expire(self, until: object | None) -> int:
        """Remove every entity with a time of at most `until`. O(n)."""

    def evict(self, count: int) -> int:
        """Remove the oldest entities, those without a time first. O(n)."""

    def has(self, key: object | None) -> bool:
        """Whether there is an entity of the key. O(1)."""

    def position(self, key: object | None) -> tuple[float, float]:
        """The place of an entity. O(1)."""

    def positions(self, keys: object | None) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))]:
        """The place of each key, NaN where it is missing. O(1) a row."""

    def times(self, keys: object | None) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
        """The time of each key, NaN where there is none. O(1) a row."""

    def entities(self) -> tuple[dynhull.keys.Keys, dynhull.arrays.Points, dynhull.arrays.Points]:
        """Keys in order, places and times. O(n log n)."""

    def pack(self, idle: bool) -> bool:
        """
        Hold the entities in less memory until they are needed, `idle` unless they were since the last such call. Whether they are held so. O(n), and O(n log n) when they are needed.
        """

    def oldest(self) -> float | None:
        """The least time; None if no entity has one. O(n)."""

    def keys_at(self, xy: object) -> list[Any]:
        """The least key at each place, None where there is none."""

    def vertex_keys(self) -> list[Any]:
        """The least key at each vertex, in the order of `vertices`."""

class Fences:
    """Fences of one set of entities: see dynhull's class in Python."""

    def __init__(self, entities: Entities, latitude: tuple[float, float] | None) -> None: ...

    def detach(self) -> None:
        """End the reports of the entities."""

    def __len__(self) -> int: ...

    def has(self, fence: int) -> bool:
        """Whether there is a fence of this number."""

    def set_polygons(self, fence: int, polygons: list[list[dynhull.arrays.Points]], closed: bool, margin: float, cross: bool, inside: dynhull.keys.Keys | None) -> None:
        """Add or replace a fence around polygons."""

    def set_circle(self, fence: int, x: float, y: float, radius: float, closed: bool, margin: float, cross: bool, inside: dynhull.keys.Keys | None) -> None:
        """Add or replace a fence around a disk."""

    def set_hull(self, fence: int, vertices: dynhull.arrays.Points, closed: bool, margin: float, cross: bool, without_self: bool, inside: dynhull.keys.Keys | None) -> None:
        """
        Add or replace a fence around a convex hull; `without_self` around that of the entities.
        """

    def drop(self, fence: int) -> dynhull.keys.Keys:
        """Remove a fence. Returns the keys that were inside."""

    def inside(self, fence: int) -> dynhull.keys.Keys:
        """The keys inside, in order."""

    def count(self, fence: int) -> int:
        """The number of keys inside."""

    def margin(self, fence: int) -> float:
        """The margin."""

    def distances(self, fence: int, places: dynhull.arrays.Points) -> numpy.typing.NDArray[numpy.float64]:
        """
        The distances of places to the area; of entities, to that of the others.
        """

    def clear(self, fence: int, places: dynhull.arrays.Points, errors: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.bool_]:
        """
        Which places are farther than their errors from the boundary; of entities, from that of the others.
        """

    def carry(self, source: Fences, keys: dynhull.keys.Keys) -> numpy.typing.NDArray[numpy.bool_]:
        """Let keys that were removed there and are new here have moved."""

    def take(self) -> tuple[bytes, bytes | None, bytes] | None:
        """
        What has crossed since the last call, as in `PackedCrossings`; None if nothing has.
        """

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken."""

    @property
    def memory(self) -> int:
        """The bytes that the index uses."""

class WindowTree(HullTree):
    """
    A tree of points with times, of which the oldest leave: see dynhull's in Python.
    """

    def __init__(self, max_age: float | None, max_points: int | None) -> None: ...

    @property
    def max_age(self) -> float | None:
        """The age at which a point leaves; None for any."""

    @property
    def max_points(self) -> int | None:
        """The greatest number of points; None for any."""

    @property
    def now(self) -> float | None:
        """The greatest time seen; None before."""

    @property
    def oldest(self) -> float | None:
        """
        The time of the oldest point; None if there is none, or if it has no time.
        """

    @property
    def expired(self) -> int:
        """The number of points that left because of their age."""

    @property
    def evicted(self) -> int:
        """The number of points that left because there were too many."""

    @property
    def late(self) -> int:
        """The number of points that were too old to be added."""

    def add(self, xy: object, times: object | None) -> int:
        """
        Add the points that are not late, and remove those that are too old or too many, as one batch. Returns the number of points added.
        """

    def advance(self, now: float) -> int:
        """
        Move the clock. Returns the number of points that left. ValueError if time would go back.
        """

    def expire(self, until: float) -> int:
        """
        Remove the points of this time or before, as one batch. Returns their number.
        """

    def delete(self, x: float, y: float) -> bool:
        """
        Remove the oldest copy of a point. True if the hull changed; KeyError if the point is missing. O(log² n).
        """

    def delete_many(self, xy: object, ignore_missing: bool) -> int:
        """
        Remove the oldest copies of points as one batch, like `apply`. Returns the number of points removed.
        """

    def clear(self) -> None:
        """Remove every point. The clock stays."""

    def times(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
        """
        The times of the points in the order of `points`, copies of a point in order of time. O(n log n).
        """

    def state(self) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None, 2))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], float | None, tuple[int, int, int, int]]:
        """
        What `restore` needs: the points in the order in which they leave, their times, now, and the numbers of changes, expired, evicted and late points. O(n log n).
        """

    def restore(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], now: float | None, totals: tuple[int, int, int, int]) -> None:
        """Fill an empty tree with the state of another."""

    def copy(self) -> WindowTree:
        """An independent tree of the same points and times. O(n)."""

    def check(self) -> None:
        """
        Raise AssertionError if an invariant of the tree or of the window is broken. O(n log n).
        """

def gnomonic(lonlat: dynhull.arrays.Points, parameters: Any) -> tuple[dynhull.arrays.Points, numpy.typing.NDArray[numpy.bool_]]:
    """
    The projections of places, NaN where there is none, and where there is one. The parameters are the centre, and the sine and the cosine of its latitude as sums of two doubles.
    """

class GlobeTree(HullTree):
    """Places on the globe and their hull: see dynhull's class."""

    def __init__(self, center: tuple[float, float] | None = None) -> None: ...

    @property
    def center(self) -> tuple[float, float] | None:
        """The centre of the projection; None before the first points."""

    def recenter(self, center: tuple[float, float]) -> None:
        """
        Project all places about another centre. ValueError if one is too far; nothing has changed. O(n log n).
        """

    def copy(self) -> GlobeTree:
        """An independent tree of the same places about the same centre."""

class GlobeEntities(Entities):
    """Entities on the globe: see dynhull's class in Python."""

    def __init__(self, key_type: dynhull.keys.KeyType = 'str', ordered: bool = False, center: tuple[float, float] | None = None) -> None: ...

    @property
    def center(self) -> tuple[float, float] | None:
        """The centre of the projection; None before the first points."""

    def recenter(self, center: tuple[float, float]) -> None:
        """
        Project all places about another centre. ValueError if one is too far; nothing has changed. O(n log n).
        """

    def copy(self) -> GlobeEntities:
        """An independent tree of the same places about the same centre."""

class GlobeWindowTree(WindowTree):
    """A window on the globe: see dynhull's class in Python."""

    def __init__(self, max_age: float | None, max_points: int | None, center: tuple[float, float] | None = None) -> None: ...

    @property
    def center(self) -> tuple[float, float] | None:
        """The centre of the projection; None before the first points."""

    def recenter(self, center: tuple[float, float]) -> None:
        """
        Project all places about another centre. ValueError if one is too far; nothing has changed. O(n log n).
        """

    def copy(self) -> GlobeWindowTree:
        """An independent tree of the same places about the same centre."""

def orientation(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> int:
    """
    +1 if the three points turn left, -1 if they turn right, 0 if they are collinear.
    """

def direction_sign(d: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> int:
    """
    +1 if b is farther than a in direction d, -1 if it is less far, 0 if neither.
    """

def crossing(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], d: tuple[float, float], z: tuple[float, float]) -> int:
    """The sign of height(ab) - height(cd) at z, for a < b < z <= c < d."""

def orientations(a: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], b: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], c: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]:
    """`orientation` of each row of three arrays."""

def turnings_if_valid(rings: list[dynhull.arrays.Points]) -> list[int]:
    """
    Of each ring of a polygon, +1 if its inside is on the left, -1 if on the right. Empty if a ring is not simple, or is a hole that is not inside the first one or overlaps another.
    """

def sign_of_measure(vertices: dynhull.arrays.Points, measure: str, bound: float) -> int | None:
    """
    The sign of the area, the diameter or the width of a hull less a bound that is not negative; None where rounding might decide, or of many vertices. O(h), or O(h²) of few.
    """

def plain_difference_of_products(a: float, b: float, c: float, d: float) -> float:
    """
    a * b - c * d with three roundings, as the predicates' filters compute it: tests the compiler's flags.
    """

def plain_points(xy: object) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))] | None:
    """
    A copy, without negative zeros, of an (n, 2) array of finite doubles or of a list of pairs of plain numbers; None for any other argument.
    """

def packed_points(packed: bytes) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))] | None:
    """
    The points whose coordinates are these doubles, without negative zeros; None if one is not finite.
    """

def convex_hull(xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], discard: bool | None = None, threads: bool | None = None) -> Annotated[NDArray[numpy.float64], dict(shape=(None, 2))] | None:
    """
    The static hull's vertices, counter-clockwise from the least; None if a coordinate is not finite. `discard` drops points inside a sample's hull first, `threads` uses two threads; by default the input decides. O(n log n).
    """

def chan(xy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None, 2))], list[tuple[int, int, int, bool]]]:
    """
    The same by Chan's algorithm, with its rounds (guess, groups, steps, closed). O(n log h).
    """

def set_threads(threads: int, beside: bool) -> None:
    """
    How many threads one call may use; 0 for one on each processor available to the process. And whether, if that is one, one more finds what a put crosses.
    """

def threads() -> int:
    """How many threads one call may use."""
