"""A relay, its server and its endpoint go away again and again: every event arrives, in order per fence.

    python tests/robustness/bridges/relay_torture.py [--downs 10] [--down 600] [--kills 100] [--seed 0]

The endpoint is down some times, for a while each. During that while, server and relay get SIGKILL at any moment, as
often as the kills are divided among the times, and start on what is left; subjects go in and out of two fences all the
time. Once the endpoint is back, it must receive every event: each with its content, none before its predecessor, under
one id. Without --patience the relay tries again after 10 to 200 ms, so that a short while stands for a long one.
"""

import argparse
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

sys.path += [str(Path(__file__).parents[2] / "support")]
from forked import COMMAND
from mortal_server import MortalServer
from patience import wait_until
from receiver import Receiver
from relay_process import INSIDE, OUTSIDE, acknowledged, fence
from torturers import PAUSE, Killed, Writer

from dynhull_client import DynhullError, HullClient

FENCES = ["north", "south"]
KEYS = [f"é{number}" for number in range(8)]
PATIENCE = ["10ms", "200ms"]
# Seconds between two kills, at most.
BETWEEN = 1.0
# Seconds in which what has waited for the endpoint arrives, besides those of the last pause and of a long backlog.
DELIVERED_WITHIN = 120


class CrossingWriter(Writer):
    """Lets subjects go in and out, and keeps which events follow from that."""

    def __init__(self, server: MortalServer, seed: int) -> None:
        super().__init__(server, seed)
        self.expected: dict[str, list[tuple[str, str]]] = {name: [] for name in FENCES}
        self._inside: set[tuple[str, str]] = set()

    def step(self, client: HullClient) -> None:
        name, keys = self.rng.choice(FENCES), sorted(self.rng.sample(KEYS, self.rng.randint(1, 3)))
        leaves = (name, keys[0]) in self._inside
        keys = [key for key in keys if ((name, key) in self._inside) == leaves]
        self.put(client, name, keys, (OUTSIDE if leaves else INSIDE) * len(keys))
        self.expected[name] += [("exit" if leaves else "enter", key) for key in keys]
        self._inside ^= {(name, key) for key in keys}


def _relay(address: str, to: str, folder: Path, patience: list[str]) -> Killed:
    """`dynhull relay` with a folder for its state."""
    first, longest = patience
    command = [COMMAND, "relay", *FENCES, "--address", address, "--consumer", "torture", "--to", to]
    command += ["--state", str(folder / "relay"), "--unsigned", "--allow-private"]
    return Killed([*command, "--first-pause", first, "--longest-pause", longest], folder / "relay.log")


def run(downs: int, down: float, kills: int, patience: list[str], seed: int, folder: Path) -> Counter[str]:
    """That many times without an endpoint; AssertionError if an event is missing, wrong or out of order."""
    rng = random.Random(seed)
    counts: Counter[str] = Counter()
    server, endpoint = MortalServer(folder), Receiver()
    begun = time.monotonic()
    with HullClient(server.address) as client:
        for name in FENCES:
            fence(client, name)
        relay = _relay(server.address, endpoint.url, folder, patience)
        writer = CrossingWriter(server, seed)
        writer.start()
        try:
            for number in range(1, downs + 1):
                wait_until(lambda: all(endpoint.events(name) for name in FENCES))
                endpoint.stop()
                back = time.monotonic() + down
                for left in range(kills // downs + (number <= kills % downs), 0, -1):
                    time.sleep(rng.uniform(0, min(BETWEEN, 2 * max(back - time.monotonic(), 0) / left)))
                    who = rng.choice([[server], [relay], [server, relay], [relay, server]])
                    for each in who:
                        each.kill()
                    time.sleep(rng.choice([0, 0, rng.uniform(0, 0.3)]))
                    for each in who:
                        each.start()
                        counts["kills of the server" if each is server else "kills of the relay"] += 1
                time.sleep(max(back - time.monotonic(), 0))
                endpoint.start()
                counts["times without the endpoint"] += 1
                _arrive(client, writer, DELIVERED_WITHIN + 2 * down)
                print(f"{time.monotonic() - begun:.0f} s: {dict(counts)}", flush=True)
        finally:
            writer.stop()
        _arrive(client, writer, DELIVERED_WITHIN)
        relay.kill()
        server.kill()
        endpoint.stop()
    for name in FENCES:
        counts += _compare(endpoint, name, writer.expected[name])
    return counts


def _arrive(client: HullClient, writer: CrossingWriter, within: float) -> None:
    """Wait until the relay has acknowledged all events up to now, at most `within` seconds."""
    up_to = {name: len(writer.expected[name]) for name in FENCES}
    end = time.monotonic() + within
    while True:
        with suppress(DynhullError):
            if all(acknowledged(client, name) >= last for name, last in up_to.items()):
                return
        assert time.monotonic() < end, f"not all of these events have been delivered: {up_to}"
        time.sleep(PAUSE)


def _compare(endpoint: Receiver, name: str, expected: list[tuple[str, str]]) -> Counter[str]:
    arrived = [(event["id"], event["data"]) for event in endpoint.events(name)]
    found = {event["sequence"]: event for _, event in arrived}
    assert sorted(found) == list(range(1, len(expected) + 1)), f"{name}: {len(found)} events of {len(expected)}"
    for (kind, key), (sequence, event) in zip(expected, sorted(found.items()), strict=True):
        assert (event["type"], event["key"]) == (kind, key), f"{name}: event {sequence} is {event}, not {kind} {key}"
    order = [event["sequence"] for _, event in arrived]
    assert all(after <= before + 1 for before, after in pairwise(order)), f"{name}: an event before its predecessor"
    ids = {(each, event["sequence"]) for each, event in arrived}
    assert len(ids) == len({each for each, _ in ids}) == len(found), f"{name}: {len(ids)} ids of {len(found)} events"
    return Counter({"events": len(found), "repeated": len(arrived) - len(found)})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--downs", type=int, default=10)
    parser.add_argument("--down", type=float, default=5, help="seconds")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--patience", nargs=2, default=PATIENCE, help="of the relay: first and longest pause")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp())
    try:
        counts = run(arguments.downs, arguments.down, arguments.kills, arguments.patience, arguments.seed, folder)
    finally:
        shutil.rmtree(folder)
    print(f"every event arrived, in order: {dict(counts)}")


if __name__ == "__main__":
    main()
