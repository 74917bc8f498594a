"""Group commit: one thread commits, and whatever arrives while a commit is under way shares the next."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..state.records import Change
from ..storage.port import NotCommittedError, Step, Storage
from .threads import Clock, Inbox, Threads

# What became of a commit: None, or why it failed, and whether it is unknown if it did.
Done = Callable[[Exception | None, bool], None]


@dataclass(slots=True)
class _Waiting:
    """Changes to commit; without any, somebody who wants earlier commits to be decided."""

    changes: Sequence[Change | Step]
    done: Done


class GroupCommit:
    """Commits changes in the order they come; those of one `submit` together.

    After a commit with an unknown outcome nothing is committed until it has been decided.

    Args:
        storage: where to.
        threads: makes the thread.
        clock: time.
        report: called in the thread with what failed in a commit; with None when one has succeeded.
        died: called in the thread when it ends though it should not.

    Attributes:
        since: when what is under way began, on the clock; None while nothing is.
    """

    def __init__(
        self,
        storage: Storage,
        threads: Threads,
        clock: Clock,
        report: Callable[[BaseException | None], None],
        died: Callable[[BaseException], None],
    ) -> None:
        self._storage = storage
        self._report = report
        self._clock = clock
        self._undecided = False
        self.since: float | None = None
        self._inbox: Inbox[_Waiting] = threads.inbox()
        self._thread = threads.spawn("commits", self._run, died)

    def submit(self, changes: Sequence[Change | Step], done: Done) -> None:
        """Commit the changes, then call `done`, in the committing thread."""
        self._inbox.put(_Waiting(changes, done))

    def settle(self, done: Done) -> None:
        """Decide what became of earlier commits, then call `done`, in the committing thread."""
        self._inbox.put(_Waiting((), done))

    def close(self) -> None:
        """Commit what waits, and stop. Blocks."""
        self._inbox.close()
        self._thread.join()

    def _run(self) -> None:
        while group := self._inbox.take():
            self.since = self._clock.monotonic()
            if self._decided(group):
                self._commit([each for each in group if each.changes])
                for each in group:
                    if not each.changes:
                        each.done(None, False)
            self.since = None

    def _decided(self, group: list[_Waiting]) -> bool:
        """Whether nothing of earlier commits is unknown; otherwise the group has been refused."""
        if not self._undecided:
            return True
        try:
            self._storage.settle()
        except Exception as error:
            refusal = NotCommittedError(f"an earlier commit failed, and the disk cannot be read yet: {error}")
            for each in group:
                each.done(refusal, False)
            self._report(error)
            return False
        self._undecided = False
        return True

    def _commit(self, group: list[_Waiting]) -> None:
        if not group:
            return
        try:
            self._storage.commit([change for each in group for change in each.changes])
        except NotCommittedError as error:
            if len(group) == 1:
                group[0].done(error, False)
                self._report(error)
            else:  # one too large for the disk must not take the small ones with it
                self._commit_apart(group)
        except Exception as error:  # a MemoryError, too: whatever it is, the changes may be there
            self._undecided = True
            for each in group:
                each.done(error, True)
            self._report(error)
        else:
            for each in group:
                each.done(None, False)
            self._report(None)

    def _commit_apart(self, group: list[_Waiting]) -> None:
        for each in group:
            if self._decided([each]):
                self._commit([each])
