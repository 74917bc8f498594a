"""Entities: points with a key and a time each, and their hull; the readable reference of the kernel's class.

An entity is put, moves, is removed. A batch of puts is one batch of the tree: the old places go, the new ones come. The
batch is checked as a whole before anything changes.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from typing import TYPE_CHECKING, Any, Literal, Self
from weakref import ref

import numpy as np

from ._times import NO_TIME, as_time, as_times
from ._tree import HullTree
from .arrays import as_points, as_tuples
from .keys import PackedKeys, as_key, as_keys, key_list

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import numpy.typing as npt

    from ._predicates import Point
    from .arrays import Points
    from .keys import Keys, KeyType

Key = str | int
Only = Literal["absent", "present"]
NEEDED_IF_ORDERED = "is None: a hull with ordered=True needs a time with every put"
Counts = tuple[int, int, int, int, int]  # of a batch's rows: new, moved, unmoved, stale, skipped
REMOVED, EXPIRED = 8, 16  # why an entity is gone


class DuplicateKeyError(ValueError):
    """A batch holds a key twice.

    Attributes:
        key: the key.
        rows: the two rows of the batch.
    """

    key: Key
    rows: tuple[int, int]

    def __init__(self, key: Key, rows: tuple[int, int]) -> None:
        super().__init__(key, rows)
        self.key = key
        self.rows = rows

    def __str__(self) -> str:
        first, second = self.rows
        return f"keys rows {first} and {second} are both {self.key!r}: a batch holds a key once; nothing was changed"


class MissingKeyError(KeyError):
    """A call names a key that the hull does not hold.

    Attributes:
        key: the key.
        row: the row of the batch; None for a single key.
    """

    key: Key
    row: int | None

    def __init__(self, key: Key, row: int | None = None) -> None:
        super().__init__(key, row)
        self.key = key
        self.row = row

    def __str__(self) -> str:
        where = "" if self.row is None else f"keys row {self.row}: "
        return f"{where}the key {self.key!r} is missing; nothing was changed"


def _no_journal() -> None:
    return None


class Journal:
    """What has changed since it was last cleared.

    Attributes:
        before: the place of each key then that has been put or removed since; None if it was not there.
        gone: why each key that has been removed was removed last: REMOVED or EXPIRED.
    """

    def __init__(self) -> None:
        self.before: dict[Key, Point | None] = {}
        self.gone: dict[Key, int] = {}

    def clear(self) -> None:
        """Forget everything."""
        self.before.clear()
        self.gone.clear()


class Entities(HullTree):
    """Entities and the convex hull of their points.

    O(log² n) a put or a removal; a batch of k rows is one batch of the tree.
    """

    def __init__(self, key_type: KeyType = "str", ordered: bool = False) -> None:
        super().__init__()
        self.key_type: KeyType = key_type
        self.ordered = ordered
        self._held: dict[Key, tuple[Point, float]] = {}  # place and time of each key
        self._whole = True  # whether the tree has their places
        self._journal_of: Callable[[], Journal | None] = _no_journal

    def clear(self) -> None:
        """Remove every entity."""
        self._note_gone(self._held, REMOVED)
        super().clear()
        self._held.clear()

    def copy(self) -> Self:
        """Independent entities with the same keys, points and times. O(n)."""
        new = super().copy()
        new.key_type, new.ordered, new._held, new._whole = self.key_type, self.ordered, self._held.copy(), self._whole
        return new

    # Updates

    def update(self, keys: Any, xy: npt.ArrayLike, times: npt.ArrayLike | None, only: Only | None) -> Counts:
        """Insert or move the entity of each row, as one batch.

        Args:
            keys: k keys, checked by `as_keys`.
            xy: (k, 2) array-like, checked by `as_points`.
            times: (k,) array-like, checked by `as_times`; None without times.
            only: which keys to put, and which rows to skip; None puts all.

        Returns:
            The numbers of rows that were new, moved, unmoved, stale and skipped.

        Raises:
            DuplicateKeyError: a key comes twice; nothing has changed.
        """
        return self._put_rows(*self._checked(keys, xy, times, or_none=False), only)

    def load(self, keys: Any, xy: npt.ArrayLike, times: npt.ArrayLike | None) -> None:
        """Put all rows, like `update`; a time that is NaN means none."""
        self._put_rows(*self._checked(keys, xy, times, or_none=not self.ordered), None)

    def begin_load(self, room: int = 0) -> None:
        """Put off the tree, for some calls of `load` and `remove_many`: of several batches it is built once."""
        del room
        if type(self) is not Entities or self._held:
            raise ValueError("only an empty hull of a plane is loaded so")
        self._whole = False

    def end_load(self) -> None:
        """Build the tree. O(n log n)."""
        if not self._whole:
            self._whole = True
            self._apply_net(Counter(p for p, _ in self._held.values()))

    def packed(self, most: int) -> PackedEntities | None:
        """What was loaded, in place of `end_load`; None if it is more than so many entities. O(n log n)."""
        if self._whole:
            raise ValueError("only what is being loaded is packed so")
        return PackedEntities(self) if len(self._held) <= most else None

    def put(self, key: Any, x: float, y: float, time: float | None, only: Only | None) -> bool:
        """Insert or move one entity. True if the hull changed. O(log² n)."""
        checked = as_key(key, self.key_type)
        p = self._as_point(x, y)
        if time is None and self.ordered:
            raise ValueError(f"time {NEEDED_IF_ORDERED}")
        moment = NO_TIME if time is None else as_time(time)
        before = self.changes
        with self._in_frame([p], "the point"):
            self._put([checked], [p], [moment], only)
        return self.changes > before

    def remove(self, key: Any) -> bool:
        """Remove one entity. True if the hull changed; MissingKeyError if there is none. O(log² n)."""
        p, _ = self._entity(key)
        checked = as_key(key, self.key_type)
        self._note_gone([checked], REMOVED)
        del self._held[checked]
        return self.delete(*p)

    def remove_many(self, keys: Any, ignore_missing: bool) -> int:
        """Remove entities as one batch. Returns their number.

        Raises:
            MissingKeyError: a key is missing and that is not ignored; nothing has changed.
            DuplicateKeyError: a key comes twice; nothing has changed.
        """
        rows = distinct(as_keys(keys, self.key_type))
        if not ignore_missing:
            for row, key in enumerate(rows):
                if key not in self._held:
                    raise MissingKeyError(key, row)
        return self._remove_all([key for key in rows if key in self._held], REMOVED)

    def expire(self, until: float) -> int:
        """Remove every entity with a time of at most `until`, as one batch. Returns their number. O(n)."""
        moment = as_time(until, "until")
        return self._remove_all([key for key, (_, time) in self._held.items() if time <= moment], EXPIRED)

    def evict(self, count: int) -> int:
        """Remove the `count` oldest entities, those without a time first, ties by key. Returns their number. O(n)."""

        def age(key: Key) -> tuple[bool, float, Any]:
            time = self._held[key][1]
            return (False, 0.0, key) if math.isnan(time) else (True, time, key)

        return self._remove_all(heapq.nsmallest(count, self._held, key=age), EXPIRED)

    def _checked(
        self, keys: Any, xy: npt.ArrayLike, times: npt.ArrayLike | None, *, or_none: bool
    ) -> tuple[Keys, Points, npt.NDArray[np.float64] | None]:
        return checked_puts(keys, xy, times, self.key_type, self.ordered, or_none=or_none, checked=self._as_points)

    def _put_rows(self, keys: Keys, xy: Points, times: npt.NDArray[np.float64] | None, only: Only | None) -> Counts:
        rows, points = distinct(keys), as_tuples(xy)
        with self._in_frame(points):
            return self._put(rows, points, [NO_TIME] * len(rows) if times is None else times.tolist(), only)

    def _put(self, keys: Sequence[Key], points: list[Point], times: list[float], only: Only | None) -> Counts:
        new = moved = unmoved = stale = skipped = 0
        net: Counter[Point] = Counter()
        changed: dict[Key, tuple[Point, float]] = {}
        for key, p, time in zip(keys, points, times, strict=True):
            held = self._held.get(key)
            if only is not None and (held is None) != (only == "absent"):
                skipped += 1
                continue
            if held is None:
                new += 1
                net[p] += 1
            elif self.ordered and time < held[1]:
                stale += 1
                continue
            elif held[0] == p:
                unmoved += 1
            else:
                moved += 1
                net[held[0]] -= 1
                net[p] += 1
            changed[key] = p, time
        if self._whole:
            self._apply_net(net)
        self._note(changed)
        self._held.update(changed)
        return new, moved, unmoved, stale, skipped

    def _remove_all(self, keys: Sequence[Key], cause: int) -> int:
        """Remove the entities of different keys that are there."""
        self._note_gone(keys, cause)
        net: Counter[Point] = Counter()
        for key in keys:
            net[self._held.pop(key)[0]] -= 1
        if self._whole:
            self._apply_net(net)
        return len(keys)

    # The journal

    def attach(self, journal: Journal) -> None:
        """Write every change into a journal, as long as somebody keeps it. ValueError if there is one already."""
        if self._journal_of() is not None:
            raise ValueError("subjects has an index of fences already: detach it first")
        self._journal_of = ref(journal)

    def detach(self, journal: Journal) -> None:
        """Write into this journal no longer."""
        if self._journal_of() is journal:
            self._journal_of = _no_journal

    def _note(self, keys: Iterable[Key]) -> None:
        """Note the places of keys that are about to change."""
        if (journal := self._journal_of()) is not None:
            for key in keys:
                held = self._held.get(key)
                journal.before.setdefault(key, None if held is None else held[0])

    def _note_gone(self, keys: Iterable[Key], cause: int) -> None:
        self._note(keys)
        if (journal := self._journal_of()) is not None:
            journal.gone.update(dict.fromkeys(keys, cause))

    # Reading

    def places(self) -> dict[Key, Point]:
        """The place of each key. O(n)."""
        return {key: p for key, (p, _) in self._held.items()}

    def has(self, key: Any) -> bool:
        """Whether there is an entity of the key. O(1)."""
        return as_key(key, self.key_type) in self._held

    def position(self, key: Any) -> Point:
        """The place of an entity; MissingKeyError if there is none. O(1)."""
        return self._entity(key)[0]

    def positions(self, keys: Any) -> Points:
        """The place of each key, NaN where it is missing. O(1) a row."""
        nowhere = (math.nan, math.nan), NO_TIME
        places = [self._held.get(key, nowhere)[0] for key in key_list(as_keys(keys, self.key_type))]
        return np.array(places, dtype=np.float64).reshape(len(places), 2)

    def times(self, keys: Any) -> npt.NDArray[np.float64]:
        """The time of each key, NaN where the key or its time is missing. O(1) a row."""
        none = None, NO_TIME
        return np.array([self._held.get(key, none)[1] for key in key_list(as_keys(keys, self.key_type))], np.float64)

    def entities(self) -> tuple[Keys, Points, npt.NDArray[np.float64]]:
        """Keys in order, places and times. O(n log n)."""
        keys: list[Any] = sorted(self._held)
        packed: Keys = PackedKeys.pack(keys) if self.key_type == "str" else np.array(keys, np.uint64)
        return packed, self.positions(packed), self.times(packed)

    def oldest(self) -> float | None:
        """The least time; None if no entity has one. O(n)."""
        return min((time for _, time in self._held.values() if not math.isnan(time)), default=None)

    def pack(self, idle: bool) -> bool:  # noqa: ARG002  # the kernel's
        """Whether the entities are held in less memory: never, for nothing here is smaller than these objects."""
        return False

    def keys_at(self, xy: npt.ArrayLike) -> list[Any]:
        """The least key at each place, None where there is no entity. O(n + k)."""
        return self._names(as_tuples(self._as_points(xy)))

    def vertex_keys(self) -> list[Any]:
        """The least key at each vertex, in the order of `vertices`. O(n)."""
        return self._names(as_tuples(self.vertices()))

    def check(self) -> None:
        """Raise AssertionError if the tree is broken or holds other points than the entities'. O(n log n)."""
        super().check()
        places = Counter(p for p, _ in self._held.values())
        if places != Counter(as_tuples(self.points())):
            raise AssertionError("the tree does not hold the entities' points")

    def _entity(self, key: Any) -> tuple[Point, float]:
        checked = as_key(key, self.key_type)
        if checked not in self._held:
            raise MissingKeyError(checked)
        return self._held[checked]

    def _names(self, places: list[Point]) -> list[Any]:
        least: dict[Point, Any] = dict.fromkeys(places)
        for key, (p, _) in self._held.items():
            if p in least and (least[p] is None or key < least[p]):
                least[p] = key
        return [least[p] for p in places]


