"""Hulls whose points are named by a key: KeyedHull in the plane."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np

from ._base import UNMEASURED, Hull, Live
from ._entities import Entities
from ._implementation import kernel

if TYPE_CHECKING:
    import numpy.typing as npt

    from . import _kernel
    from ._entities import Only
    from .arrays import Points
    from .keys import Keys, KeyType


class Put(NamedTuple):
    """What a batch of puts did: the number of its rows of each kind, which add up to the batch.

    Attributes:
        new: the key was not there.
        moved: the key was at another place.
        unmoved: the key was at this place already; its time is now that of the row.
        stale: the row is older than the key's stored time and changed nothing (with `ordered=True`).
        skipped: the row was left out because of `only`.
    """

    new: int
    moved: int
    unmoved: int
    stale: int
    skipped: int


class Keyed(Live):
    """A live hull of entities, each a point with a key and perhaps a time."""

    __slots__ = ()
    _tree: Entities | _kernel.Entities

    @property
    def key_type(self) -> KeyType:
        """The kind of the keys, "str" or "int"."""
        return self._tree.key_type

    @property
    def ordered(self) -> bool:
        """Whether a put that is older than the entity's stored time changes nothing."""
        return self._tree.ordered

    # Updates

    def put(self, key: str | int, x: float, y: float, time: float | None = None, *, only: Only | None = None) -> bool:
        """Insert an entity or move it. Returns whether the hull changed. O(log² n).

        Args:
            key: the entity's key.
            x: the first coordinate of the new place.
            y: the second.
            time: replaces the entity's time; None leaves it without one.
            only: "absent" to insert and never move, "present" to move and never insert.
        """
        return self._tree.put(key, x, y, time, _known(only))

    def put_many(
        self, keys: Any, xy: npt.ArrayLike, times: npt.ArrayLike | None = None, *, only: Only | None = None
    ) -> int:
        """Insert or move k entities as one batch, like `update`. Returns the number of new keys."""
        return self.update(keys, xy, times, only=only).new

    def update(self, keys: Any, xy: npt.ArrayLike, times: npt.ArrayLike | None = None, only: Only | None = None) -> Put:
        """Insert or move k entities as one batch. Returns how many rows did what. O(log² n) each.

        Args:
            keys: k keys, as `dynhull.keys.as_keys` takes them: strings in a list, an array, a column or `PackedKeys`;
                integers in a list, an array or a column.
            xy: (k, 2) array-like, the new places.
            times: (k,) finite numbers, which replace the entities' times; None leaves them without.
            only: "absent" skips rows whose key is there, "present" skips rows whose key is missing.

        Raises:
            DuplicateKeyError: a key comes twice.
        """
        return Put._make(self._tree.update(keys, xy, times, only if only is None else _known(only)))

    def remove(self, key: str | int) -> bool:
        """Remove an entity. Returns whether the hull changed. O(log² n).

        Raises:
            MissingKeyError: the hull does not hold the key.
        """
        return self._tree.remove(key)

    def remove_many(self, keys: Any, missing: Literal["raise", "ignore"] = "raise") -> int:
        """Remove entities as one batch. Returns the number of entities removed. O(log² n) each.

        Args:
            keys: k keys, as for `update`.
            missing: for a key that the hull does not hold, "raise" raises MissingKeyError with the row, before
                anything changes; "ignore" skips the row.

        Raises:
            DuplicateKeyError: a key comes twice.
        """
        if missing not in ("raise", "ignore"):
            raise ValueError(f'missing must be "raise" or "ignore", got {missing!r}')
        return self._tree.remove_many(keys, missing == "ignore")

    def expire(self, until: float) -> int:
        """Remove every entity whose time is at most `until`, as one batch. Returns their number. O(log² n) each.

        Entities without a time stay. The first call of `expire`, `evict` or `oldest` takes O(n); from then on updates
        keep the order of times. The implementation in Python keeps none: O(n) each time.
        """
        return self._tree.expire(until)

    def evict(self, count: int) -> int:
        """Remove the `count` oldest entities, or all if there are fewer, as one batch. Returns their number.

        Those without a time come first; among equal times the least key does. O(log² n) each, and O(n) at the first
        call, like `expire`; O(n) at each call while an entity has no time.

        Raises:
            ValueError: the count is negative.
        """
        most = operator.index(count)
        if most < 0:
            raise ValueError(f"count is {most}: must not be negative")
        return self._tree.evict(min(most, len(self)))

    def clear(self) -> None:
        """Remove every entity."""
        self._tree.clear()

    # Entities

    def __contains__(self, key: object) -> bool:
        """Whether the hull holds the key. O(1)."""
        return self._tree.has(key)

    def position(self, key: str | int) -> tuple[float, float]:
        """The place of an entity. O(1).

        Raises:
            MissingKeyError: the hull does not hold the key.
        """
        return self._tree.position(key)

    def positions(self, keys: Any) -> Points:
        """(k, 2) places of k keys; NaN in the rows of missing ones. O(1) each."""
        return self._tree.positions(keys)

    def times(self, keys: Any) -> npt.NDArray[np.float64]:
        """(k,) times of k keys; NaN for missing keys and for entities without a time. O(1) each."""
        return self._tree.times(keys)

    def keys(self) -> list[str] | list[int]:
        """All keys in order, as a list. O(n log n)."""
        keys = self._tree.entities()[0]
        return keys.tolist() if isinstance(keys, np.ndarray) else list(keys)

    def entities(self) -> tuple[Keys, Points, npt.NDArray[np.float64]]:
        """All n entities in the order of their keys. O(n log n).

        Returns:
            keys: `PackedKeys`, or an array of uint64.
            xy: (n, 2) places.
            times: (n,) times, NaN for entities without one.
        """
        return self._tree.entities()

    def oldest(self) -> float | None:
        """The least time of an entity; None if none has a time. O(1), and O(n) at the first call, like `expire`."""
        return self._tree.oldest()

    def pack(self, *, idle: bool = False) -> bool:
        """Hold the entities in about a third of the memory until the next call that needs them. O(n).

        That call takes O(n log n) more, and any thread may make it. Nothing else differs: for programs with many hulls
        of which few are in use.

        Args:
            idle: only if nothing has used them since the last such call: called now and then for all hulls, it packs
                those at rest.

        Returns:
            Whether they are held so: not while a thread uses the hull, nor while a `FenceIndex` compares them, nor
            where memory does not suffice; and never in the implementation in Python.
        """
        return self._tree.pack(idle)

    def vertex_keys(self) -> list[str] | list[int]:
        """The key at each vertex, in the order of `vertices`; the least one where several are. O(h log n).

        The first call takes O(n). From then on updates keep the names of places near the boundary, and O(n) comes
        again only after the hull has changed much. The implementation in Python keeps no names: O(n) each time.
        """
        return self._tree.vertex_keys()

    def keys_at(self, xy: npt.ArrayLike) -> list[str | None] | list[int | None]:
        """The key at each of (k, 2) places: the least one where several are, None where there is none.

        O(k) for vertices and other places near the boundary, like `vertex_keys`; O(n + k) if one place is far inside.
        """
        return self._tree.keys_at(xy)

    # As a value

    def __eq__(self, other: object) -> bool:
        """Whether the other hull holds the same keys at the same places with the same times. O(n log n)."""
        if not isinstance(other, Keyed):
            return NotImplemented
        if not self._same_frame(other) or len(self) != len(other) or self.key_type != other.key_type:
            return False
        (keys, xy, times), (other_keys, other_xy, other_times) = self.entities(), other.entities()
        same_keys = keys == other_keys if self.key_type == "str" else np.array_equal(keys, other_keys)
        return bool(same_keys) and np.array_equal(xy, other_xy) and np.array_equal(times, other_times, equal_nan=True)


