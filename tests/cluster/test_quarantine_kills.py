"""Quarantines on several workers, on a folder and in PostgreSQL, over kills, a backup and a restart."""

import os
import random
import signal
import threading
from pathlib import Path
from typing import Any

import pytest
from cases import slow, with_all_cases
from cluster import processes
from command_line import dynhull
from pacing import pause
from postgresql import PostgreSQL
from quarantine_rules import SECOND, Model
from server_process import Server, server_process

from dynhull import DynamicHull
from dynhull_client import Applied, HullClient, Quarantine, UnavailableError

WORKERS = ("--workers", "2", "--gateways", "2", "--log-level", "error")
ENDED = "is started again"
START = 1_700_000_000 * SECOND
KEYS = range(9)
BATCHES, KILLS = 40, 2


class Fleet:
    """A hull with a quarantine, and the model of it; each batch has a number, and is sent until it is acknowledged."""

    def __init__(self, name: str, seed: int) -> None:
        self.name = name
        self.model = Model(Quarantine(max_speed=4, max_growth=3), ordered=False)
        self._random = random.Random(seed)
        self._sequence = 0

    def create(self, client: HullClient) -> None:
        client.create_hull(self.name, keyed="int", quarantine=self.model.rules)

    def write(self, client: HullClient) -> None:
        """A batch, and what the model says of it."""
        self._sequence += 1
        chance = self._random.random()
        some = self._random.sample(KEYS, self._random.randint(1, 4))
        numbered = {"producer": "p", "sequence": self._sequence}
        if chance < 0.1:
            applied = client.release(self.name, some[:2], drop=some[2:], **numbered)
            expected = self.model.release(some[:2]), self.model.drop(some[2:])
            assert applied.duplicate or (applied.released, applied.dropped) == expected
        elif chance < 0.15:
            self._change_rules(client)
        else:
            rows = [(key, *self._place(), self._sequence) for key in some]
            removes = [key for key in KEYS if key not in some and self._random.random() < 0.05]
            applied = self._put(client, rows, removes, numbered)
            held, released = self.model.put(rows, removes)
            assert applied.duplicate or (list(applied.held_rows), applied.released) == (held, released)

    def check(self, client: HullClient) -> None:
        """Everything that a client can read of it."""
        model = self.model
        held = {each.key: (each.position, each.confirmations) for each in client.list_held(self.name)}
        assert held == {key: ((x, y), confirmed) for key, (x, y, _, confirmed) in model.held.items()}
        found = client.positions(self.name, list(KEYS))
        there = {key: tuple(found.positions[i].tolist()) for i, key in enumerate(KEYS) if found.present[i]}
        assert there == {key: at[:2] for key, at in model.there.items()}
        hull = client.get_hull(self.name)
        assert (hull.info.points, hull.info.held, hull.info.quarantine) == (len(there), len(held), model.rules)
        assert hull.vertices.tolist() == DynamicHull(list(there.values())).vertices().tolist()
        assert client.verify(self.name).equal

    def _put(self, client: HullClient, rows: Any, removes: Any, numbered: Any) -> Applied:
        keys, x, y, times = zip(*rows, strict=True)
        points = list(zip(x, y, strict=True))
        return client.put(
            self.name, keys, points, [START + each * SECOND for each in times], remove=removes, **numbered
        )

    def _place(self) -> tuple[float, float]:
        far = 100 if self._random.random() < 0.2 else 1
        return self._random.randint(-8, 8) / 2 * far, self._random.randint(-8, 8) / 2 * far

    def _change_rules(self, client: HullClient) -> None:
        self._sequence -= 1  # the request has no number
        self.model.rules = Quarantine(
            self._random.choice([4, None]), self._random.choice([3, 1.5]), self._random.randint(0, 2)
        )
        while True:
            try:
                client.set_quarantine(self.name, self.model.rules)
                return
            except UnavailableError:  # a second time changes nothing
                continue


def kill(seconds: float, process: int) -> None:
    """Kill a process after a while."""
    pause(seconds)
    os.kill(process, signal.SIGKILL)


def live(server: Server, seed: int) -> list[Fleet]:
    """Batches to hulls of both workers, beside kills of workers and gateways."""
    fleets = [Fleet("north/a", seed), Fleet("fleet/a", seed + 1)]
    chance = random.Random(seed)
    with HullClient(server.address, retries=1000, timeout=100) as client:
        for each in fleets:
            each.create(client)
        for number in range(BATCHES):
            if number % (BATCHES // KILLS) == BATCHES // KILLS // 2:
                there = [process for name, process in sorted(processes(server.process.pid).items())]
                threading.Thread(target=kill, args=(chance.uniform(0, 0.01), chance.choice(there))).start()
            for each in fleets:
                each.write(client)
            if number % 10 == 0:
                for each in fleets:
                    each.check(client)
        for each in fleets:
            each.check(client)
        assert sum(len(each.model.held) for each in fleets)
    return fleets


@pytest.mark.one_process("a server of several processes has a shape of its own")
@with_all_cases
def test_in_folders(tmp_path: Path) -> None:
    data, copy, restored = (str(tmp_path / each) for each in ("data", "copy", "restored"))
    with server_process(*WORKERS, "--data", data, complaints=ENDED) as server:
        fleets = live(server, 1)
        assert dynhull("backup", copy, "--data", data).exit_code == 0
        server.process.send_signal(signal.SIGTERM)
        server.process.wait()
    assert dynhull("check", copy).exit_code == 0
    assert dynhull("restore", copy, "--data", restored).exit_code == 0
    for folder in (data, copy, restored):
        with server_process(*WORKERS, "--data", folder) as server, HullClient(server.address) as client:
            for each in fleets:
                each.check(client)
            if folder is restored:
                for _ in range(20):
                    for each in fleets:
                        each.write(client)
                for each in fleets:
                    each.check(client)


@slow
@pytest.mark.one_process("a server of several processes has a shape of its own")
def test_in_postgresql(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    options = (*WORKERS, "--journal", url)
    with server_process(*options, complaints=ENDED) as server:
        fleets = live(server, 3)
    with server_process(*options, killed=True) as server, HullClient(server.address) as client:
        for each in fleets:
            each.check(client)
            each.write(client)
        server.process.kill()
        server.process.wait()
    with server_process(*options) as server, HullClient(server.address) as client:
        for each in fleets:
            each.check(client)
