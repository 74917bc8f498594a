"""Torture of a real server on a real PostgreSQL: each of them, and what is between them, fails in turn.

    python tests/robustness/cluster/postgres_torture.py --faults 100

The clients and the models are those of tests/robustness/server/torture.py, and so are the promises. The faults:

* the server is killed, and started again; or another one takes over
* the server is stopped until another one has taken over, and then goes on: it must end, and tell its callers
* PostgreSQL ends the connections of the server; is killed and started again; is stopped for a while; has no room
* the network between the two is cut; or passes nothing on for a while
* the database is copied while it is served, and a server begins on the copy: it has what was acknowledged, and nothing
  of what it takes arrives
* the partitions of several workers are moved by hand
"""

import argparse
import os
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import grpc
from psycopg.conninfo import conninfo_to_dict, make_conninfo

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

sys.path.append(str(Path(__file__).parents[1] / "server"))
sys.path.append(str(Path(__file__).parents[2] / "support"))
import torture
from actors import persist
from cluster import processes
from pacing import pause
from patience import PATIENCE, wait_until
from postgresql import FAST, PostgreSQL, postgresql, query
from promises import require
from proxy import Proxy
from server_process import run as run_command
from small_disk import arguments, on_small_disk
from tortured import Server, killed_at_the_end

DISK = "256m"
# So that a disk of that size can be full, and yet have room for the log.
SMALL = (*FAST, "max_wal_size=64MB", "min_wal_size=32MB")
KINDS = ["zombie", "crash", "terminate", "cut", "kill", "hold", "replace", "freeze", "terminate", "full_disk", "copy"]
OF_WORKERS = [
    "kill_worker",
    "crash",
    "pause_worker",
    "terminate",
    "restart",
    "cut",
    "move",
    "replace",
    "freeze",
    "copy",
    "full_disk",
]
SERVED = "SELECT worker FROM owners WHERE until > '-infinity' AND address <> ''"
ENDED = 70  # the exit code of a server that cannot go on


