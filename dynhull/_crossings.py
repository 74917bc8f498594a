"""Who has crossed which fence: as arrays, and packed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ._value import Value
from .keys import Keys, PackedKeys, key_list, take_keys

if TYPE_CHECKING:
    from collections.abc import Container, Mapping

    import numpy.typing as npt

    from .arrays import Points
    from .keys import KeyType

WORD = 8  # bytes of a number
ROW = 6 * WORD + 2  # bytes of a row in `columns`


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Crossings(Value):
    """Who crossed which fence between two states of a hull: n rows, in the order of fences, then of keys.

    Attributes:
        fences: (n,) numbers of fences.
        changes: (n,) +1 entered; -1 left; 0 crossed: outside before and after, but the straight way between meets the
            area as it is now; 2 was inside as an entity of another hull, and stays inside (see `FenceIndex.carry`).
        causes: (n,) sums of `MOVED` (the subject changed its place), `AREA` (the area changed), `APPEARED` (the key is
            new), `REMOVED` (the key was removed) and `EXPIRED` (the key left by `expire` or `evict`).
        keys: n keys, `PackedKeys` or an array of uint64.
        points: (n, 2) places now; NaN if the key is gone.
        previous: (n, 2) places before; NaN if the key is new.
        distances: (n,) distances of the places now to the area now, each the exact value rounded once: 0.0 inside and
            on the boundary, inf from an empty area, NaN if the key is gone. With a `frame`, metres.
    """

    MOVED = 1
    AREA = 2
    APPEARED = 4
    REMOVED = 8
    EXPIRED = 16

    fences: npt.NDArray[np.int64]
    changes: npt.NDArray[np.int8]
    causes: npt.NDArray[np.uint8]
    keys: Keys
    points: Points
    previous: Points
    distances: npt.NDArray[np.float64]

    def __len__(self) -> int:
        """The number of rows."""
        return len(self.fences)


class PackedCrossings(NamedTuple):
    """Crossings as they come from an index, without an array for each column: n rows, at least one.

    Attributes:
        columns: the fences, places now, places before and distances of all rows, each number 8 bytes; then the changes
            and the causes, each a byte. They are those of `Crossings`, in the order of bytes of the machine.
        lengths: the length of each key in bytes, a byte each; None where keys are integers.
        keys: the keys, one after the other: strings in UTF-8, or integers of 8 bytes.

    >>> import dynhull
    >>> fleet = dynhull.KeyedHull()
    >>> fences = dynhull.FenceIndex(fleet)
    >>> fences.set_circle(7, 0, 0, 5)
    >>> fleet.put("van", 1, 1)
    True
    >>> found = fences.take_packed()
    >>> len(found.columns), found.keys, found.unpack().changes.tolist()
    (50, b'van', [1])
    """

    columns: bytes
    lengths: bytes | None
    keys: bytes

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(self.columns) // ROW

    def unpack(self) -> Crossings:
        """The crossings as arrays. O(n), and the columns are not copied."""
        columns, n = self.columns, self.rows
        return Crossings(
            fences=np.frombuffer(columns, np.int64, n),
            changes=np.frombuffer(columns, np.int8, n, 6 * WORD * n),
            causes=np.frombuffer(columns, np.uint8, n, (6 * WORD + 1) * n),
            keys=np.frombuffer(self.keys, np.uint64) if self.lengths is None else PackedKeys(self.lengths, self.keys),
            points=np.frombuffer(columns, np.float64, 2 * n, WORD * n).reshape(n, 2),
            previous=np.frombuffer(columns, np.float64, 2 * n, 3 * WORD * n).reshape(n, 2),
            distances=np.frombuffer(columns, np.float64, n, 5 * WORD * n),
        )


def pack(crossings: Crossings) -> PackedCrossings | None:
    """Crossings packed; None if there are none."""
    if not len(crossings):
        return None
    wide = crossings.fences, crossings.points, crossings.previous, crossings.distances
    columns = b"".join([column.tobytes() for column in (*wide, crossings.changes, crossings.causes)])
    keys = crossings.keys
    if isinstance(keys, PackedKeys):
        return PackedCrossings(columns, keys.lengths, keys.data)
    return PackedCrossings(columns, None, keys.tobytes())


def _no_crossings(key_type: KeyType) -> Crossings:
    return Crossings(
        np.empty(0, np.int64),
        np.empty(0, np.int8),
        np.empty(0, np.uint8),
        PackedKeys.pack([]) if key_type == "str" else np.empty(0, np.uint64),
        np.empty((0, 2)),
        np.empty((0, 2)),
        np.empty(0),
    )


NO_CROSSINGS = {"str": _no_crossings("str"), "int": _no_crossings("int")}


def only_shared(crossings: Crossings, carried: Mapping[str | int, Container[int]]) -> Crossings:
    """The crossings; in a fence that the index does not have from which a subject was carried, this is new."""
    keys, fences = key_list(crossings.keys), crossings.fences.tolist()
    new = np.array(
        [key in carried and fence not in carried[key] for key, fence in zip(keys, fences, strict=True)], np.bool_
    )
    new &= crossings.causes & Crossings.MOVED != 0  # not so around the own hull
    if not new.any():
        return crossings
    causes, previous = crossings.causes.copy(), crossings.previous.copy()
    causes[new] ^= np.uint8(Crossings.MOVED | Crossings.APPEARED)
    previous[new] = np.nan
    rows = np.flatnonzero(~new | (crossings.changes != 0))  # who is new has come no way
    return Crossings(
        fences=crossings.fences[rows],
        changes=crossings.changes[rows],
        causes=causes[rows],
        keys=take_keys(crossings.keys, rows),
        points=crossings.points[rows],
        previous=previous[rows],
        distances=crossings.distances[rows],
    )