def checked_puts(
    keys: Any,
    xy: npt.ArrayLike,
    times: npt.ArrayLike | None,
    key_type: KeyType,
    ordered: bool,
    *,
    or_none: bool = False,
    checked: Callable[[npt.ArrayLike], Points] = as_points,
) -> tuple[Keys, Points, npt.NDArray[np.float64] | None]:
    """The arguments of `Entities.update` as arrays of the same length. `checked` is what checks the points.

    Raises:
        ValueError, TypeError: a key, a point or a time is bad, the lengths differ, or the times are missing.
    """
    known = as_keys(keys, key_type)
    points = checked(xy)
    if len(points) != len(known):
        raise ValueError(f"points must have one row for each key: {len(known)}, got {len(points)}")
    if times is None:
        if ordered:
            raise ValueError(f"times {NEEDED_IF_ORDERED}")
        return known, points, None
    moments = as_times(times, or_none=or_none)
    if len(moments) != len(known):
        raise ValueError(f"times must have one row for each key: {len(known)}, got {len(moments)}")
    return known, points, moments


def distinct(keys: Keys) -> list[Any]:
    """The keys of a batch as a list. Raises DuplicateKeyError for the first row whose key came before. O(k)."""
    listed = key_list(keys)
    if len(set(listed)) < len(listed):
        rows: dict[Key, int] = {}
        for row, key in enumerate(listed):
            first = rows.setdefault(key, row)
            if first != row:
                raise DuplicateKeyError(key, (first, row))
    return listed


class PackedEntities:
    """Entities that nobody has used since they were loaded; in the kernel they take less memory so."""

    def __init__(self, entities: Entities) -> None:
        entities.end_load()
        self._entities = entities
        self._size, self.distinct, self.vertex_count = len(entities), entities.distinct, len(entities.vertices())

    def __len__(self) -> int:
        return self._size

    def entities(self) -> Entities:
        """The entities, each time others."""
        return self._entities.copy()
