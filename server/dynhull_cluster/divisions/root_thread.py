"""The thread of a root: it runs the protocol, and blocks where the log does."""

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dynhull_server.engine.driver import Driver
from dynhull_server.engine.waiter import Waiter
from dynhull_server.state.errors import (
    HullNotFoundError,
    NotStoredError,
    OutcomeUnknownError,
    RefusedError,
    StoppingError,
    words,
)
from dynhull_server.state.hull import Hull
from dynhull_server.state.requests import ReadHull
from dynhull_server.storage.port import StorageError

from ..shards import messages as say
from ..shards.epochs import Epochs
from ..shards.logs import FencedError
from ..shards.placement import ShardAddress
from ..shards.requests import AnyRootRequest
from ..shards.root import Root, ShardsDifferError
from .asked import Asked, AskedExpiry, AskedWrite, Asker
from .logs import StoredRootLog

if TYPE_CHECKING:
    from concurrent.futures import Future

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Turn:
    """What a call in the thread leaves to the event loop.

    Attributes:
        messages: what has to be brought to shards; None where there is no root.
        answered: the requests that were answered.
        waits: whether any other request waits.
        opened: whether all shards are open.
        failure: what has ended the root, so that another one is needed; None for nothing.
        generations: the generations whose shards are needed; None where that is not known.
    """

    messages: list[tuple[ShardAddress, say.Request]] | None
    answered: list[Asker]
    waits: bool
    opened: bool
    failure: Exception | None
    generations: frozenset[int] | None


