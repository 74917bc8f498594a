"""Alarms through a relay whose server, receiver and self are killed at any moment: none is lost or repeated.

    python tests/robustness/bridges/alarm_torture.py [--faults 300] [--moves] [--seed 0]

Hulls grow and shrink under a prefix; one alarm is about their area, and one about their distance to another hull.
Meanwhile server, relay and receiver get SIGKILL at random, one or several of them; with --moves the hulls are in a
PostgreSQL database, and their partition moves to another worker, too, while a worker may be killed. The receiver is a
process that writes each event to a file before it answers. Before every other fault it has received something since
the last one, so that the relay is also killed at work, and not only at its start. In the end the file must have every
number of each alarm, with one content and under one id, none before its predecessor; and for each hull exactly one
"raised" between two "cleared", as often as the hull has grown and shrunk.
"""

import argparse
import json
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter, defaultdict
from contextlib import ExitStack, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path += [str(Path(__file__).parents[2] / "support")]
from cluster import processes
from forked import COMMAND
from mortal_server import MortalServer
from patience import wait_until
from ports import free_port
from postgresql import PostgreSQL, postgresql, query
from relay_process import acknowledged
from torturers import PAUSE, Killed, Writer

from dynhull_client import DynhullError, HullClient
from dynhull_cluster.machines.command import move
from dynhull_cluster.placement import worker_of
from dynhull_cluster.postgres.processes import is_known_dead

ALARMS = ["area", "near"]
HULLS = [f"fleet/{name}" for name in "abc"]
PORT = "fleet/port"
LARGE, BETWEEN, SMALL = [[0, 6]], [[0, 4.8]], [[0, 1]]  # where the third point is: areas of 12, 9.6 and 2
PARTITIONS, MOVES = 2, 0.7  # the share of faults that are moves
DELIVERED_WITHIN = 180  # seconds


class GrowingWriter(Writer):
    """Grows and shrinks hulls, and counts it."""

    def __init__(self, server: MortalServer, seed: int) -> None:
        super().__init__(server, seed)
        self.raised: Counter[str] = Counter()
        self.large: set[str] = set()

    def step(self, client: HullClient) -> None:
        hull = self.rng.choice(HULLS)
        is_large = hull in self.large
        self.put(client, hull, ["c"], SMALL if is_large else LARGE)
        self.raised[hull] += not is_large
        self.large ^= {hull}
        if not is_large and self.rng.random() < 0.5:  # it stays raised
            self.put(client, hull, ["c"], BETWEEN)


