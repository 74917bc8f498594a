"""What tortures of relays share: processes that are killed and started again, and a thread that writes meanwhile."""

import random
import subprocess
import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from forked import Process
from mortal_server import MortalServer
from pacing import pause

from dynhull_client import DynhullError, HullClient

PAUSE = 0.02
ANSWERED_WITHIN = 20  # seconds


class Killed:
    """A process that is killed and started again."""

    def __init__(self, command: Sequence[object], log: Path) -> None:
        self._command = [*map(str, command)]
        self._log = log
        self.start()

    def start(self) -> None:
        with self._log.open("ab") as log:
            self._process = Process(self._command, stdout=subprocess.DEVNULL, stderr=log, text=True)

    def kill(self) -> None:
        code = self._process.poll()
        assert code is None, f"{self._command[1]} has ended with {code}: {self._log.read_text()[-2000:]}"
        self._process.kill()
        self._process.wait()


class Writer(threading.Thread, ABC):
    """Writes to a server that is killed, and counts what follows from that."""

    def __init__(self, server: MortalServer, seed: int) -> None:
        super().__init__()
        self.failure: BaseException | None = None
        self.rng = random.Random(f"{seed}/writer")
        self._server = server
        self._ending = threading.Event()

    @abstractmethod
    def step(self, client: HullClient) -> None:
        """Write something."""

    def stop(self) -> None:
        self._ending.set()
        self.join()
        if self.failure is not None:
            raise self.failure

    def run(self) -> None:
        try:
            with HullClient(self._server.address) as client:
                while not self._ending.is_set():
                    self.step(client)
                    pause(self.rng.uniform(0, PAUSE))
        except BaseException as error:  # for the thread that waits for this one
            self.failure = error

    def put(self, client: HullClient, name: str, keys: list[str], points: Sequence[Sequence[float]]) -> None:
        """Put keys. One that repeats another changes nothing: without an answer it is sent again."""
        while True:
            self._server.up.wait()
            try:
                client.put(name, keys, points, timeout=ANSWERED_WITHIN)
                return
            except DynhullError:
                if self._server.up.is_set():
                    pause(PAUSE)
