"""A storage that fails when the plan says so, and reports to the model what it has kept."""

import errno
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from dynhull_server.state.feed_consumers import FeedConsumer
from dynhull_server.state.fences.model.records import FenceEvent, Inside, KeptFence
from dynhull_server.state.records import CommitStamp, Contents, HullRow, Kept, Keys, Parts, Record
from dynhull_server.state.tracks import KeyChanges
from dynhull_server.storage.past import EraseRequest, Erasure, Hole, Moment, StoredHistory
from dynhull_server.storage.port import NEWEST, NotCommittedError, Progress, Storage, StorageStep, StoredContents

from .model import Model

if TYPE_CHECKING:
    from .machine import SimulatedThreads

ERRORS: dict[str, Callable[[str], Exception]] = {
    "os": OSError,
    "memory": MemoryError,
    "disk full": partial(OSError, errno.ENOSPC),
}

Found = TypeVar("Found")


class KilledError(Exception):
    """The server was killed where the plan says so."""


class FaultyStorage:
    """Stands before another storage. It outlives the servers: each life opens it anew.

    Args:
        inner: keeps the hulls, and never fails.
        model: hears of everything that is kept.
        faults: what fails: the nth call of a method and the `calls` - 1 after it.
        immediate: whether commits take no time; then nothing may fail.

    Attributes:
        calm: whether nothing fails any more.
        dead: whether the server has been killed: its remains cannot touch the storage.
        killing: whether it is to be killed now, where a thread has come to.
        give_way: called where another thread may go on: before a commit or read, and after it.
        threads: those of the server, if it has any.
    """

    def __init__(self, inner: Storage, model: Model, faults: Sequence[dict[str, Any]], *, immediate: bool) -> None:
        self.immediate = immediate
        self.keeps = True
        self.epoch = 0
        self.calm = self.dead = self.killing = False
        self.give_way: Callable[[], None] = lambda: None
        self.threads: SimulatedThreads | None = None
        self._inner = inner
        self._model = model
        self._faults = {
            (fault["at"], fault["nth"] + more): fault["kind"] for fault in faults for more in range(fault["calls"])
        }
        self._calls: Counter[str] = Counter()
        self._undecided: tuple[Sequence[Any], int, bool] | None = None

    def _fault(self, place: str) -> str | None:
        if self.dead:
            raise SystemExit("a killed server's remains come to the storage")
        self._calls[place] += 1
        kind = None if self.calm else self._faults.get((place, self._calls[place]))
        if kind == "kill":
            self.kill()
        if kind is not None:
            self._model.faulty = True
        return kind

    def kill(self) -> NoReturn:
        """Kill the server, in the middle of what one of its threads does."""
        self.killing = True
        self.give_way()
        raise SystemExit("a thread goes on after a kill")

    def _fail(self, place: str) -> None:
        kind = self._fault(place)
        if kind is not None:
            raise ERRORS[kind](f"{place} fails, as planned")

    def open(self, progress: Progress) -> StoredContents:
        """Decide what was left undecided, and take up everything."""
        self.dead = False
        self._decide()
        return self._inner.open(progress)

    def back_up(self) -> None:
        """Copy it as it is now."""
        raise NotImplementedError("only folders are copied")

    def restore(self) -> None:
        """Have the next life find the last copy, if there is one, in place of what is there."""
        raise NotImplementedError("only folders are copied")

    def commit(self, changes: Sequence[Any], now: int = 0) -> CommitStamp:
        """Keep the changes, and fail before, instead or afterwards."""
        self.give_way()
        kind = self._fault("commit")
        self._decide()
        match kind:
            case None:
                commit = self._keep(changes, now)
            case "nothing":
                raise NotCommittedError("the commit fails, as planned")
            case "full":
                raise NotCommittedError("the disk is full, as planned", full=True)
            case "later lost" | "later ghost":
                self._undecided = changes, now, kind == "later ghost"
                raise OSError("the commit fails, as planned")
            case _:
                if kind.startswith("ghost"):
                    self._keep(changes, now)
                raise (MemoryError if kind.endswith("memory") else OSError)("the commit fails, as planned")
        self.give_way()
        return commit

    def _keep(self, changes: Sequence[Any], now: int) -> CommitStamp:
        self._model.landed(changes, now)
        try:
            return self._inner.commit(changes, now)
        except Exception as error:
            raise self._model.finds(f"the storage was asked for the impossible: {changes}: {error!r}") from error

    def _decide(self) -> None:
        if self._undecided is not None:
            changes, now, kept = self._undecided
            self._undecided = None
            if kept:
                self._keep(changes, now)

    def settle(self) -> CommitStamp:
        """Decide what was left undecided."""
        self._fail("settle")
        self._decide()
        return self._inner.settle()

    def row(self, number: int) -> HullRow | None:
        """The row of a hull."""
        self._fail("row")
        return self._inner.row(number)

    def read(self, number: int, until: int = NEWEST) -> Kept:
        """A hull."""
        self.give_way()
        self._fail("read")
        kept = self._inner.read(number, until)
        self.give_way()
        return kept

    def read_each(self, numbers: Sequence[int]) -> Iterator[Kept]:
        """Hulls, as at the start."""
        for kept in self._inner.read_each(numbers):
            self.give_way()
            self._fail("read")
            yield kept

    def oldest(self, number: int) -> int:
        """The oldest revision of a hull."""
        self._fail("oldest")
        return self._inner.oldest(number)

    def feed_consumers(self) -> list[FeedConsumer]:
        """Consumers of feeds."""
        self._fail("read")
        return self._inner.feed_consumers()

    def read_fences(self, numbers: Sequence[int]) -> list[KeptFence | None]:
        """Fences."""
        self.give_way()
        self._fail("read")
        kept = self._inner.read_fences(numbers)
        self.give_way()
        return kept

    def read_events(self, number: int, after: int, most: int) -> list[FenceEvent]:
        """Events of a fence."""
        self.give_way()
        self._fail("read")
        events = self._inner.read_events(number, after, most)
        self.give_way()
        return events

    def ahead(self, changes: Sequence[Any]) -> tuple[Sequence[Any], Sequence[Any]]:
        return (), changes

    def boundary(self, number: int, first: int) -> int:
        """Before which event all events can be dropped."""
        self._fail("read")
        return self._inner.boundary(number, first)

    def inside(self, number: int, inside: Inside) -> Iterator[StorageStep]:
        """Steps; each may fail."""
        for step in self._inner.inside(number, inside):
            self.give_way()
            self._fail("snapshot")
            yield step

    def snapshot(self, number: int, kept: Kept) -> Iterator[StorageStep]:
        """Steps; each may fail."""
        for step in self._inner.snapshot(number, kept):
            self.give_way()
            self._fail("snapshot")
            yield step

    def sweep(self) -> Iterator[StorageStep]:
        """Steps; each may fail."""
        self._fail("sweep")
        for step in self._inner.sweep():
            self.give_way()
            self._fail("sweep")
            yield step

    # The past

    def file_history(self, now: int) -> Iterator[StorageStep]:
        """Steps; each may fail."""
        yield from self._steps(self._inner.file_history(now))

    def erase(self, number: int, requests: Sequence[EraseRequest], until: int, now: int) -> Iterator[StorageStep]:
        """Steps; each may fail."""
        yield from self._steps(self._inner.erase(number, requests, until, now))

    def _steps(self, steps: Iterator[StorageStep]) -> Iterator[StorageStep]:
        with closing(steps):  # type: ignore[type-var]  # all are generators
            for step in steps:
                self.give_way()
                self._fail("history")
                yield step
                self.give_way()

    def why_no_history(self) -> str:
        """Why it keeps none."""
        return self._inner.why_no_history()

    def set_history(self, number: int, max_age: int, max_bytes: int) -> StorageStep:
        """The step that changes how much is kept."""
        return self._inner.set_history(number, max_age, max_bytes)

    @property
    def keeps_past(self) -> bool:
        """Whether what is before the newest snapshots is kept."""
        return not self.immediate

    def files_are_needed(self, now: int) -> bool:
        """Whether each file of the past is one of a segment, and nothing is to be filed or removed at that time."""
        del now
        return True

    def erasures(self, number: int) -> tuple[Erasure, ...]:
        """What was erased."""
        return self._inner.erasures(number)

    def history(self, number: int) -> StoredHistory:
        """What there is."""
        return self._of_past(lambda: self._inner.history(number))

    def holes(self) -> list[Hole]:
        """What could not be read."""
        return self._inner.holes()

    def oldest_moment(self, number: int, *, timed: bool = False) -> Moment:
        """The oldest revision."""
        return self._of_past(lambda: self._inner.oldest_moment(number, timed=timed))

    def moment(self, number: int, time: int) -> Moment | None:
        """The revision as of a time."""
        return self._of_past(lambda: self._inner.moment(number, time))

    def state_revision(self, number: int, until: int) -> int:
        """The revision of a kept state."""
        return self._of_past(lambda: self._inner.state_revision(number, until))

    def state(self, number: int, until: int) -> tuple[Kept, Parts]:
        """A kept state."""
        return self._of_past(lambda: self._inner.state(number, until))

    def batches(self, number: int, after: int, until: int) -> list[Record]:
        """Some batches."""
        return self._of_past(lambda: self._inner.batches(number, after, until))

    def gathered(self, number: int, after: int, until: int) -> list[Record]:
        """What some batches come to."""
        return self._of_past(lambda: self._inner.gathered(number, after, until))

    def key_state(self, number: int, keys: Keys, until: int) -> tuple[int, Any, Contents]:
        """A kept state of some keys."""
        return self._of_past(lambda: self._inner.key_state(number, keys, until))

    def key_changes(self, number: int, keys: Keys, after: int, until: int) -> tuple[int, KeyChanges]:
        """What some batches do to some keys."""
        return self._of_past(lambda: self._inner.key_changes(number, keys, after, until))

    def ways(self, number: int, after: int, until: int, read: Callable[[Iterator[Any]], Any]) -> tuple[int, Any]:
        """What a function makes of the moves of keys."""
        return self._of_past(lambda: self._inner.ways(number, after, until, read))

    def _of_past(self, read: Callable[[], Found]) -> Found:
        self.give_way()
        self._fail("past")
        found = read()
        self.give_way()
        return found

    def sync(self) -> None:
        """Fails, perhaps."""
        self.give_way()
        self._fail("sync")
        self._inner.sync()

    def checkpoint(self) -> None:
        """Fails, perhaps."""
        self.give_way()
        self._fail("checkpoint")
        self._inner.checkpoint()

    def bytes_used(self) -> int:
        """What it takes."""
        return self._inner.bytes_used()

    def close(self) -> None:
        """The next life opens it again."""

    def remove(self) -> None:
        """Nothing of it is needed any more."""
