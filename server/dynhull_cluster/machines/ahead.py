"""Reading a partition ahead, while another worker serves it."""

import asyncio
import logging
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from dynhull_server.app import Server
from dynhull_server.state.errors import words
from dynhull_server.storage.port import StorageError

from ..postgres.storage import PostgresStorage
from .board import Board
from .entrance import PartitionEntrance

# The reasons for which a partition cannot be read or served at present; ValueError for a file of tokens.
FAILURES = StorageError, OSError, RuntimeError, MemoryError, ValueError
# Seconds between two looks at what has come since.
ROUND = 0.2
# Rounds are short when the last one took at most so many seconds. Then the other worker may let go; also after so many
# rounds that were not, because it writes more than can be read.
SHORT, MOST_ROUNDS = 0.1, 20

log = logging.getLogger(__name__)


class _NoLongerWantedError(Exception):
    """Some other worker should have the partition."""


class Served(NamedTuple):
    """What serves a partition."""

    server: Server
    storage: PostgresStorage
    entrance: PartitionEntrance


class Ahead:
    """A server that follows a partition, from now on until `finish` or `give_up`, and says when it is ready to take it.

    Args:
        number: the partition.
        make: makes the server.
        board: where it says so.

    Attributes:
        failure: why it cannot follow, if it has failed; then the server ends.
        task: the task that follows.
    """

    def __init__(self, number: int, make: Callable[[int], Served], board: Board) -> None:
        self._number = number
        self._make = make
        self._board = board
        self._served: Served | None = None
        self._over = asyncio.Event()
        self._unwanted = self._ended = False
        self.failure: BaseException | None = None
        self.task = asyncio.get_running_loop().create_task(self._run())

    async def finish(self) -> Served | None:
        """Have what was begun completed. Returns the server, which has little left to read; None if it has ended."""
        self._over.set()
        await asyncio.wait([self.task])
        return None if self._ended or self.task.exception() is not None else self._served

    def give_up(self) -> None:
        """Have the task end the server, because it is not wanted any more."""
        self._unwanted = True
        self._over.set()

    async def drop(self) -> None:
        """Give up, and wait until the server has ended."""
        self.give_up()
        await asyncio.wait([self.task])

    async def _run(self) -> None:
        try:
            self._served = self._make(self._number)
            await self._follow(*self._served)
        except _NoLongerWantedError:
            log.info("a partition is no longer read ahead", extra={"partition": self._number})
        except FAILURES as error:
            self.failure = error
        if self._unwanted or self.failure is not None:
            self._ended = True
            if self._served is not None:
                await self._served.server.drain()
            await self._withdraw()

    async def _follow(self, server: Server, storage: PostgresStorage, _: PartitionEntrance) -> None:
        rounds = 0
        offered = False
        while not self._over.is_set():
            begun = time.monotonic()
            await server.read_ahead(storage, self._go_on)
            rounds += 1
            seconds = time.monotonic() - begun
            if not offered and (seconds < SHORT or rounds == MOST_ROUNDS):
                await self._board.offer(self._number, storage.followed_epoch)
                offered = True
            if offered:
                with suppress(TimeoutError):
                    async with asyncio.timeout(ROUND):
                        await self._over.wait()

    def _go_on(self, _done: int, _total: int) -> None:
        if self._unwanted:
            raise _NoLongerWantedError

    async def _withdraw(self) -> None:
        """Say that it is not ready; if the database is away, the owner lets go too early, and the move takes longer."""
        try:
            await self._board.withdraw(self._number)
        except (StorageError, OSError) as error:
            log.warning("a worker is still said to be ready", extra={"partition": self._number, "reason": words(error)})
