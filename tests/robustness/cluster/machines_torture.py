"""Torture of a cluster: two real servers that share a real PostgreSQL; each of them, and what is between them, fails.

    python tests/robustness/cluster/machines_torture.py --faults 100

Clients, models and promises are those of tests/robustness/server/torture.py, the faults of PostgreSQL and of the
network to it those of postgres_torture.py. The other faults:

* a worker is killed, or stopped until its partitions are taken over, and then goes on
* a gateway is killed
* a machine with its worker and its gateway is killed, or stopped as an operator does it, and started again
* a machine is started again as another user, who sees no processes of others
* the database is copied while it serves, and a server begins on the copy: nothing of that arrives
* partitions are moved by hand; or are to be moved when the worker that has one, or is to have it, is killed or stopped,
  or PostgreSQL is killed

Between machines, and to callers, there is TLS.
"""

import argparse
import os
import signal
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import grpc
import trustme
from psycopg.conninfo import conninfo_to_dict

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

sys.path.append(str(Path(__file__).parents[1] / "server"))
sys.path.append(str(Path(__file__).parents[2] / "support"))

sys.path.append(str(Path(__file__).parent))
import postgres_torture
import torture
from actors import persist
from blind import blind, may_blind
from cluster import processes
from pacing import pause
from patience import PATIENCE, wait_until
from postgresql import postgresql, query
from promises import require
from server_process import run as run_command
from tortured import Server, killed_at_the_end

PARTITIONS = 4
OPTIONS = ("--cluster", "--partitions", str(PARTITIONS), "--grace", "10")
SERVED = "SELECT worker FROM owners WHERE until > '-infinity' AND address <> ''"


