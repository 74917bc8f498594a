"""The port: the interface between the engine and any storage.

Calls block until they are complete. One thread commits; any thread may read at any time. A storage starts no threads,
but to keep a lease: the engine calls `sync` and `checkpoint`, and commits the steps of `snapshot` and `sweep`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from ..state.feed_consumers import FeedConsumer
from ..state.fences.model.records import FenceEvent, FenceRow, Inside, KeptFence
from ..state.records import CommitStamp, HullRow, Kept, Record
from .past import EraseRequest, Past
from .refusals import Meaning

if TYPE_CHECKING:
    from ..state.changes import Change

NEWEST = 2**62

Progress = Callable[[int, int], None]


class StorageError(Exception):
    """The storage cannot do what was requested; the message says why, and what to do.

    Attributes:
        for_callers: what callers get instead of the message, if it is only for the log of the server; else empty.
        meaning: whether a server that starts may try again.
    """

    def __init__(self, message: str = "", *, for_callers: str = "", meaning: Meaning = Meaning.FINAL) -> None:
        super().__init__(message)
        self.for_callers = for_callers
        self.meaning = meaning


class NotCommittedError(StorageError):
    """A commit has changed nothing, and will not take effect later.

    Attributes:
        full: whether the disk is full.
    """

    def __init__(
        self, message: str, *, full: bool = False, for_callers: str = "", meaning: Meaning = Meaning.FINAL
    ) -> None:
        super().__init__(message, for_callers=for_callers, meaning=meaning)
        self.full = full


class DamagedError(StorageError):
    """Stored data differs from what was written."""


class LockedError(StorageError):
    """Another server uses this storage."""


class TakenOverError(StorageError):
    """Nothing was committed, and nothing ever will be: the storage belongs to another server. The process must end."""


class FormatError(StorageError):
    """The data was written by a newer version, or by another program."""


class StorageStep(Protocol):
    """A part of a snapshot or of a sweep, committed like a change; its content is private to the storage."""


@dataclass(frozen=True, slots=True)
class StoredContents:
    """The contents of a storage when it is opened.

    Attributes:
        hulls: the hulls, ordered by name.
        next_number: a number greater than that of any hull or fence ever created.
        notes: messages about what was lost or repaired.
        fences: the fences, ordered by name.
        committed: the time of the last commit, in microseconds since 1970; 0 for none.
        commits: the number of the last commit; 0 for none.
    """

    hulls: list[HullRow]
    next_number: int
    notes: list[str]
    fences: list[FenceRow] = field(default_factory=list)
    committed: int = 0
    commits: int = 0


class Storage(Past, Protocol):
    """Keeps hulls and fences.

    Attributes:
        immediate: whether commits take no time and cannot fail, and so need no thread.
        keeps: whether it keeps batches; if not, it is given none. It keeps events in any case.
        epoch: once it is open, a number greater than those of all processes that owned it before; 0 for a storage that
            no process can own while another one may take itself for the owner.
    """

    immediate: bool
    keeps: bool
    epoch: int

    def open(self, progress: Progress) -> StoredContents:
        """Examine the data, repair what can be repaired, and load it. Called once, before all other methods.

        Raises:
            LockedError, FormatError: the storage cannot be used.
            DamagedError: acknowledged batches are lost, and it is uncertain which.
        """

    def commit(self, changes: Sequence["Change | StorageStep"], now: int = 0) -> CommitStamp:
        """Commit all of the changes or none, with the configured durability.

        Changes apply in order. A step of a deleted hull changes nothing. The records keep the number of the commit, and
        its time.

        Args:
            changes: the changes.
            now: the time of the commit, in microseconds since 1970; an earlier one than that of the last commit counts
                as that.

        Returns:
            The commit.

        Raises:
            NotCommittedError: none was committed, and none will be found later. Also if a hull or fence to create
                exists, if one to change does not exist, or if batches or events do not follow the last ones.
            TakenOverError: none was committed, and no other change ever will be.
            Exception: any other error: the outcome is unknown until `settle` has returned.
        """

    def entitled(self) -> bool:
        """Whether reads may be answered from memory: not while another server may have committed something else."""

    def ahead(
        self, changes: Sequence["Change | StorageStep"]
    ) -> tuple[Sequence["StorageStep"], Sequence["Change | StorageStep"]]:
        """What can be committed ahead of large changes, and what is then left of them, so that other commits wait less.

        Commit the steps in their order, some at a time, and then the changes that are returned. The steps have no
        effect before that. Without steps, the changes are the same. To give up, commit nothing more.
        """

    def settle(self) -> CommitStamp:
        """Decide a commit with an unknown outcome. From then on `read` and `row` show the outcome.

        Returns the last commit that has taken place, or a later one that has changed nothing. Until then `commit`,
        `read`, `row` and `oldest` raise StorageError.

        Raises:
            TakenOverError: another server decides from now on.
            Exception: it cannot be decided yet; call this again later.
        """

    def row(self, number: int) -> HullRow | None:
        """The hull with that number, or None."""

    def read(self, number: int, until: int = NEWEST) -> Kept:
        """A hull at revision `until`, or at its last committed revision if that is earlier.

        Raises:
            KeyError: no hull has that number.
            DamagedError: the data for that revision is damaged, or no longer kept.
        """

    def read_each(self, numbers: Sequence[int]) -> Iterator[Kept]:
        """Hulls at their last committed revisions, all of one moment, in this order: faster than one after the other.

        Raises:
            KeyError: no hull has one of the numbers.
            DamagedError: the data of a hull is damaged.
        """

    def oldest(self, number: int) -> int:
        """The oldest revision of a hull that `read` can return; KeyError if no hull has that number."""

    def snapshot(self, number: int, kept: Kept) -> Iterator["StorageStep"]:
        """Write a snapshot, then drop the rows it supersedes: commit each step before the next is taken.

        The records of `kept` are not written. A snapshot is valid from its last writing step on. Steps are small, so
        that other commits wait only briefly for them. To abandon a snapshot, close its iterator; `sweep` drops the rest
        of it. Snapshots of several hulls may be written at the same time.
        """

    def why_no_history(self) -> str:
        """Why it cannot keep what the journal drops; empty if it can."""

    def set_history(self, number: int, max_age: int, max_bytes: int) -> "StorageStep":
        """Change for how many microseconds, and in how many bytes, what the journal drops of a hull is kept.

        As in `HullSettings`. `row` has it after the commit of the step.
        """

    def file_history(self, now: int) -> Iterator["StorageStep"]:
        """Write segments of what the journal need not have any longer, and drop those that have become too old.

        Commit each step before the next is taken. A segment counts from its step on: a kill leaves its batches in the
        journal, or in it. Run only one at a time, on a thread that may take its time.

        Args:
            now: the time in microseconds since 1970.

        Raises:
            OSError: the disk is full, or fails: the journal keeps what is not in segments.
            DamagedError: a row of the journal is damaged.
        """

    def erase(self, number: int, requests: Sequence[EraseRequest], until: int, now: int) -> Iterator["StorageStep"]:
        """Erase keys from the past of a hull up to revision `until`, as of which it does not have them.

        All requests at once; each says then what was erased for it. A key that several name is that of the first.

        Two snapshots as of that revision, or later ones, are there. Commit each step before the next is taken; one of
        them erases everything. Before it a kill leaves all as it was, and after it no key comes back. Run only one at a
        time, and not beside `file_history`, on a thread that may take its time.

        Args:
            number: the hull. If it is not there any more, nothing is left to do.
            requests: the keys.
            until: the revision.
            now: the time in microseconds since 1970.

        Raises:
            OSError: the disk is full, or fails.
            DamagedError: the data is damaged.
        """

    def cut(self, number: int, last: int) -> "StorageStep | None":
        """Drop the revisions of a shard after `last`, which is not before its last snapshot; None for none.

        Commit the step at once; it may be followed by batches in the same commit. Each commit before it has added the
        batches of `last` and those after it apart.

        Raises:
            KeyError: no hull has that number.
            DamagedError: the data is damaged.
        """

    def sweep(self) -> Iterator["StorageStep"]:
        """Drop what nobody needs of deleted hulls and fences, unfinished snapshots and dropped events, in the same way.

        Run only one sweep at a time.
        """

    def feed_consumers(self) -> list[FeedConsumer]:
        """The consumers of feeds as last committed, in no order."""

    def read_fences(self, numbers: Sequence[int]) -> list[KeptFence | None]:
        """Fences as last committed, with the events that follow who was inside; None where no fence has that number.

        Raises:
            DamagedError: the data is damaged.
        """

    def read_events(self, number: int, after: int, most: int) -> list[FenceEvent]:
        """At most that many events of a fence after a sequence, from the oldest one that is kept.

        Raises:
            KeyError: no fence has that number.
            DamagedError: the data is damaged.
        """

    def inside(self, number: int, inside: Inside) -> Iterator["StorageStep"]:
        """Write who is inside of a fence, then drop what that supersedes: commit each step before the next is taken.

        It is valid from its last writing step on. Events that follow it are not dropped by `DropEvents`.
        """

    def boundary(self, number: int, first: int) -> int:
        """The greatest sequence up to `first` before which `DropEvents` drops all events.

        KeyError if no fence has that number.
        """

    def sync(self) -> None:
        """Make earlier commits durable, for storages whose commits are not.

        Raises:
            Exception: they are not durable yet; call this again later.
        """

    def checkpoint(self) -> None:
        """Housekeeping, called several times per second during commits. It may fail, and is called again later."""

    def bytes_used(self) -> int:
        """The size on the disk in bytes."""

    def close(self) -> None:
        """Release the storage. Called once, after all other calls have returned."""


class FollowedStorage(Storage, Protocol):
    """A storage that can be read while another server owns it, so that little is left to read for `open`.

    From the first `follow` on, `read_each` and `read_since` read it as of the last one. After an error only
    `close` may be called.
    """

    def follow(self, progress: Progress) -> StoredContents:
        """Examine the data; again, before `open`, to find what has come since.

        Raises:
            DamagedError: something is damaged, which `open` could perhaps repair.
            StorageError: it cannot be read, or what has come since does not follow what there was.
        """

    def read_since(self, after: Mapping[int, int]) -> Iterator[tuple[int, list[Record]]]:
        """The batches of hulls after these revisions, by number; of hulls that have any.

        Raises:
            DamagedError: the data of a hull is damaged.
        """
