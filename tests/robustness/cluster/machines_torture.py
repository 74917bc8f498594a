"""Torture of a cluster: two real servers that share a real PostgreSQL; each of them, and what is between them, fails.

    python tests/robustness/cluster/machines_torture.py --faults 100

Clients, models and promises are those of tests/robustness/server/torture.py, the faults of PostgreSQL and of the
network to it those of postgres_torture.py. The other faults:

* a worker is killed, or stopped until its partitions are taken over, and then goes on
* a gateway is killed
* a machine stands still, as one of a hypervisor does, or does not reach the database, until its partitions are taken
  over, and then goes on
* a machine with its worker and its gateway is killed, or stopped as an operator does it, and started again
* a machine is started again as another user, who sees no processes of others
* partitions are to be moved when the worker that has one, or is to have it, is killed or stopped,
  or PostgreSQL is killed

Between machines, and to callers, there is TLS.
"""

import argparse
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import grpc
import trustme

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

sys.path.append(str(Path(__file__).parents[1] / "server"))
sys.path.append(str(Path(__file__).parents[2] / "support"))

sys.path.append(str(Path(__file__).parent))
import postgres_torture
import torture
from blind import blind, may_blind
from cluster import descendants, processes
from pacing import pause
from patience import PATIENCE, wait_until
from promises import require
from proxy import Proxy
from small_disk import arguments, on_small_disk
from tortured import Server

PARTITIONS = 4
OPTIONS = ("--cluster", "--partitions", str(PARTITIONS), "--grace", "10")
ASKED = 20  # calls of a machine that is left behind