class RootThread:
    """A root, one after the other, in a thread. The methods without a result are called from the event loop.

    Args:
        driver: drives the core that has the hull.
        epoch: that of this server as the owner of its storage.
        hull: the hull that its readers see.
        took: called on the event loop after each call in the thread.

    Attributes:
        answered: receives the requests, in the thread, as they are answered.
        damage: what is damaged, so that every request is refused; None for nothing.
    """

    def __init__(self, driver: Driver, epoch: int, hull: Hull, took: Callable[[Turn], None]) -> None:
        self.answered: list[Asker] = []
        self.damage: Exception | None = None
        self._driver = driver
        self._hull = hull
        self._took = took
        self._loop = asyncio.get_running_loop()
        self._pool = driver.machine.threads.pool("root", 1)
        self._epochs = Epochs(epoch)
        self._root: Root | None = None
        self._log: StoredRootLog | None = None
        self._backlog: list[AnyRootRequest] = []
        self._refusal: Exception | None = None  # why every request is refused
        self._opened = False

    # Called from the event loop

    def submit(self, requests: Sequence[Asked]) -> None:
        """Serve requests, in this order."""
        try:
            self._call(partial(self._submit, requests))
        except RuntimeError:  # it is closed
            _refuse(requests, HullNotFoundError(self._hull.name) if self._hull.ended else StoppingError())
            for each in requests:
                each.tell()

    def receive(self, place: ShardAddress, message: say.Request, reply: say.Reply | None) -> None:
        """Handle the reply of a shard to a message; None where the message came too late."""
        self._do(partial(self._receive, place, message, reply))

    def give_up(self, error: Exception) -> None:
        """Refuse what waits, none of which has happened; go on with what comes."""
        self._do(partial(self._give_up, error))

    def refuse_all(self, error: Exception) -> None:
        """Refuse what waits and what comes."""
        self._do(partial(self._refuse_all, error))

    async def begin(self, known: int) -> Exception | None:
        """Make a root; `known` is the greatest epoch that its shards know of. Returns what prevents that."""
        return await asyncio.wrap_future(self._call(partial(self._make_root, known)))

    async def close(self) -> None:
        """Complete what was called."""
        await asyncio.to_thread(self._pool.shutdown)

    def _do(self, function: Callable[[], None]) -> None:
        try:
            self._call(function)
        except RuntimeError:  # it is closed, and so are those who wait
            return

    def _call(self, function: Callable[[], None]) -> "Future[Exception | None]":
        return self._pool.submit(partial(self._run, function))

    # In the thread

    def _run(self, function: Callable[[], None]) -> Exception | None:
        """Call a function; if it fails, the root has ended. Returns the error."""
        failure: Exception | None = None
        ended_by: Exception | None = None
        try:
            function()
            self._notice_opened()
        except FencedError as error:
            failure = StorageError(str(error))
            ended_by = self._fail(failure)
        except Exception as error:  # a commit, memory, or damage
            failure = error
            ended_by = self._fail(error)
        root = self._root
        messages = None if root is None else root.messages()
        answered, self.answered[:] = list(self.answered), []
        waits = bool(self._backlog) or (root is not None and root.waits)
        opened = root is not None and self._opened
        generations = None if root is None else root.generations
        turn = Turn(messages, answered, waits, opened, ended_by, generations)
        self._loop.call_soon_threadsafe(self._took, turn)
        return failure

    def _make_root(self, known: int) -> None:
        self._log = StoredRootLog(self._driver, self._hull, self._epochs, known)
        settings = self._hull.row.settings
        self._opened = False
        now = self._driver.machine.clock.monotonic()
        as_one = replace(settings, shards=0)  # it admits batches as one hull does
        self._root = Root(as_one, self._driver.limits, settings.shards, self._log, now)
        backlog, self._backlog = self._backlog, []
        self._submit(backlog)

    def _submit(self, requests: Sequence[AnyRootRequest]) -> None:
        for request in requests:
            if isinstance(request, AskedWrite) and request.for_another_hull:
                request.answer(error=HullNotFoundError(self._hull.name))
            elif self._refusal is not None:
                request.answer(error=self._refusal)
            elif self._root is None:
                self._backlog.append(request)
            else:
                self._root.submit(request)

    def _receive(self, place: ShardAddress, message: say.Request, reply: say.Reply | None) -> None:
        if self._root is None:
            return
        if reply is not None:
            self._root.receive(place, reply)
        elif any(each is message for _, each in self._root.messages()):
            raise FencedError("a shard knows of a later root")

    def _notice_opened(self) -> None:
        """Tell the core when points leave, once all shards have said so, and after nothing has left."""
        root, stored = self._root, self._log
        if root is None or stored is None or root.hull is None:
            return
        if not self._opened:
            read = ReadHull(Waiter(), self._hull, lambda state: state.hull.points())
            _, seen = self._driver.ask_from_thread(read)
            if not np.array_equal(seen, root.hull.points()):
                raise ShardsDifferError("the shards have other vertices than those that were decided")
        due = root.due_of_shards()
        lone = any(isinstance(each, AskedExpiry) and not each.result for each in self.answered)
        if not self._opened or lone or due != stored.due:
            self._opened = True
            stored.due = due
            if self._refusal is None:
                stored.follow([])

    def _give_up(self, error: Exception) -> None:
        if self._root is not None:
            self._root.give_up(error)
        else:
            backlog, self._backlog = self._backlog, []
            _refuse(backlog, error)

    def _refuse_all(self, error: Exception) -> None:
        self._refusal = error
        root, self._root = self._root, None
        current, waiting = ([], []) if root is None else root.leave()
        backlog, self._backlog = self._backlog, []
        _refuse([*current, *waiting, *backlog], error)

    def _fail(self, error: Exception) -> Exception | None:
        """End the root. What is under way gets the error, unless that is about something else; what waits goes on.

        Returns the error if another root has to follow.
        """
        root, self._root = self._root, None
        if root is None:
            return None
        current, waiting = root.leave()
        if isinstance(error, ShardsDifferError):
            log.error("a hull over shards is damaged", extra={"hull": self._hull.name, "reason": str(error)})
            self._refusal = NotStoredError(f"the hull is damaged, and only a backup has it: {error}")
            _refuse([*current, *waiting], self._refusal)
            self.damage = error
            return None
        known = isinstance(error, RefusedError | OutcomeUnknownError | StoppingError)
        _refuse(current, error if known else NotStoredError(f"the root has failed: {words(error)}"))
        self._backlog = [*waiting, *self._backlog]
        return None if isinstance(error, HullNotFoundError | StoppingError) else error


def _refuse(requests: Sequence[AnyRootRequest], error: Exception) -> None:
    for request in requests:
        request.answer(error=error)
