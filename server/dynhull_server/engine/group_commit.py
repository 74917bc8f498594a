"""Group commit: one thread commits, and whatever arrives while a commit is under way shares the next."""

from collections.abc import Callable
from dataclasses import dataclass

from ..state.records import Change
from ..storage.port import NotCommittedError, Step, Storage
from .threads import Inbox, Threads

# What became of a commit: None, or why it failed, and whether it is unknown if it did.
Done = Callable[[Exception | None, bool], None]


@dataclass(slots=True)
class _Waiting:
    changes: list[Change] | list[Step]
    done: Done


class GroupCommit:
    """Commits changes in the order they come; those of one `submit` together.

    Args:
        storage: where to.
        threads: makes the thread.
        report: called in the thread with what failed in a commit; with None when one has succeeded.
        died: called in the thread when it ends though it should not.
    """

    def __init__(
        self,
        storage: Storage,
        threads: Threads,
        report: Callable[[BaseException | None], None],
        died: Callable[[BaseException], None],
    ) -> None:
        self._storage = storage
        self._report = report
        self._inbox: Inbox[_Waiting] = threads.inbox()
        self._thread = threads.spawn("commits", self._run, died)

    def submit(self, changes: list[Change] | list[Step], done: Done) -> None:
        """Commit the changes, then call `done`, in the committing thread."""
        self._inbox.put(_Waiting(changes, done))

    def close(self) -> None:
        """Commit what waits, and stop. Blocks."""
        self._inbox.close()
        self._thread.join()

    def _run(self) -> None:
        while group := self._inbox.take():
            self._commit(group)

    def _commit(self, group: list[_Waiting]) -> None:
        try:
            self._storage.commit([change for each in group for change in each.changes])
        except NotCommittedError as error:
            if len(group) == 1:
                group[0].done(error, False)
                self._report(error)
            else:  # one too large for the disk must not take the small ones with it
                for each in group:
                    self._commit([each])
        except Exception as error:  # a MemoryError, too: whatever it is, the changes may be there
            for each in group:
                each.done(error, True)
            self._report(error)
        else:
            for each in group:
                each.done(None, False)
            self._report(None)
