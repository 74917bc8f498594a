"""The port to the past: what a reader of earlier revisions asks of whatever keeps them."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from ..state.records import CommitStamp, Contents, HullRow, Kept, Keys, Parts, Record
from ..state.tracks import KeyChanges
from ..state.ways import KeyWays

Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class Moment:
    """A revision of a hull.

    Attributes:
        revision: the revision.
        committed: its commit; None where formats before 11 did not store it. The commit of revision 0 has the number 0,
            and the time at which the hull was created.
        erased: whether the hull may lack keys that it had then, because they were erased from its past.
    """

    revision: int
    committed: CommitStamp | None
    erased: bool = False


def created(row: HullRow) -> CommitStamp:
    """The commit of revision 0 of a hull."""
    return CommitStamp(0, round(row.created * 1_000_000))


@dataclass(frozen=True, slots=True)
class Erasure:
    """Keys were erased from the past of a hull. Which ones is not kept.

    Attributes:
        first, last: the revisions as of which the hull may lack some of them.
        time: when, in microseconds since 1970.
        keys: the number of keys.
        moves: the number of times that the batches have put, removed or held them.
    """

    first: int
    last: int
    time: int
    keys: int
    moves: int

    def concerns(self, revision: int) -> bool:
        """Whether the hull may lack keys as of a revision."""
        return self.first <= revision <= self.last


@dataclass(slots=True, eq=False)
class EraseRequest:
    """Keys that somebody wants erased from the past of a hull.

    Attributes:
        keys: the keys.
        erased: what has been erased, once it is committed; None while it is not, and if the past has none of them.
    """

    keys: Keys
    erased: Erasure | None = None


def erased_since(before: Sequence[Erasure], now: Sequence[Erasure]) -> bool:
    """Whether keys were erased meanwhile. An erasure that is gone has changed nothing: its revisions were dropped."""
    return now != before and not Counter(now) <= Counter(before)  # equal as a rule, and compared without hashes


@dataclass(frozen=True, slots=True)
class StoredHistory:
    """What is there of the past of a hull.

    Attributes:
        first, last: the oldest revision that can be read, and the newest one.
        bytes, batches, moves: of segments: the size of their files, their batches, and the points and keys in these.
        erasures: the erasures that concern it, the oldest first.
    """

    first: Moment
    last: Moment
    bytes: int = 0
    batches: int = 0
    moves: int = 0
    erasures: tuple[Erasure, ...] = ()


@dataclass(frozen=True, slots=True)
class Hole:
    """Revisions of the past of a hull that could not be read when they were last needed.

    Attributes:
        number: the number of the hull.
        first, last: the revisions.
    """

    number: int
    first: int
    last: int


class Past(Protocol):
    """Reads hulls as they were, from a state and the batches after it.

    Any thread may read at any time, and no read holds up a commit. Reads are short: a revision takes several, and what
    the first of them relies on may have been dropped before the last. They raise an error then, and `oldest_moment`
    says what is left.

    Every method raises KeyError if no hull has that number, DamagedError if data is damaged or no longer kept, and
    StorageError if it cannot be read at present.
    """

    def oldest_moment(self, number: int, *, timed: bool = False) -> Moment:
        """The oldest revision that can be read; or, `timed`, the oldest whose commit is known."""

    def moment(self, number: int, time: int) -> Moment | None:
        """The last revision committed at or before a time, in microseconds since 1970.

        None if the time is before that of the oldest revision whose commit is known.
        """

    def state_revision(self, number: int, until: int) -> int:
        """The revision of the state that `state` returns. If that is damaged, it may return an older one."""

    def state(self, number: int, until: int) -> tuple[Kept, Parts]:
        """The newest state that is kept of a revision not after `until`, without its points, and these.

        To read a part of them may raise DamagedError, too. No batches come with it.
        """

    def batches(self, number: int, after: int, until: int) -> list[Record]:
        """The batches that follow revision `after`, in order and without a gap, none after `until`.

        At least one, if `after` is before `until`; as many as are read and applied in some milliseconds.
        """

    def gathered(self, number: int, after: int, until: int) -> list[Record]:
        """What leads from the state at revision `after` towards that at `until`: `batches` in fewer records.

        Each has the revision of the last batch that it stands for, and of a key that several of these move the last
        place alone. It does not say who has numbered them.
        """

    def key_state(self, number: int, keys: Keys, until: int) -> tuple[int, npt.NDArray[np.int32], Contents]:
        """The revision of the newest kept state not after `until`, which of some keys it has, and their points."""

    def key_changes(self, number: int, keys: Keys, after: int, until: int) -> tuple[int, KeyChanges]:
        """What some of the batches after a revision do to some keys, and the last revision of these batches."""

    def ways(
        self, number: int, after: int, until: int, read: Callable[[Iterator[KeyWays]], Found]
    ) -> tuple[int, Found | None]:
        """What a function makes of all moves of keys of some batches after a revision, and their last revision.

        It may be called again, from the beginning. None in place of what it returns if these batches do anything but
        put and remove keys, or have no times; it is not called then.
        """

    def erasures(self, number: int) -> tuple[Erasure, ...]:
        """The erasures that concern what is there of a hull, the oldest first.

        Who reads a state and the batches after it begins anew when others have come (`erased_since`): otherwise a key
        might be in the state, and not in the batch that removes it.
        """

    def history(self, number: int) -> StoredHistory:
        """What is there of a hull."""

    def holes(self) -> list[Hole]:
        """What could not be read of hulls that are there, when it was last needed."""