class KeyedHull(Keyed, Hull):
    """The convex hull of entities, each a point with a key and perhaps a time. Exact for every finite double.

    `put` inserts an entity or moves it, so that a caller need not remember where it was.

    Args:
        key_type: "str" for strings of 1 to 255 bytes in UTF-8, "int" for integers from 0 to 2**64 - 1.
        ordered: whether a put that is older than the entity's stored time changes nothing. Every put needs a time then.

    Times are finite numbers in a unit of the caller's choice. Keys are ordered bytewise or by number. A batch is a set:
    a key comes once, and the order of the rows does not matter. A batch that is refused, whatever the reason, changes
    nothing. Methods that take keys, points or times raise ValueError or TypeError for bad ones; the message names the
    first bad row.

    `points`, `locate`, `distance`, `area` and all other reading methods are those of `DynamicHull`, with entities at
    the same place as copies of one point; only `in` asks for a key.

    >>> from dynhull import KeyedHull
    >>> fleet = KeyedHull()
    >>> fleet.put_many(["LH400", "UA17", "AF84"], [[0, 0], [4, 0], [0, 4]])
    3
    >>> fleet.put("UA17", 5, 1)
    True
    >>> fleet.vertex_keys()
    ['LH400', 'UA17', 'AF84']
    >>> fleet.position("UA17")
    (5.0, 1.0)
    >>> "UA17" in fleet, len(fleet)
    (True, 3)
    """

    __slots__ = ()
    _tree_type: ClassVar[type[Entities | _kernel.Entities]] = Entities if kernel is None else kernel.Entities

    def __init__(self, key_type: KeyType = "str", *, ordered: bool = False) -> None:
        self._tree = self._tree_type(known_kind(key_type), bool(ordered))
        self._measured = UNMEASURED

    @classmethod
    def from_entities(
        cls,
        keys: Any,
        xy: npt.ArrayLike,
        times: npt.ArrayLike | None = None,
        key_type: KeyType = "str",
        *,
        ordered: bool = False,
    ) -> KeyedHull:
        """A hull of n entities, as `entities` returns them: a time that is NaN means none. O(n log n).

        Raises:
            DuplicateKeyError: a key comes twice.
        """
        hull = cls(key_type, ordered=ordered)
        hull._tree.load(keys, xy, times)
        return hull

    @classmethod
    def loader(cls, key_type: KeyType = "str", *, ordered: bool = False, room: int = 0) -> KeyedLoader:
        """What takes the entities of a new hull in several batches, as from a log, and builds the hull once.

        With room for that many entities from the beginning; there may be more.

        >>> from dynhull import KeyedHull
        >>> loader = KeyedHull.loader()
        >>> loader.update(["LH400", "UA17"], [(0, 0), (4, 0)])
        >>> loader.update(["UA17", "AF84"], [(5, 1), (0, 3)])
        >>> loader.remove_many(["LH400", "BA9"])
        >>> loader.hull().vertex_keys()
        ['AF84', 'UA17']
        """
        return KeyedLoader(cls(key_type, ordered=ordered), room)

    @classmethod
    def unpacked(cls, packed: PackedHull) -> KeyedHull:
        """A hull of what `KeyedLoader.packed` has returned. O(n), and O(n log n) when it is used."""
        hull = cls.__new__(cls)
        hull._tree, hull._measured = packed.entities(), UNMEASURED
        return hull

    # As a value

    def __getstate__(self) -> tuple[KeyType, bool, tuple[Keys, Points, npt.NDArray[np.float64]], int]:
        return self.key_type, self.ordered, self.entities(), self.changes

    def __setstate__(self, state: tuple[KeyType, bool, tuple[Keys, Points, npt.NDArray[np.float64]], int]) -> None:
        key_type, ordered, entities, changes = state
        self._tree = self._tree_type(key_type, ordered)
        self._tree.load(*entities)
        self._tree.changes = changes
        self._measured = (changes, {})