class Torture(torture.Torture):
    """A server on PostgreSQL, which it reaches through a proxy."""

    def __init__(
        self,
        folder: Path,
        seed: int,
        breath: float,
        options: Sequence[str] = (),
        tls: grpc.ChannelCredentials | None = None,
    ) -> None:
        folder.chmod(0o777)
        home = folder / "pg"
        home.mkdir()
        self._database = PostgreSQL(home, SMALL)
        self._database.start()
        self._url = self._database.new_database()
        self._wires = [Proxy(self._socket())]
        super().__init__(folder, seed, breath, options, self._journal_through(self._wires[0]), tls)

    def _journal_through(self, wire: Proxy) -> str:
        host, _, port = wire.address.partition(":")
        given = conninfo_to_dict(self._url)
        return make_conninfo(dbname=given["dbname"], user=given["user"], host=host, port=port)

    def _socket(self) -> str:
        return f"{conninfo_to_dict(self._url)['host']}/.s.PGSQL.5432"

    def _take_over(self) -> Server:
        """Start another server, and send new calls there; returns the one before it."""
        before = self.server
        self.server = Server(self._folder, self._options, self._journal)
        self._start()
        self._proxy.server = self.server.address
        return before

    def _replace(self) -> None:
        """A kill, and another server."""
        self.shared.gate.clear()
        self.server.kill()
        self._begins()
        self._proxy.cut()
        self._take_over()

    def _zombie(self) -> None:
        """A server that is stopped until another one has taken over. Calls that it has keep waiting for it."""
        self.server.process.send_signal(signal.SIGSTOP)
        self._begins()
        try:
            before = self._take_over()
            pause(self._random.uniform(0.1, 1.0))
        finally:
            before.process.send_signal(signal.SIGCONT)
        require(before.process.wait(PATIENCE) == ENDED, f"a server that was replaced: {before.said()}")
        require("taken over partition 0" in before.said(), before.said())

    def _terminate(self) -> None:
        """PostgreSQL ends all connections of the server."""
        query(
            self._url,
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE starts_with(application_name, 'dynhull')",
        )

    def _crash(self) -> None:
        """The first process of PostgreSQL is killed, and it starts again when the others have ended, too."""
        self._database.kill()
        self._database.start()

    def _freeze(self) -> None:
        """PostgreSQL stands still."""
        stopped = self._database.processes
        for each in stopped:
            with suppress(ProcessLookupError):
                os.kill(each, signal.SIGSTOP)
        pause(self._random.uniform(0.2, 6.0))
        for each in stopped:
            with suppress(ProcessLookupError):
                os.kill(each, signal.SIGCONT)

    def _cut(self) -> None:
        """The connections to PostgreSQL are lost, and for a while there are no others."""
        for wire in self._wires:
            wire.server = ""
            wire.cut()
        pause(self._random.uniform(0, 6.0))
        for wire in self._wires:
            wire.server = self._socket()

    def _hold(self) -> None:
        """Nothing arrives, in either direction; then it does, or the connections are lost."""
        for wire in self._wires:
            wire.flowing.clear()
        pause(self._random.uniform(0.2, 6.0))
        is_lost = self._random.random() < 0.5
        for wire in self._wires:
            if is_lost:
                wire.cut()
            wire.flowing.set()

    def _copy(self) -> None:
        """A server on a physical copy of the database has what was acknowledged; what it takes never arrives here."""
        database = conninfo_to_dict(self._url)["dbname"]
        acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
        request = pb.ApplyRequest(name=torture.HULL)
        request.batch.inserts.coordinates.extend([0.5, 0.5])
        with postgresql(copied=self._database) as copied, tempfile.TemporaryDirectory() as folder:
            beside = Server(Path(folder), self._options, copied.url(database))
            beside.start()
            with killed_at_the_end(beside), self.shared.channel(beside.address) as channel:
                stub = HullServiceStub(channel)
                for hull in {hull for writer in self.writers for hull in writer.hulls}:
                    persist(stub.GetHull, pb.GetHullRequest(name=hull))  # its worker may still take it
                self._check_copied(stub, acknowledged, beside)
                counts = [persist(stub.Apply, request).result.point_count for _ in range(8)]
            require(counts == list(range(counts[0], counts[0] + 8)), f"the points of the copy: {counts}")

    def _full_disk(self) -> None:
        """The disk of PostgreSQL is full, which ends it if its log has no room; then there is room again."""
        ballast = self._folder / "ballast"
        with suppress(OSError), ballast.open("wb") as file:
            while True:
                file.write(bytes(2**16))
        pause(self._random.uniform(0.5, 3.0))
        ballast.unlink()
        if not self._database.runs():
            self._database.start()

    def _move(self) -> None:
        """Every partition to one worker, and then anywhere; no worker ends of that."""
        self._balanced()
        there = self._workers()
        self._order(self._any_worker())
        pause(self._random.uniform(0.2, 2.0))
        self._order("anywhere")
        self._balanced()
        require(self._workers() == there, f"a move has ended workers: {self.server.said()}")

    def _balanced(self) -> None:
        """Wait until two workers serve half of the partitions each."""

        def is_balanced() -> bool:
            partitions = len(self._partitions())
            return list(self._serving().values()) == [partitions // 2] * 2

        wait_until(is_balanced)

    def _serving(self) -> Counter[str]:
        """How many partitions each worker serves."""
        return Counter(worker for (worker,) in query(self._url, SERVED))

    def _partitions(self) -> list[int]:
        return [partition for (partition,) in query(self._url, "SELECT partition FROM owners ORDER BY partition")]

    def _machines(self) -> list[Server]:
        return [self.server]

    def _workers(self) -> set[int]:
        return {worker for machine in self._machines() for worker in self._workers_of(machine)}

    def _workers_of(self, machine: Server) -> set[int]:
        found = processes(machine.process.pid)
        return {number for name, number in found.items() if name.startswith("worker")}

    def _any_worker(self) -> str:
        return self._random.choice(query(self._url, "SELECT worker FROM workers ORDER BY worker"))[0]

    def _order(self, worker: str) -> None:
        """Have every partition moved to one worker, or anywhere."""
        for partition in self._partitions():
            self._command("cluster", "move", str(partition), worker, "--journal", self._url)

    def _command(self, *words: str) -> None:
        done = run_command(*words)
        named = "no worker of the cluster has this name" in done.stderr  # it has ended meanwhile
        require(done.returncode == 0 or named, f"dynhull {' '.join(words)}: {done.stderr}")

    def finish(self) -> None:
        super().finish()
        for wire in self._wires:
            wire.close()
        self._database.stop()


def run(folder: Path, options: argparse.Namespace) -> str:
    """Run `faults` rounds. Returns the counts; raises BrokenPromiseError with the broken promise."""
    tortured = Torture(folder, options.seed, options.breath, torture.WORKERS if options.workers else ())
    tortured.rounds(options.kinds or (OF_WORKERS if options.workers else KINDS), options.faults, record=options.record)
    return tortured.counts()


def main() -> None:
    description = "Kill, stop and cut off a server and its PostgreSQL while a model watches."
    options = arguments(description, KINDS, OF_WORKERS).parse_args()
    on_small_disk(__file__, DISK, lambda folder: run(folder, options), mounted=options.mounted)


if __name__ == "__main__":
    main()
