"""The port: what the engine asks of a storage, whatever is behind it.

Calls block until they are done. One thread commits; reads come from any thread, at any time. A storage starts no
threads of its own: the engine calls `sync` and `checkpoint`, and carries out the steps of `snapshot` and `sweep`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from dynhull.arrays import Points

from ..state.records import Change, HullRow, Kept

NEWEST = 2**62

Progress = Callable[[int, int], None]


class StorageError(Exception):
    """The storage cannot do what it was asked; the message says why and what to do."""


class NotCommittedError(StorageError):
    """A commit has changed nothing, and never will.

    Attributes:
        full: whether there was no room.
    """

    def __init__(self, message: str, *, full: bool = False) -> None:
        super().__init__(message)
        self.full = full


class DamagedError(StorageError):
    """Something that was kept is not what was written."""


class LockedError(StorageError):
    """Another server works on this storage."""


class FormatError(StorageError):
    """A newer version wrote it, or it is another program's."""


class Step(Protocol):
    """A part of a snapshot or of a sweep, to be committed as a change; only its storage knows what is in it."""


@dataclass(frozen=True, slots=True)
class Contents:
    """What a storage holds when it is opened.

    Attributes:
        hulls: in the order of their names.
        next_number: greater than the number of every hull there has ever been.
        notes: what was lost or repaired, in words.
    """

    hulls: list[HullRow]
    next_number: int
    notes: list[str]


class Storage(Protocol):
    """Keeps hulls.

    Attributes:
        immediate: commits take no time, and cannot fail: they need no thread.
        keeps: it keeps batches; otherwise it wants to see none.
    """

    immediate: bool
    keeps: bool

    def open(self, progress: Progress) -> Contents:
        """Examine what is there, repair what can be, and take it up. Called once, before everything else.

        Raises:
            LockedError, FormatError: it cannot be used.
            DamagedError: something acknowledged is lost, and which batches are lost is not certain.
        """

    def commit(self, changes: Sequence["Change | Step"]) -> None:
        """Keep all of the changes or none, as durably as was promised.

        A change applies to what the ones before it have made. A step of a hull that was deleted changes nothing.

        Raises:
            NotCommittedError: none was kept, and none will be found later. Also where a hull is there that is to be
                created, or is not there, or has not the revision that batches follow.
            Exception: anything else: whether they are kept is unknown until `settle` has returned.
        """

    def settle(self) -> None:
        """After a commit with an unknown outcome: decide it. From then on `read` and `row` tell what it was.

        Before, `commit`, `read`, `row` and `oldest` raise StorageError.

        Raises:
            Exception: it cannot be decided as yet; to be called again later.
        """

    def row(self, number: int) -> HullRow | None:
        """The hull of that number, None where there is none."""

    def read(self, number: int, until: int = NEWEST) -> Kept:
        """A hull as it was at revision `until`, or at the last one before, as of the last commit.

        Raises:
            KeyError: there is no hull of that number.
            DamagedError: a part that is needed for it is damaged, or not kept any more.
        """

    def oldest(self, number: int) -> int:
        """The oldest revision of a hull that `read` can go back to; KeyError where there is none of that number."""

    def snapshot(self, number: int, revision: int, points: Points, producers: Mapping[str, int]) -> Iterator["Step"]:
        """Write a snapshot, then drop what it makes superfluous: each step is to be committed before the next is taken.

        A snapshot counts from its last writing step on. Steps are small, so that other commits need not wait for them.
        Close the iterator of a snapshot that is given up; what it leaves, `sweep` drops. Snapshots of several hulls may
        be written at the same time.
        """

    def sweep(self) -> Iterator["Step"]:
        """Drop what deleted hulls and unfinished snapshots have left, in the same way. One at a time."""

    def sync(self) -> None:
        """Make durable what was committed, where commits themselves do not.

        Raises:
            Exception: it is not durable as yet; to be called again later.
        """

    def checkpoint(self) -> None:
        """Housekeeping, called a few times a second beside commits. It may fail, and be called again later."""

    def bytes_used(self) -> int:
        """What it takes on the disk."""

    def close(self) -> None:
        """Let others have it. Called once, after everything else has returned."""
