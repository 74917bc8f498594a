"""Group commit: one thread commits, and changes that arrive during a commit share the next one.

Large changes are committed in pieces, as far as the storage allows, each together with what has arrived meanwhile.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from ..state.changes import Change
from ..state.errors import words, words_for_callers
from ..storage.port import NotCommittedError, Storage, StorageStep, TakenOverError
from .threads import Clock, Inbox, Threads

if TYPE_CHECKING:
    from ..state.records import CommitStamp

# Called with the outcome of a commit: its error or None, and whether the outcome is unknown.
Done = Callable[[Exception | None, bool], None]
# Steps ahead of a large change that are committed together.
STEPS_TOGETHER = 4


@dataclass(slots=True)
class _Waiting:
    """Changes to commit; without any, a request to decide earlier commits."""

    changes: Sequence[Change | StorageStep]
    done: Done


class _Large:
    """Changes that are committed in pieces.

    Args:
        steps: what is committed ahead of them.
        waiting: the changes that are left then.

    Attributes:
        over: whether the last piece has been taken, or one has failed.
    """

    def __init__(self, steps: Sequence[StorageStep], waiting: _Waiting) -> None:
        self._steps = deque(steps)
        self._waiting = waiting
        self.over = False

    def piece(self) -> _Waiting:
        """The next piece."""
        if self._steps:
            return _Waiting([self._steps.popleft() for _ in range(min(len(self._steps), STEPS_TOGETHER))], self._done)
        self.over = True
        return self._waiting

    def _done(self, error: Exception | None, unknown: bool) -> None:
        if error is not None:
            self.over = True
            self._waiting.done(error, unknown)


class GroupCommit:
    """Commits changes in order of arrival; those of one `submit` together.

    After a commit with an unknown outcome nothing is committed until the outcome is decided.

    Args:
        storage: keeps the changes.
        threads: creates the thread.
        clock: the time.
        time: the time that commits have, in microseconds since 1970.
        report: called in the thread with the error of a failed commit, and with None after a successful one.
        died: called in the thread with the error that ends it unexpectedly.

    Attributes:
        since: the time by the clock when the commit in progress began; None while there is none.
        latest: the last commit that has taken place, set before `done` is called for it, and when an outcome is
            decided; None before the first.
        undecided: whether the outcome of the last commit is unknown.
    """

    def __init__(
        self,
        storage: Storage,
        threads: Threads,
        clock: Clock,
        time: Callable[[], int],
        report: Callable[[BaseException | None], None],
        died: Callable[[BaseException], None],
    ) -> None:
        self._storage = storage
        self._report = report
        self._clock = clock
        self._time = time
        self.undecided = False
        self.since: float | None = None
        self.latest: CommitStamp | None = None
        self._inbox: Inbox[_Waiting] = threads.inbox()
        self._thread = threads.spawn("commits", self._run, died)

    def submit(self, changes: Sequence[Change | StorageStep], done: Done) -> None:
        """Commit the changes, then call `done`, in the committing thread."""
        self._inbox.put(_Waiting(changes, done))

    def settle(self, done: Done) -> None:
        """Decide the outcome of earlier commits, then call `done`, in the committing thread."""
        self._inbox.put(_Waiting((), done))

    def close(self) -> None:
        """Commit the waiting changes, and stop. Blocks."""
        self._inbox.close()
        self._thread.join()

    def _run(self) -> None:
        large: list[_Large] = []
        while True:
            arrived = self._inbox.take(wait=not large)
            if not arrived and not large:
                return
            self.since = self._clock.monotonic()
            group = [each.piece() for each in large]
            for each in arrived:
                later = self._in_pieces(each)
                if later is not None:
                    large.append(later)
                group.append(each if later is None else later.piece())
            if self._decided(group):
                self._commit([each for each in group if each.changes])
                for each in group:
                    if not each.changes:
                        each.done(None, False)
            large = [each for each in large if not each.over]
            self.since = None

    def _in_pieces(self, waiting: _Waiting) -> _Large | None:
        """Changes in pieces; None for those that are committed at once."""
        try:
            steps, changes = self._storage.ahead(waiting.changes)
        except MemoryError:  # at once, then, if that is possible
            return None
        return _Large(steps, _Waiting(changes, waiting.done)) if steps else None

    def _decided(self, group: list[_Waiting]) -> bool:
        """Whether the outcomes of all earlier commits are known; if not, the group has been refused."""
        if not self.undecided:
            return True
        try:
            self.latest = self._storage.settle()
        except TakenOverError as error:
            self._end(group, error)
        except Exception as error:
            refused = "an earlier commit failed, and the storage cannot be read yet"
            refusal = NotCommittedError(
                f"{refused}: {words(error)}", for_callers=f"{refused}: {words_for_callers(error)}"
            )
            for each in group:
                each.done(refusal, False)
            self._report(error)
            return False
        self.undecided = False
        return True

    def _commit(self, group: list[_Waiting]) -> None:
        if not group:
            return
        try:
            self.latest = self._storage.commit([change for each in group for change in each.changes], self._time())
        except NotCommittedError as error:
            if len(group) == 1:
                group[0].done(error, False)
                self._report(error)
            else:  # changes too large for the disk must not fail the others
                self._commit_apart(group)
        except TakenOverError as error:
            self._end(group, error)
        except Exception as error:  # after any error, such as a MemoryError, the changes may be stored
            self.undecided = True
            for each in group:
                each.done(error, True)
            self._report(error)
        else:
            for each in group:
                each.done(None, False)
            self._report(None)

    def _end(self, group: list[_Waiting], error: TakenOverError) -> NoReturn:
        """Refuse the group, and end the thread and with it the process."""
        for each in group:
            each.done(NotCommittedError(str(error)), False)
        raise error

    def _commit_apart(self, group: list[_Waiting]) -> None:
        for each in group:
            if self._decided([each]):
                self._commit([each])