class Torture:
    """A server with alarms, a relay and a receiver.

    Args:
        folder: for all that is kept.
        seed: of what happens.
        database: where the hulls are; None for a folder.
    """

    def __init__(self, folder: Path, seed: int, database: PostgreSQL | None) -> None:
        self.counts: Counter[str] = Counter()
        self._rng = random.Random(seed)
        self._url = None if database is None else database.new_database()
        journal = ("--workers", "2", "--partitions", str(PARTITIONS), "--journal", str(self._url))
        self._server = MortalServer(folder, *(() if database is None else journal))
        self._arrived = folder / "arrived"
        port = free_port()
        self._receiver = Killed([sys.executable, __file__, "--receive", port, self._arrived], folder / "receiver.log")
        with HullClient(self._server.address) as client:
            _prepare(client)
        sources = [f"alarm:fleet/{name}" for name in ALARMS]
        relay = [COMMAND, "relay", *sources, "--address", self._server.address, "--consumer", "torture"]
        relay += ["--to", f"http://127.0.0.1:{port}/", "--state", folder / "relay", "--unsigned", "--allow-private"]
        relay += ["--first-pause", "10ms", "--longest-pause", "200ms", "--timeout", "5s"]
        self._relay = Killed(relay, folder / "relay.log")
        self._writer = GrowingWriter(self._server, seed)

    def run(self, faults: int) -> None:
        """Let that many things happen."""
        begun = time.monotonic()
        self._writer.start()
        try:
            while self.counts.total() < faults:
                self._work()
                self._fault()
                if self.counts.total() % 20 < 2:
                    print(f"{time.monotonic() - begun:.0f} s: {dict(self.counts)}", flush=True)
        finally:
            self._writer.stop()
        self._wait()
        for each in (self._relay, self._receiver, self._server):
            each.kill()

    def _work(self) -> None:
        """Until a hull has grown since the last fault, and every other time until something has arrived since."""
        writer, raised, size = self._writer, self._writer.raised.total(), self._size()
        arrives = self._rng.random() < 0.5
        wait_until(lambda: (writer.raised.total() > raised and (not arrives or self._size() > size)) or writer.failure)

    def _size(self) -> int:
        return self._arrived.stat().st_size if self._arrived.exists() else 0

    def _fault(self) -> None:
        if self._url is not None and self._rng.random() < MOVES:
            return self._move(self._url)
        who: dict[str, Any] = {"server": self._server, "relay": self._relay, "receiver": self._receiver}
        names = self._rng.sample(sorted(who), self._rng.choice([1, 1, 1, 2, 3]))
        for name in names:
            who[name].kill()
        time.sleep(self._rng.choice([0, 0, self._rng.uniform(0, 0.3)]))
        for name in names:
            who[name].start()
            self.counts[f"kills of the {name}"] += 1
        return None

    def _move(self, url: str) -> None:
        """The partition of the hulls goes to the other worker, and one of the two may be killed meanwhile."""
        partition = worker_of(PORT, PARTITIONS)

        def owner() -> tuple[int, str]:
            [found] = query(url, "SELECT epoch, worker FROM owners WHERE partition = %s", partition)
            return found

        def others() -> list[str]:
            workers = query(url, "SELECT worker, process FROM workers WHERE worker <> %s", owner()[1])
            return [worker for worker, process in workers if not is_known_dead(process)]

        before = owner()
        wait_until(others)
        move(partition, others()[0], url)
        killed = self._rng.random() < 0.3
        if killed:
            time.sleep(self._rng.uniform(0, 0.8))
            living = processes(self._server._process.pid)
            os.kill(self._rng.choice([number for name, number in living.items() if "worker" in name]), 9)
            self.counts["kills of a worker"] += 1
        wait_until(lambda: owner()[0] > before[0] or killed)
        self.counts["moves"] += owner()[1] != before[1]

    def _wait(self) -> None:
        """Until the relay has acknowledged all events."""
        end = time.monotonic() + DELIVERED_WITHIN
        with HullClient(self._server.address) as client:
            while True:
                with suppress(DynhullError):
                    last = {name: client.get_alarm(f"fleet/{name}").last_sequence for name in ALARMS}
                    if all(acknowledged(client, f"fleet/{name}", "alarm") == last[name] for name in ALARMS):
                        break
                assert time.monotonic() < end, "not all events have been delivered"
                time.sleep(PAUSE)
        for name in ALARMS:
            self._compare(f"fleet/{name}", last[f"{name}"])

    def _compare(self, alarm: str, last: int) -> None:
        lines = [json.loads(line) for line in self._arrived.read_bytes().splitlines()]
        arrived = [(each["id"], each["data"]) for each in lines if each["data"]["alarm"] == alarm]
        found = {event["sequence"]: (identity, event) for identity, event in arrived}
        assert sorted(found) == list(range(1, last + 1)), f"{alarm}: {len(found)} events of {last}"
        assert all(found[event["sequence"]] == (identity, event) for identity, event in arrived), "two of one number"
        assert len({identity for identity, _ in arrived}) == last, "two ids of one number"
        order = [event["sequence"] for _, event in arrived]
        assert all(after <= before + 1 for before, after in pairwise(order)), "an event before its predecessor"
        types: dict[str, list[str]] = defaultdict(list)
        for _, event in (found[sequence] for sequence in sorted(found)):
            types[event["hull"]].append(event["type"])
        for hull in HULLS:
            raised = self._writer.raised[hull]
            expected = (["raised", "cleared"] * raised)[: 2 * raised - (hull in self._writer.large)]
            assert types[hull] == expected, f"{alarm}, {hull}: {len(types[hull])} events, not {len(expected)}"
        self.counts["events"] += last
        self.counts["repeated with their ids"] += len(arrived) - last


def _prepare(client: HullClient) -> None:
    """Hulls that are small and away from the port, and two alarms that are about them."""

    def create(hull: str, points: list[list[float]]) -> None:
        client.create_hull(hull, keyed="str")
        client.put(hull, ["a", "b", "c"], points)

    create(PORT, [[-3, 6], [-2, 6], [-2, 7]])
    for hull in HULLS:
        create(hull, [[0, 0], [4, 0], *SMALL])
    client.create_alarm("fleet/area", prefix="fleet/", when="area > 10", clear="area < 9")
    # The third point is 2 from the port where the hull is large, and farther away where it is small.
    client.create_alarm("fleet/near", prefix="fleet/", when=f"near {PORT} 2", clear=f"not near {PORT} 4")


def receive(port: int, file: Path) -> None:
    """Append each body to a file, and answer then."""
    written = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    last = os.fstat(written).st_size
    if last and file.read_bytes()[-1:] != b"\n":
        os.write(written, b"\n")

    class Page(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            os.write(written, body + b"\n")
            self.send_response(200)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """It prints nothing."""

    ThreadingHTTPServer(("127.0.0.1", port), Page).serve_forever()


def run(faults: int, moves: bool, seed: int, folder: Path) -> Counter[str]:
    """That many faults; AssertionError if an event is missing, wrong, repeated or out of order."""
    with ExitStack() as stack:
        database = stack.enter_context(postgresql()) if moves else None
        torture = Torture(folder, seed, database)
        torture.run(faults)
    return torture.counts


def main() -> None:
    if sys.argv[1:2] == ["--receive"]:
        return receive(int(sys.argv[2]), Path(sys.argv[3]))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=300)
    parser.add_argument("--moves", action="store_true", help="on PostgreSQL, with workers")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp())
    try:
        counts = run(arguments.faults, arguments.moves, arguments.seed, folder)
    finally:
        shutil.rmtree(folder)
    print(f"exactly one raise between two clears, none lost or repeated: {dict(counts)}")
    return None


if __name__ == "__main__":
    main()