class Torture(postgres_torture.Torture):
    """Two servers; the clients use one of them, by turns. Hulls are divided among shards, those that can be."""

    shards = 3

    def __init__(self, folder: Path, seed: int, breath: float) -> None:
        self._other: Server | None = None
        self._given = (*OPTIONS, *certified(folder))
        tls = grpc.ssl_channel_credentials((folder / "ca.pem").read_bytes())
        super().__init__(folder, seed, breath, self._given, tls)
        self._other = Server(folder, self._given, self._journal)
        self._other.start()
        self._balanced()

    def _machines(self) -> list[Server]:
        return [self.server] if self._other is None else [self.server, self._other]

    def _balanced(self) -> None:
        """Wait until both machines serve half of the partitions."""

        def is_balanced() -> bool:
            workers = [worker for (worker,) in query(self._url, SERVED)]
            return len(workers) == PARTITIONS and {workers.count(each) for each in workers} == {PARTITIONS // 2}

        wait_until(is_balanced)

    def round(self, fault: str) -> None:
        super().round(fault)
        if self._random.random() < 0.5:
            self._turn()

    def _turn(self) -> None:
        """Clients go to the other machine."""
        self.server, self._other = self._other, self.server
        self._proxy.server = self.server.address
        self._proxy.cut()

    def _one_of(self, kind: str) -> int:
        found = [each for machine in self._machines() for each in sorted(processes(machine.process.pid).items())]
        return self._random.choice([number for name, number in found if name.startswith(kind)])

    def _zombie(self) -> None:
        """A worker that is stopped until it has lost its partitions, and goes on while the others serve them."""
        self._balanced()
        worker = self._one_of("worker")
        os.kill(worker, signal.SIGSTOP)
        self._begins()
        try:
            wait_until(lambda: len({each for (each,) in query(self._url, SERVED)}) == 1)
            pause(self._random.uniform(0.1, 1.0))
        finally:
            os.kill(worker, signal.SIGCONT)
        wait_until(lambda: worker not in self._workers())
        require("taken over partition" in self.server.said(), self.server.said())

    def _workers(self) -> set[int]:
        return {
            number
            for machine in self._machines()
            for name, number in processes(machine.process.pid).items()
            if name.startswith("worker")
        }

    def _kill_machine(self) -> None:
        """The machine of the clients, or the other one, and its start later on."""
        if self._random.random() < 0.5:
            self._turn()
        self._other.kill()
        self._begins()
        pause(self._random.uniform(0.0, 6.0))
        self._other.start()

    def _hidden(self) -> None:
        """The machine of the clients is of another user than the other one, which sees no processes of others."""
        self._turn()
        self._other.kill()
        self._begins()
        self._other.start(blind() if may_blind() else ())
        self._balanced()

    def _copy(self) -> None:
        """A server on a physical copy of the database: what it acknowledges never arrives here."""
        database = conninfo_to_dict(self._url)["dbname"]
        request = pb.ApplyRequest(name=torture.HULL)
        request.batch.inserts.coordinates.extend([0.5, 0.5])
        with postgresql(copied=self._database) as copied, tempfile.TemporaryDirectory() as folder:
            beside = Server(Path(folder), self._given, copied.url(database))
            beside.start()
            with killed_at_the_end(beside), self.shared.channel(beside.address) as channel:
                stub = HullServiceStub(channel)
                counts = [persist(stub.Apply, request).result.point_count for _ in range(8)]
            require(counts == list(range(counts[0], counts[0] + 8)), f"the points of the copy: {counts}")

    def _stop_machine(self) -> None:
        """As systemd does it: its partitions move first."""
        self._other.process.terminate()
        require(self._other.process.wait(PATIENCE) == 0, self._other.said())
        self._other.start()

    def _move(self) -> None:
        """Every partition to one worker, and then anywhere."""
        self._order(self._random.choice(query(self._url, "SELECT worker FROM workers ORDER BY worker"))[0])
        pause(self._random.uniform(0.2, 2.0))
        self._order("anywhere")

    def _order(self, worker: str) -> None:
        """Have every partition moved to one worker, or anywhere."""
        for partition in range(PARTITIONS):
            self._command("cluster", "move", str(partition), worker, "--journal", self._url)

    def _kill_in_move(self) -> None:
        """One of the two workers of a move is killed, at any moment."""
        self._balanced()
        self._order(self._random.choice(query(self._url, "SELECT worker FROM workers ORDER BY worker"))[0])
        pause(self._random.uniform(0.0, 0.6))
        with suppress(ProcessLookupError):
            os.kill(self._one_of("worker"), signal.SIGKILL)
        self._order("anywhere")

    def _crash_in_move(self) -> None:
        """PostgreSQL is killed, at any moment of a move."""
        self._balanced()
        self._order(self._random.choice(query(self._url, "SELECT worker FROM workers ORDER BY worker"))[0])
        pause(self._random.uniform(0.0, 0.6))
        self._crash()
        self._order("anywhere")

    def _stop_in_move(self) -> None:
        """One of the two is stopped for a while, at any moment, and goes on before it is replaced, or after."""
        self._balanced()
        self._order(self._random.choice(query(self._url, "SELECT worker FROM workers ORDER BY worker"))[0])
        pause(self._random.uniform(0.0, 0.6))
        worker = self._one_of("worker")
        with suppress(ProcessLookupError):
            os.kill(worker, signal.SIGSTOP)
            pause(self._random.uniform(0.1, 6.0))
            os.kill(worker, signal.SIGCONT)
        self._order("anywhere")

    def _command(self, *words: str) -> None:
        done = run_command(*words)
        named = "no worker of the cluster has this name" in done.stderr  # it has ended meanwhile
        require(done.returncode == 0 or named, f"dynhull {' '.join(words)}: {done.stderr}")

    def finish(self) -> None:
        self.shared.over.set()
        self.shared.gate.set()
        self._channel.close()
        self._proxy.close()
        for machine in self._machines():
            machine.kill()
        self._wire.close()
        self._database.stop()


KINDS = [
    "zombie",
    "kill_machine",
    "crash",
    "kill_worker",
    "move",
    "terminate",
    "kill_in_move",
    "stop_machine",
    "cut",
    "kill_gateway",
    "stop_in_move",
    "hold",
    "kill_in_move",
    "crash_in_move",
    "freeze",
    "kill_machine",
    "hidden",
    "full_disk",
    "copy",
]


def certified(folder: Path) -> tuple[str, ...]:
    """The options of servers with a certificate."""
    authority = trustme.CA()
    authority.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(folder / "cert.pem")
    authority.cert_pem.write_to_path(folder / "ca.pem")
    cert = str(folder / "cert.pem")
    return ("--tls-cert", cert, "--tls-key", cert, "--cluster-ca", str(folder / "ca.pem"))


def run(folder: Path, options: argparse.Namespace) -> str:
    """Run `faults` rounds. Returns the counts; raises BrokenPromiseError with the broken promise."""
    tortured = Torture(folder, options.seed, options.breath)
    tortured.rounds(options.kinds, options.faults, record=options.record)
    return tortured.counts()


def main() -> None:
    parser = torture.arguments("Kill, stop and cut off the machines of a cluster while a model watches.")
    parser.add_argument("--kinds", nargs="+", choices=sorted({*KINDS}), default=KINDS, help="which (default: all)")
    options = parser.parse_args()
    torture.on_small_disk(__file__, postgres_torture.DISK, lambda folder: run(folder, options), mounted=options.mounted)


if __name__ == "__main__":
    main()
