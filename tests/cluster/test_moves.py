"""Planned moves: a worker reads a partition while another one serves it, and takes it once that one lets go.

Whatever ends or stops in between: what is acknowledged stays, nothing is applied twice, and somebody serves it again.
"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import Any

import numpy as np
import pytest
from cases import slow
from cluster import processes
from command_line import dynhull
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import Server, server_process
from steady_writer import SteadyWriter

from dynhull_client import AlarmEvent, HullClient, Quarantine
from dynhull_cluster.postgres.ownership import LEASE

POINTS = np.random.default_rng(1).normal(size=(5_000, 2))
OWNER = "SELECT epoch, worker FROM owners WHERE until > '-infinity' AND address <> ''"
HEIR = "SELECT heirs.worker FROM heirs JOIN owners USING (partition, epoch)"


class Pair:
    """Two servers with one partition, a hull, and a writer."""

    def __init__(self, url: str, servers: list[Server], hull: str) -> None:
        self.url = url
        self.servers = servers
        self.hull = hull
        with HullClient(servers[0].address, retries=1000) as client:
            client.create_hull(hull)
            client.apply(hull, insert=POINTS)
        wait_until(lambda: len(query(url, "SELECT worker FROM workers")) == 2)
        self.writer = SteadyWriter(servers[1].address, hull)
        self.writer.start()

    def owner(self) -> str:
        """The worker that serves the partition."""
        rows: list[tuple[int, str]] = []
        wait_until(lambda: rows.extend(query(self.url, OWNER)) or bool(rows))
        return rows[-1][1]

    def epoch(self) -> int:
        return query(self.url, "SELECT epoch FROM owners")[0][0]

    def other(self) -> str:
        """The worker that does not."""
        (found,) = {name for (name,) in query(self.url, "SELECT worker FROM workers")} - {self.owner()}
        return found

    def process(self, worker: str) -> int:
        """The number of its process."""
        server = next(each for each in self.servers if f"-{each.process.pid}-" in worker)
        return processes(server.process.pid)["worker-0"]

    def order(self, worker: str) -> None:
        assert dynhull("cluster", "move", "0", worker, "--journal", self.url).exit_code == 0

    def check(self) -> None:
        """Every batch that was acknowledged is there once."""
        self.writer.more()
        self.writer.stop()
        for server in self.servers:
            self.writer.check(server.address, before=1)


@contextmanager
def two_servers(url: str, complaints: str | None) -> Iterator[tuple[str, list[Server]]]:
    options = ("--cluster", "--partitions", "1", "--journal", url, "--scrub-cpu", "0", "--log-level", "error")
    with ExitStack() as stack:
        yield url, [stack.enter_context(server_process(*options, complaints=complaints)) for _ in range(2)]


@pytest.fixture(scope="module")
def calm(postgres: PostgreSQL) -> Iterator[tuple[str, list[Server]]]:
    """Servers that have nothing to complain about."""
    with two_servers(postgres.new_database(), "") as servers:
        yield servers


@pytest.fixture(scope="module")
def mortal(postgres: PostgreSQL) -> Iterator[tuple[str, list[Server]]]:
    """Servers whose workers are killed."""
    with two_servers(postgres.new_database(), None) as servers:
        yield servers


@pytest.fixture
def pair(calm: tuple[str, list[Server]], name: str) -> Iterator[Pair]:
    pair = Pair(*calm, name)
    yield pair
    pair.writer.stop()


@pytest.fixture
def mortal_pair(mortal: tuple[str, list[Server]], name: str) -> Iterator[Pair]:
    pair = Pair(*mortal, name)
    yield pair
    pair.writer.stop()


class Stopped:
    """A process that stands still within the block, unless it is killed.

    Attributes:
        briefly: whether it stood still for so short a time that its lease has not ended.
    """

    def __init__(self, process: int) -> None:
        self._process = process
        self.briefly = False

    def __enter__(self) -> "Stopped":
        self._since = time.monotonic()
        os.kill(self._process, signal.SIGSTOP)
        return self

    def kill(self) -> None:
        os.kill(self._process, signal.SIGKILL)
        self._process = 0

    def go_on(self) -> None:
        os.kill(self._process, signal.SIGCONT)
        self.briefly = time.monotonic() - self._since < LEASE / 2
        self._process = 0

    def __exit__(self, *_: object) -> None:
        if self._process:
            self.go_on()


def ready(pair: Pair, worker: str) -> bool:
    return query(pair.url, HEIR) == [(worker,)]


@contextmanager
def standing_until_ready(pair: Pair, source: str, target: str) -> Iterator[Stopped]:
    """The source stands still within the block, which begins once the target has read as much as there is."""
    with Stopped(pair.process(source)) as stopped:
        pair.order(target)
        wait_until(lambda: ready(pair, target))
        yield stopped


def is_free(pair: Pair) -> bool:
    return query(pair.url, "SELECT until = '-infinity' FROM owners") == [(True,)]


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_partition_moves_to_and_fro_while_it_is_written(pair: Pair) -> None:
    pair.writer.more()
    for _ in range(4):
        source, target = pair.owner(), pair.other()
        epoch = pair.epoch()
        pair.order(target)
        wait_until(lambda target=target: pair.owner() == target)
        assert pair.epoch() == epoch + 1, "nobody else had it in between"
        pair.writer.more()
        assert pair.other() == source
    pair.check()


@pytest.mark.one_process("a cluster has a shape of its own")
def test_the_owner_serves_until_the_next_one_has_read(pair: Pair) -> None:
    """The owner does not let go for a worker that cannot read: as one whose connections are refused."""
    source, target, epoch = pair.owner(), pair.other(), pair.epoch()
    with Stopped(pair.process(target)):
        pair.order(target)
        for _ in range(3):
            pair.writer.more()
        assert (pair.owner(), pair.epoch()) == (source, epoch)
    wait_until(lambda: pair.owner() == target)
    pair.check()


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_an_order_can_be_cancelled(mortal_pair: Pair) -> None:
    pair = mortal_pair
    source, target, epoch = pair.owner(), pair.other(), pair.epoch()
    with standing_until_ready(pair, source, target) as stopped:
        pair.order(source)
    wait_until(lambda: not query(pair.url, HEIR) and pair.owner() == source)
    assert pair.epoch() == epoch or not stopped.briefly
    pair.order(target)
    wait_until(lambda: pair.owner() == target)
    pair.check()


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_target_that_is_killed_before_the_owner_lets_go(mortal_pair: Pair) -> None:
    pair = mortal_pair
    source, target = pair.owner(), pair.other()
    with standing_until_ready(pair, source, target):
        os.kill(pair.process(target), signal.SIGKILL)
    pair.writer.more()
    # It is started again, and reads again. If the owner has let go before it noticed, it has taken the partition back.
    wait_until(lambda: pair.owner() == target)
    pair.check()


@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_target_that_is_killed_when_the_owner_has_let_go(mortal_pair: Pair) -> None:
    pair = mortal_pair
    source, target = pair.owner(), pair.other()
    with (
        standing_until_ready(pair, source, target) as stopped_source,
        Stopped(pair.process(target)) as stopped_target,
    ):
        stopped_source.go_on()
        wait_until(lambda: is_free(pair))
        stopped_target.kill()
    pair.writer.more()
    wait_until(lambda: pair.owner() == target)
    pair.check()


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_source_that_is_killed_when_it_has_let_go(mortal_pair: Pair) -> None:
    pair = mortal_pair
    source, target, epoch = pair.owner(), pair.other(), pair.epoch()
    with (
        standing_until_ready(pair, source, target) as stopped_source,
        Stopped(pair.process(target)) as stopped_target,
    ):
        killed = pair.process(source)
        stopped_source.go_on()
        wait_until(lambda: is_free(pair))
        os.kill(killed, signal.SIGKILL)
    wait_until(lambda: pair.owner() == target)
    assert pair.epoch() == epoch + 1 or not stopped_target.briefly
    pair.check()


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_source_that_is_killed_while_the_target_follows(mortal_pair: Pair) -> None:
    """The target takes what it has followed, and the writes of the last moments are there, too."""
    pair = mortal_pair
    source, target, epoch = pair.owner(), pair.other(), pair.epoch()
    with standing_until_ready(pair, source, target) as stopped:
        stopped.kill()
    wait_until(lambda: pair.epoch() > epoch and pair.owner() == target)
    pair.check()


KINDS: dict[str, dict[str, Any]] = {
    "keyed": {"keyed": "str", "quarantine": Quarantine(max_growth=2)},
    "globe": {"keyed": "int", "geographic": True},
    "window": {"max_points": 7},
    "gone": {},
}


def write(client: HullClient, turn: int) -> None:
    """A batch to each kind of hull: some keys come, move, are held and leave; points leave a window."""
    keys = [*"abcdef", f"new-{turn}", f"far-{turn}"]
    places = [[each, (each + turn) % 5] for each in range(7)] + [[1e6, turn]]
    client.put("keyed", keys, places, remove=[f"new-{turn - 2}"], producer="p", sequence=turn)
    client.put("globe", range(4), [[10 * each, 50 + turn % 7] for each in range(4)], producer="p", sequence=turn)
    client.apply("window", insert=[[turn, each] for each in range(3)], producer="p", sequence=turn)


def contents(client: HullClient, name: str) -> list[Any]:
    """All that a client can see of a hull."""
    held = list(client.list_held(name)) if "quarantine" in KINDS.get(name, {}) else []
    points = client.sample_points(name)
    keys = list(client.entities(name).keys) if "keyed" in KINDS.get(name, {}) else []
    return [client.get_hull(name), client.last_sequence(name, "p"), held, sorted(points.points.tolist()), keys]


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_all_kinds_of_hulls_are_followed(mortal_pair: Pair) -> None:
    """What has come since the target has read: keys, places on the globe, what is held, windows, and producers."""
    pair = mortal_pair
    with HullClient(pair.servers[0].address, retries=1000) as client:
        for name, settings in KINDS.items():
            client.create_hull(name, **settings)
        source, target = pair.owner(), pair.other()
        write(client, 1)
        with standing_until_ready(pair, source, target):
            assert pair.owner() == source
        turn = 2
        client.delete_hull("gone")
        client.create_hull("new", exist_ok=True)  # it and the batch may be repeated, if the source stood for too long
        client.apply("new", insert=[[1, 1]], producer="p", sequence=1)
        while pair.owner() != target:
            write(client, turn)
            turn += 1
        for _ in range(3):
            write(client, turn)
            turn += 1
        names = ["keyed", "globe", "window", "new"]
        before = [contents(client, name) for name in names]
        assert all(client.verify(name).equal for name in names)
        epoch = pair.epoch()
        os.kill(pair.process(target), signal.SIGKILL)  # whoever serves them next reads all of it at once
        wait_until(lambda: pair.epoch() > epoch)
        assert [contents(client, name) for name in names] == before
        there = {each.name for each in client.list_hulls()}
        assert {*names, pair.hull} <= there
        assert "gone" not in there
        write(client, turn)
    pair.check()


SMALL, LARGE = [[0, 1]], [[0, 6]]  # where the third point is: areas of 2 and 12
SOON = timedelta(seconds=2)


def events(client: HullClient, alarm: str) -> list[AlarmEvent]:
    last = client.get_alarm(alarm).last_sequence
    with client.watch_alarm(alarm, after=0) as stream:
        return list(islice(stream, last))


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_alarms_are_followed(mortal_pair: Pair) -> None:
    """Who is raised, who waits and who takes care: what the target has read, and what has come since."""
    pair, hulls = mortal_pair, [f"alarmed/{each}" for each in "abc"]
    with HullClient(pair.servers[0].address, retries=1000) as client:

        def statuses() -> list[Any]:
            return [client.get_alarm(alarm).statuses for alarm in ("large", "later")]

        for hull in hulls:
            client.create_hull(hull, keyed="str")
            client.put(hull, [*"xyz"], [[0, 0], [4, 0], *SMALL])
        client.create_alarm("large", prefix="alarmed/", when="area > 10", clear="area < 9")
        client.create_alarm("later", prefix="alarmed/", when="area > 10", for_="1h")
        client.create_alarm("soon", prefix="alarmed/", when="area > 10", for_=SOON)
        for hull in hulls[:2]:
            client.put(hull, ["z"], LARGE)
        client.acknowledge_alarm("large", hulls[0])
        client.mute_alarm("large", hulls[1], datetime.now(UTC) + timedelta(hours=1))
        client.ack_alarm("large", "pager", 1)
        source, target = pair.owner(), pair.other()
        with standing_until_ready(pair, source, target):
            assert pair.owner() == source
        client.put(hulls[0], ["z"], SMALL)
        client.put(hulls[2], ["z"], LARGE)
        client.acknowledge_alarm("large", hulls[2])
        client.put(hulls[0], ["z"], LARGE)
        wait_until(lambda: pair.owner() == target)
        large, later = before = statuses()
        assert [each.acknowledged is not None for each in large] == [False, False, True]
        assert [each.muted_until is not None for each in large] == [False, True, False]
        assert [each.since is not None and not each.raised for each in later] == [True] * 3
        epoch = pair.epoch()
        os.kill(pair.process(target), signal.SIGKILL)
        wait_until(lambda: pair.epoch() > epoch)
        assert statuses() == before
        assert [each.acknowledged for each in client.get_alarm("large").consumers] == [1]
        wait_until(lambda: client.get_alarm("soon").raised == 3)
        made = [(event.sequence, event.type, event.hull) for event in events(client, "large")]
        types = ["raised", "raised", "cleared", "raised", "raised"]
        order = [hulls[0], hulls[1], hulls[0], hulls[2], hulls[0]]
        assert made == list(zip(range(1, 6), types, order, strict=True))
        for hull, since in zip(hulls, (each.since for each in later), strict=True):
            last = [event for event in events(client, "soon") if event.hull == hull][-1]
            assert (last.type, last.cause_time, last.time) == ("raised", since, since + SOON)
    pair.check()
