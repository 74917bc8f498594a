"""One process of the server, kept alive by the supervisor."""

import asyncio
import logging
import multiprocessing
import os
import signal
import socket
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from itertools import count
from multiprocessing.process import BaseProcess
from typing import Any, cast

from . import child
from .line import ProcessLine

# Seconds before a process that has ended is started again: at first, and at most. One that has served for a while is
# started again at once.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 10.0
SERVED_SECONDS = 10.0
# Seconds beyond the grace period that a process has to end.
LAST_SECONDS = 10.0
# Seconds to wait for the metrics of a process.
METRICS_SECONDS = 5.0

# Processes are forked from one that has imported what they run: this takes seconds, which a restart does not have.
PROCESSES = multiprocessing.get_context("forkserver")
IMPORTED = [child.__name__]

log = logging.getLogger(__name__)


def prepare(modules: Sequence[str]) -> None:
    """Have the process that forks others import what they will run, these modules; before the first is started."""
    PROCESSES.set_forkserver_preload([*IMPORTED, *modules])


class StartFailedError(Exception):
    """A process has ended before it served; it has said why.

    Attributes:
        code: its exit code.
    """

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class ChildProcess:
    """A worker or a gateway, in a process of its own, which is started again whenever it ends.

    Args:
        name: its name, as "worker-0".
        begin: the first message to it.
        grace: the seconds that it has to end its calls.

    Attributes:
        name: its name.
        starts: how often it was started.
        serving: set while it serves.
        address: where it served last.
    """

    def __init__(self, name: str, begin: dict[str, Any], grace: float) -> None:
        self.name = name
        self.starts = 0
        self.serving = asyncio.Event()
        self.address = ""
        self._begin = {**begin, "process": name}
        self._grace = grace
        self._stop = asyncio.Event()
        self._restarting = False
        self._process: BaseProcess | None = None
        self._ended: asyncio.Future[None]
        self._line: ProcessLine | None = None
        self._numbers = count(1)
        self._asked: dict[int, asyncio.Future[str | None]] = {}

    async def run(self) -> None:
        """Run it until `stop`. Raises StartFailedError if it ends before it has served for the first time."""
        pause = FIRST_PAUSE
        while not self._stop.is_set():
            begun = time.monotonic()
            code = await self._live()
            if self._stop.is_set() or self._restarting:
                self._restarting = False
                continue
            if not self.address:
                raise StartFailedError(code)
            log.error("a process has ended, and is started again", extra={"ended": self.name, "code": code})
            if time.monotonic() - begun > SERVED_SECONDS:
                pause = FIRST_PAUSE
                continue
            with suppress(TimeoutError):
                async with asyncio.timeout(pause):
                    await self._stop.wait()
            pause = min(2 * pause, LONGEST_PAUSE)

    def heir(self) -> "ChildProcess":
        """Another one that is to serve in its place. It has served, as it were: it is started until it does."""
        heir = ChildProcess(self.name, self._begin, self._grace)
        heir.starts, heir.address = self.starts, self.address
        return heir

    async def restart(self) -> None:
        """Have it end its calls, and wait until its successor serves."""
        self._restarting = self._process is not None
        await self._end()
        await self.serving.wait()

    async def stop(self) -> None:
        """Have it end its calls, and wait until it has ended."""
        self._stop.set()
        await self._end()

    async def metrics(self) -> str | None:
        """Its page of metrics; None if it does not answer."""
        if self._line is None or not self.serving.is_set():
            return None
        number = next(self._numbers)
        answer: asyncio.Future[str | None] = asyncio.get_running_loop().create_future()
        self._asked[number] = answer
        self._line.send({"metrics": number})
        try:
            async with asyncio.timeout(METRICS_SECONDS):
                return await answer
        except TimeoutError:
            return None
        finally:
            del self._asked[number]

    async def _live(self) -> int:
        """Start it, and listen to it until it ends. Returns its exit code, negative for a signal."""
        with ExitStack() as failed:
            try:
                ours, theirs = socket.socketpair()
                failed.callback(ours.close)
                with theirs:
                    process = PROCESSES.Process(target=child.main, args=(theirs,), name=self.name)
                    process.start()
            except (OSError, EOFError) as error:  # no descriptors, processes or memory: for the moment, or for good
                reason = str(error) or "the process that forks others has ended"
                log.error("a process cannot be started", extra={"failed": self.name, "reason": reason})
                return os.EX_OSERR
            failed.pop_all()
        self._process = process
        self._ended = ended = asyncio.get_running_loop().create_future()
        self.starts += 1
        line = self._line = await ProcessLine.on(ours)
        line.send(self._begin)
        try:
            while (message := await line.receive()) is not None:
                if "serving" in message:
                    self.address = message["serving"]
                    self.serving.set()
                elif (answer := self._asked.get(message["metrics"])) is not None and not answer.done():
                    answer.set_result(message["page"])
            await _reported(process)
            process.join()
            return process.exitcode or 0
        finally:
            self.serving.clear()
            self._line = self._process = None
            line.close()
            for answer in self._asked.values():
                if not answer.done():
                    answer.set_result(None)
            if process.exitcode is None:
                process.kill()
            ended.set_result(None)

    async def _end(self) -> None:
        """Send SIGTERM, and SIGKILL if that has not ended it in time."""
        process = self._process
        if process is None:
            return
        ended = self._ended
        _signal(process, signal.SIGTERM)
        try:
            async with asyncio.timeout(self._grace + LAST_SECONDS):
                await asyncio.shield(ended)
        except TimeoutError:
            log.error("a process does not end: it is killed", extra={"killed": self.name})
            _signal(process, signal.SIGKILL)
            await ended


def _signal(process: BaseProcess, number: int) -> None:
    """Send a signal, also when the process that forked it has ended: multiprocessing then takes both for ended."""
    with suppress(ProcessLookupError):
        os.kill(cast("int", process.pid), number)


async def _reported(process: BaseProcess) -> None:
    """Wait until the process that forked this one says that it has ended, or has ended itself."""
    loop = asyncio.get_running_loop()
    reported = asyncio.Event()
    loop.add_reader(process.sentinel, reported.set)
    try:
        await reported.wait()
    finally:
        loop.remove_reader(process.sentinel)