class Torture(postgres_torture.Torture):
    """Two servers; the clients use one of them, by turns. Hulls are divided among shards, those that can be."""

    shards = 3

    def __init__(self, folder: Path, seed: int, breath: float) -> None:
        self._other: Server | None = None
        options = (*OPTIONS, *certified(folder))
        tls = grpc.ssl_channel_credentials((folder / "ca.pem").read_bytes())
        super().__init__(folder, seed, breath, options, tls)
        self._wires.append(Proxy(self._socket()))
        self._other = Server(folder, self._options, self._journal_through(self._wires[1]))
        self._other.start()
        self._wire_of = dict(zip([each.address for each in self._machines()], self._wires, strict=True))
        for machine in self._machines():
            self.readers.append(self._new_reader(machine.address))
            self.readers[-1].start()
        self._balanced()

    def _machines(self) -> list[Server]:
        return [self.server] if self._other is None else [self.server, self._other]

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
            wait_until(lambda: len(self._serving()) == 1)
            pause(self._random.uniform(0.1, 1.0))
        finally:
            os.kill(worker, signal.SIGCONT)
        wait_until(lambda: worker not in self._workers())
        require("taken over partition" in self.server.said(), self.server.said())

    def _suspend(self) -> None:
        """A machine stands still, as one of a hypervisor does, until the other one has its partitions, and goes on."""
        stopped = self._left_behind()
        for each in (standing := [stopped.process.pid, *descendants(stopped.process.pid)]):
            os.kill(each, signal.SIGSTOP)

        def go_on() -> None:
            for each in standing:
                os.kill(each, signal.SIGCONT)

        self._ask(stopped, go_on)

    def _isolate(self) -> None:
        """A machine that callers reach does not reach the database until the other one has its partitions."""
        isolated = self._left_behind()
        wire = self._wire_of[isolated.address]
        wire.flowing.clear()
        self._ask(isolated, wire.flowing.set)

    def _left_behind(self) -> Server:
        """The machine of the clients, or the other one, which is the other one then."""
        self._balanced()
        if self._random.random() < 0.5:
            self._turn()
        return self._other

    def _ask(self, machine: Server, go_on: Callable[[], None]) -> None:
        """Ask a machine while the other one has its partitions, and have it go on: no answer is older than that."""
        self._begins()
        asked: list[grpc.Future] = []
        with self.shared.channel(machine.address) as channel:
            try:
                wait_until(lambda: len(self._serving()) == 1)
                before = self.acknowledged()
                wait_until(lambda: self.acknowledged() > before + torture.POINT_WRITERS)
                acknowledged = self.acknowledged()
                request = pb.GetHullRequest(name=torture.HULL)
                asked = [HullServiceStub(channel).GetHull.future(request, timeout=5) for _ in range(ASKED)]
                pause(self._random.uniform(0.1, 1.0))
            finally:
                go_on()
            for call in asked:
                if call.code() is grpc.StatusCode.OK:
                    revision = call.result().hull.revision
                    require(revision >= acknowledged, f"stale: revision {revision}, {acknowledged} was acknowledged")

    def _kill_machine(self) -> None:
        """The machine of the clients, or the other one, and its start later on."""
        if self._random.random() < 0.5:
            self._turn()
        self._other.kill()
        self._begins()
        pause(self._random.uniform(0.0, 6.0))
        self._other.start()

    def _hidden(self) -> None:
        """The machine of the clients is of another user than the other one, which sees no processes of others.

        So it cannot know that the workers of the first one live; who takes their partitions over ends them.
        """
        self._balanced()
        self._turn()
        self._other.kill()
        self._begins()
        there = self._workers_of(self.server)
        self._other.start(blind() if may_blind() else ())
        self._balanced()
        require(self._workers_of(self.server) == there, f"living workers were taken for dead: {self.server.said()}")

    def _stop_machine(self) -> None:
        """As systemd does it: its partitions move first."""
        self._other.process.terminate()
        require(self._other.process.wait(PATIENCE) == 0, self._other.said())
        self._other.start()

    def _kill_in_move(self) -> None:
        """One of the two workers of a move is killed, at any moment."""
        self._balanced()
        self._order(self._any_worker())
        pause(self._random.uniform(0.0, 0.6))
        self._begins()
        with suppress(ProcessLookupError):
            os.kill(self._one_of("worker"), signal.SIGKILL)
        self._order("anywhere")

    def _crash_in_move(self) -> None:
        """PostgreSQL is killed, at any moment of a move."""
        self._balanced()
        self._order(self._any_worker())
        pause(self._random.uniform(0.0, 0.6))
        self._crash()
        self._begins()
        self._order("anywhere")

    def _stop_in_move(self) -> None:
        """One of the two is stopped for a while, at any moment, and goes on before it is replaced, or after."""
        self._balanced()
        self._order(self._any_worker())
        pause(self._random.uniform(0.0, 0.6))
        worker = self._one_of("worker")
        with suppress(ProcessLookupError):
            os.kill(worker, signal.SIGSTOP)
            pause(self._random.uniform(0.1, 6.0))
            os.kill(worker, signal.SIGCONT)
        self._begins()
        self._order("anywhere")

    def _end_servers(self) -> None:
        for machine in self._machines():
            machine.kill()


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
    "suspend",
    "isolate",
]


def certified(folder: Path, *hosts: str) -> tuple[str, ...]:
    """The options of servers with a certificate, for this machine and other hosts."""
    authority = trustme.CA()
    authority.issue_cert("127.0.0.1", *hosts).private_key_and_cert_chain_pem.write_to_path(folder / "cert.pem")
    authority.cert_pem.write_to_path(folder / "ca.pem")
    cert = str(folder / "cert.pem")
    return ("--tls-cert", cert, "--tls-key", cert, "--cluster-ca", str(folder / "ca.pem"))


def run(folder: Path, options: argparse.Namespace) -> str:
    """Run `faults` rounds. Returns the counts; raises BrokenPromiseError with the broken promise."""
    tortured = Torture(folder, options.seed, options.breath)
    tortured.rounds(options.kinds or KINDS, options.faults, record=options.record)
    return tortured.counts()


def main() -> None:
    options = arguments("Kill, stop and cut off the machines of a cluster while a model watches.", KINDS).parse_args()
    on_small_disk(__file__, postgres_torture.DISK, lambda folder: run(folder, options), mounted=options.mounted)


if __name__ == "__main__":
    main()
