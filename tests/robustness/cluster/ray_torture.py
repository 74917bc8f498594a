"""Torture of a cluster whose servers Ray has started, and starts again: a real Ray, a real PostgreSQL, and TLS.

    python tests/robustness/cluster/ray_torture.py --faults 16

Clients, models and promises are those of tests/robustness/server/torture.py, the faults of PostgreSQL and of the
network to it those of postgres_torture.py. The other faults:

* a worker, a gateway, or a server with its actor is killed
* a node of Ray is killed, and Ray starts its server on another one
* partitions are moved by hand
"""

import argparse
import os
import random
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import grpc

sys.path.append(str(Path(__file__).parents[1] / "server"))
sys.path.append(str(Path(__file__).parents[2] / "support"))
sys.path.append(str(Path(__file__).parent))
import postgres_torture
from cluster import processes
from forked import COMMAND
from machines_torture import OPTIONS, certified
from patience import wait_until
from promises import require
from ray_nodes import ENVIRONMENT, Node, nodes_of_ray
from small_disk import arguments, on_small_disk
from tortured import Server

COUNT = 2
RAY_SECONDS = 600  # Ray takes minutes to start processes beside other work
KINDS = [
    "kill_server",
    "crash",
    "kill_worker",
    "move",
    "terminate",
    "kill_gateway",
    "cut",
    "kill_server",
    "hold",
    "kill_node",
    "freeze",
]


def own_address() -> str:
    """That of this machine on its network, which Ray gives to its nodes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        asked.connect(("192.0.2.1", 1))  # nothing is sent
        return str(asked.getsockname()[0])


class OnRay(Server):
    """The servers that Ray has started, on nodes of which one more is there than they need; callers use one of them."""

    def __init__(
        self, folder: Path, options: Sequence[str], journal: str, nodes: Sequence[Node], chance: random.Random
    ) -> None:
        super().__init__(folder, options, journal)
        self._log.touch()
        self._head, *self._nodes = nodes
        self._added: list[Node] = []
        self._journal, self._random = journal, chance
        self._address = ""

    @property
    def address(self) -> str:
        return self._address

    def start(self) -> None:
        """Have Ray run the servers, or find those that it runs; callers use one of them from now on."""
        options = ["--create-on-write", "--snapshot-points", "300", "--log-level", "warning", "--scrub-cpu", "0"]
        command = [COMMAND, "cluster", "scale", str(COUNT), "--journal", self._journal, "--", *options, *self._options]
        environment = {**os.environ, **ENVIRONMENT, "RAY_ADDRESS": self._head.address}
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=RAY_SECONDS, check=False
        )
        found = [line.split()[-1] for line in done.stdout.splitlines() if "serving on" in line]
        require(len(found) == COUNT, f"dynhull cluster scale: {done.stdout}{done.stderr}")
        self._address = self._random.choice(found)

    def processes(self) -> dict[int, Node]:
        """The numbers of the servers, and where they are."""
        return {each: node for node in self._nodes for each in node.servers()}

    def kill_node(self) -> set[int]:
        """Kill a node that has a server, and have another one; returns the servers that are gone."""
        node = self._random.choice(sorted({*self.processes().values()}, key=self._nodes.index))
        gone = set(node.servers())
        node.kill("raylet")
        self._nodes.remove(node)
        self._added.append(Node(self._head.folder, self._head.address))
        self._nodes.append(self._added[-1])
        return gone

    def kill(self) -> None:
        for each in self._added:
            each.stop()


class Torture(postgres_torture.Torture):
    """The clients use one of the servers, any of them after each fault that has ended one."""

    shards = 3

    def __init__(self, folder: Path, seed: int, breath: float, nodes: Sequence[Node]) -> None:
        self._nodes = nodes
        options = (*OPTIONS[1:], *certified(folder, own_address()))
        super().__init__(folder, seed, breath, options, grpc.ssl_channel_credentials((folder / "ca.pem").read_bytes()))
        self._balanced()

    def _first_server(self) -> OnRay:
        return OnRay(self._folder, self._options, self._journal, self._nodes, self._random)

    def _one_of(self, kind: str) -> int:
        found = [each for server in sorted(self.server.processes()) for each in sorted(processes(server).items())]
        return self._random.choice([number for name, number in found if name.startswith(kind)])

    def _workers(self) -> set[int]:
        found = [each for server in self.server.processes() for each in processes(server).items()]
        return {number for name, number in found if name.startswith("worker")}

    def _kill_server(self) -> None:
        """Its actor ends with it, and Ray makes another one."""
        gone = self._random.choice(sorted(self.server.processes()))
        self._begins()
        os.kill(gone, signal.SIGKILL)
        self._find_others({gone})

    def _kill_node(self) -> None:
        """A node is gone, and with it an actor and its server: Ray starts another one on the node that is free."""
        self._begins()
        self._find_others(self.server.kill_node())

    def _find_others(self, gone: set[int]) -> None:
        """Wait until Ray has started others in place of those that are gone, and have callers go to any."""
        wait_until(lambda: len(there := set(self.server.processes())) == COUNT and not there & gone)
        self.server.start()
        self._proxy.server = self.server.address
        self._proxy.cut()
        self._balanced()

    def _end_servers(self) -> None:
        self.server.kill()


def run(folder: Path, options: argparse.Namespace) -> str:
    """Run `faults` rounds. Returns the counts; raises BrokenPromiseError with the broken promise."""
    with nodes_of_ray(COUNT + 1) as nodes:
        tortured = Torture(folder, options.seed, options.breath, nodes)
        tortured.rounds(options.kinds or KINDS, options.faults, record=options.record)
        return tortured.counts()


def main() -> None:
    options = arguments("Kill what Ray has started while a model watches.", KINDS).parse_args()
    on_small_disk(__file__, postgres_torture.DISK, lambda folder: run(folder, options), mounted=options.mounted)


if __name__ == "__main__":
    main()