class PackedHull(Protocol):
    """The entities of a hull that is made when it is needed: see `KeyedLoader.packed`."""

    @property
    def distinct(self) -> int:
        """The number of distinct places."""

    @property
    def vertex_count(self) -> int:
        """The number of vertices."""

    def __len__(self) -> int:
        """The number of entities."""

    def entities(self) -> Entities | _kernel.Entities:
        """For `KeyedHull.unpacked`."""


class KeyedLoader:
    """The entities of a hull that is to be built: see `KeyedHull.loader`."""

    __slots__ = ("_hull",)

    def __init__(self, hull: KeyedHull, room: int = 0) -> None:
        if room < 0:
            raise ValueError(f"room must be a number of entities, got {room}")
        self._hull: KeyedHull | None = hull
        hull._tree.begin_load(room)

    def update(self, keys: Any, xy: npt.ArrayLike, times: npt.ArrayLike | None = None) -> None:
        """Insert or move k entities, as `KeyedHull.update` does; a time that is NaN means none. O(k).

        Raises:
            DuplicateKeyError: a key comes twice in these.
        """
        self._loading()._tree.load(keys, xy, times)

    def remove_many(self, keys: Any) -> None:
        """Remove those of k entities that are there. O(k).

        Raises:
            DuplicateKeyError: a key comes twice in these.
        """
        self._loading()._tree.remove_many(keys, True)

    def hull(self) -> KeyedHull:
        """The hull of the entities, which is built now. O(n log n). Nothing can be asked of the loader afterwards."""
        hull = self._loading()
        hull._tree.end_load()
        self._hull = None
        return hull

    def packed(self, most: int) -> PackedHull | None:
        """The entities in the least memory, in place of their hull, which `KeyedHull.unpacked` makes when it is needed.

        None if they are more than `most`: then they stay. What is returned knows their number as its `len`, the number
        of their places as `distinct`, and that of the vertices as `vertex_count`. O(n log n).

        >>> from dynhull import KeyedHull
        >>> loader = KeyedHull.loader()
        >>> loader.update(["LH400", "UA17"], [(0, 0), (4, 0)])
        >>> packed = loader.packed(1000)
        >>> len(packed), packed.vertex_count
        (2, 2)
        >>> KeyedHull.unpacked(packed).keys()
        ['LH400', 'UA17']
        """
        packed = self._loading()._tree.packed(most)
        if packed is not None:
            self._hull = None
        return packed

    def _loading(self) -> KeyedHull:
        if self._hull is None:
            raise ValueError("the loader has given its hull away")
        return self._hull


def _known(only: Only | None) -> Only | None:
    if only not in (None, "absent", "present"):
        raise ValueError(f'only must be None, "absent" or "present", got {only!r}')
    return only


def known_kind(key_type: KeyType) -> KeyType:
    """The kind of keys, checked."""
    if key_type not in ("str", "int"):
        raise ValueError(f'key_type must be "str" or "int", got {key_type!r}')
    return key_type
