"""A hull over shards in a cluster: its root and its shards are in partitions, which move, and whose owners die.

Each test has a writer that sends one numbered batch after the other. In the end each acknowledged batch is there once.
"""

import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import grpc
import numpy as np
import pytest
import trustme
from cases import ALL_CASES, slow, with_all_cases
from cluster import processes
from command_line import dynhull
from one_gateway import entries
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import Server, server_process
from steady_callers import Consumes, Creates, Large, Pipes, Plain, PlainOverShards
from steady_writer import SteadyWriter

from dynhull_client import HullClient, HullCopy
from dynhull_cluster.placement import worker_of

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")

PARTITIONS = 4
SHARDS = 4
POINTS = np.random.default_rng(1).normal(size=(2_000, 2))
QUIET = ("--scrub-cpu", "0", "--log-level", "error", "--snapshot-points", "500")
SERVED = "SELECT partition, worker FROM owners WHERE until > '-infinity' AND address <> '' ORDER BY partition"


def machine(url: str, *options: str) -> Sequence[str]:
    """The options of a server."""
    return ("--cluster", "--partitions", str(PARTITIONS), "--journal", url, *QUIET, *options)


class Fleet:
    """A hull over shards that is written all the time, and the servers that have it."""

    def __init__(self, url: str, servers: list[Server], hull: str) -> None:
        self.url = url
        self.servers = servers
        self.hull = hull
        with HullClient(servers[0].address, retries=1000) as client:
            client.create_hull(hull, shards=SHARDS, exist_ok=True)
            client.apply(hull, insert=POINTS, producer="first", sequence=1)  # partitions may move already
        self.writer = SteadyWriter(servers[-1].address, hull)
        self.writer.start()

    @property
    def root(self) -> int:
        """The partition of the root. Its shards are in this one and those behind it."""
        return worker_of(self.hull, PARTITIONS)

    def owners(self) -> list[str]:
        """The workers that serve the partitions."""
        rows: list[tuple[int, str]] = []

        def all_are_served() -> bool:
            rows[:] = query(self.url, SERVED)
            return len(rows) == PARTITIONS

        wait_until(all_are_served)
        return [worker for _, worker in rows]

    def process(self, worker: str) -> int:
        """The number of the process of a worker; 0 while there is none."""
        server = next(each for each in self.servers if f"-{each.process.pid}-" in worker)
        return processes(server.process.pid).get("worker-0", 0)

    def move(self, partition: int, worker: str) -> None:
        """Have a worker take a partition, and wait until it has."""
        assert dynhull("cluster", "move", str(partition), worker, "--journal", self.url).exit_code == 0
        wait_until(lambda: self.owners()[partition] == worker)

    def check(self, changes: int = 0) -> None:
        """Every batch that was acknowledged is there once, and so is every point; `changes` are other revisions."""
        self.writer.more()
        self.writer.stop()
        written = len(self.writer.revisions)
        assert self.writer.revisions == sorted(set(self.writer.revisions))
        for server in self.servers:
            with HullClient(server.address, retries=1000) as client:
                info = client.get_hull(self.hull).info
                assert (info.revision, info.points) == (1 + written + changes, len(POINTS) + written)
                assert client.verify(self.hull).equal
                counts = client.count(self.hull, [SteadyWriter.point(each) for each in range(1, written + 2)]).counts
                assert counts.tolist() == [1] * written + [0]
                assert client.count(self.hull, POINTS).counts.tolist() == [1] * len(POINTS)


@contextmanager
def two_servers(url: str, complaints: str | None) -> Iterator[list[Server]]:
    with ExitStack() as stack:
        servers = [stack.enter_context(server_process(*machine(url), complaints=complaints)) for _ in range(2)]
        wait_until(lambda: len({worker for _, worker in query(url, SERVED)}) == 2)
        yield servers


@pytest.fixture
def fleet(postgres: PostgreSQL) -> Iterator[Fleet]:
    """On servers whose workers are killed."""
    url = postgres.new_database()
    with two_servers(url, None) as servers:
        fleet = Fleet(url, servers, "fleet")
        yield fleet
        fleet.writer.stop()


@slow
def test_partitions_move_to_and_fro_and_nobody_complains(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    with two_servers(url, "") as servers, HullClient(servers[0].address, retries=1000) as client:
        fleet, copy = Fleet(url, servers, "fleet"), HullCopy()
        callers = [kind(servers[0].address) for kind in (Plain, PlainOverShards, Large, Consumes, Pipes, Creates)]
        for caller in callers:
            caller.begin()
        over = threading.Event()

        def watch() -> None:
            with client.watch("fleet", copy=copy) as events:
                for event in events:
                    assert event.revision >= (copy.revision or 0)
                    if over.is_set():
                        return

        thread = threading.Thread(target=watch)
        thread.start()
        one, other = sorted(set(fleet.owners()))
        # That of the root, and one of shards alone; `make cluster` moves the others, too.
        moved = range(PARTITIONS) if ALL_CASES else (fleet.root, (fleet.root + 1) % PARTITIONS)
        for worker in (one, other):
            for partition in moved:
                fleet.move(partition, worker)
                fleet.writer.more()
        over.set()
        fleet.writer.more()
        thread.join()
        for caller in callers:
            caller.finish()
            assert caller.errors == []
        fleet.check()
        with client.watch("fleet", copy=copy) as events:
            next(iter(events))
        np.testing.assert_array_equal(copy.vertices, client.get_hull("fleet").vertices)


@slow
def test_killed_workers_lose_and_double_nothing(fleet: Fleet) -> None:
    for _ in range(2):
        for worker in sorted(set(fleet.owners())):
            fleet.writer.more()
            os.kill(fleet.process(worker), signal.SIGKILL)
            fleet.writer.more()
            wait_until(lambda: len(set(fleet.owners())) == 2)
    fleet.check()


@with_all_cases
def test_owners_that_were_stopped_cannot_disturb_those_that_replaced_them(fleet: Fleet) -> None:
    """The worker with the root, and one with shards alone: each goes on after others have all that it had."""
    root_alone = fleet.owners()[fleet.root]
    for partition in range(PARTITIONS):
        if partition != fleet.root:
            fleet.move(partition, next(each for each in fleet.owners() if each != root_alone))
    for partition in (fleet.root, (fleet.root + 1) % PARTITIONS):
        worker = fleet.owners()[partition]
        stopped = fleet.process(worker)
        fleet.writer.more()
        os.kill(stopped, signal.SIGSTOP)
        try:
            wait_until(lambda worker=worker: worker not in {name for _, name in query(fleet.url, SERVED)})
            fleet.writer.more()
        finally:
            os.kill(stopped, signal.SIGCONT)
        fleet.writer.more()
        wait_until(lambda worker=worker, stopped=stopped: fleet.process(worker) != stopped)
        wait_until(lambda: len(set(fleet.owners())) == 2)
    fleet.check()


@with_all_cases
def test_servers_come_and_go(postgres: PostgreSQL) -> None:
    """One of three gives up what it has, another one is stopped, and the last but one is gone all at once."""
    url = postgres.new_database()
    with ExitStack() as stack:
        drained, stopped = (stack.enter_context(server_process(*machine(url), complaints=None)) for _ in range(2))
        killed = stack.enter_context(server_process(*machine(url), complaints=None, killed=True))
        left = stack.enter_context(server_process(*machine(url), complaints=None))
        fleet = Fleet(url, [left], "fleet")
        wait_until(lambda: len(set(fleet.owners())) == 4)
        fleet.writer.more()
        name = next(each for each in fleet.owners() if f"-{drained.process.pid}-" in each)
        assert dynhull("cluster", "drain", name, "--journal", url).exit_code == 0
        wait_until(lambda: len(set(fleet.owners())) == 3)
        stopped.process.terminate()
        wait_until(lambda: len(set(fleet.owners())) == 2)
        fleet.writer.more()
        killed.process.kill()
        wait_until(lambda: len(set(fleet.owners())) == 1)
        fleet.check()


@with_all_cases
def test_other_numbers_of_shards_beside_moves(fleet: Fleet) -> None:
    one, other = sorted(set(fleet.owners()))
    done: list[int] = []

    def divide() -> None:
        with HullClient(fleet.servers[0].address, retries=1000) as client:
            for shards in (7, 2, 5):
                while client.get_hull(fleet.hull).info.shards != shards:
                    client.reshard(fleet.hull, shards)
                done.append(shards)

    thread = threading.Thread(target=divide)
    thread.start()
    while thread.is_alive():
        for partition in range(PARTITIONS):
            fleet.move(partition, one)
        for partition in range(PARTITIONS):
            fleet.move(partition, other)
    thread.join()
    assert done == [7, 2, 5]
    wait_until(lambda: query(fleet.url, "SELECT count(*) FROM hulls") == [(1 + 5,)])
    fleet.check(changes=3)


@slow
def test_the_shards_of_a_deleted_hull_are_deleted(fleet: Fleet) -> None:
    fleet.check()
    with HullClient(fleet.servers[0].address, retries=1000) as client:
        client.delete_hull(fleet.hull)
        wait_until(lambda: query(fleet.url, "SELECT count(*) FROM hulls") == [(0,)])
        client.create_hull(fleet.hull, shards=2)
        client.apply(fleet.hull, insert=[[3, 4]])
        assert client.sample_points(fleet.hull, 9).points.tolist() == [[3, 4]]


@with_all_cases
def test_a_dump_beside_writes_is_of_one_revision(fleet: Fleet, postgres: PostgreSQL, tmp_path: Path) -> None:
    fleet.writer.more()
    before = len(fleet.writer.revisions)
    copy = postgres.restored_copy(fleet.url, tmp_path)
    fleet.writer.more()
    copied = "the database is a copy"
    with (
        server_process(*machine(copy), complaints=copied) as server,
        HullClient(server.address, retries=1000) as client,
    ):
        info = client.get_hull(fleet.hull).info
        assert info.restored
        written = info.revision - 1
        assert before <= written <= len(fleet.writer.revisions)
        assert info.points == len(POINTS) + written
        assert client.verify(fleet.hull).equal
        counts = client.count(fleet.hull, [SteadyWriter.point(each) for each in range(1, written + 2)]).counts
        assert counts.tolist() == [1] * written + [0]
        assert client.apply(fleet.hull, insert=[[1, 1]]).revision == info.revision + 1


@slow
def test_machines_with_addresses_of_their_own_use_tls(postgres: PostgreSQL, tmp_path: Path) -> None:
    authority = trustme.CA()
    issued = authority.issue_cert("localhost", "127.0.0.1", "127.0.0.2")
    (tmp_path / "cert.pem").write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
    issued.private_key_pem.write_to_path(tmp_path / "key.pem")
    authority.cert_pem.write_to_path(tmp_path / "ca.pem")
    (tmp_path / "tokens.toml").write_text(entries("me"))
    files = {"--tls-cert": "cert.pem", "--tls-key": "key.pem", "--cluster-ca": "ca.pem", "--tokens": "tokens.toml"}
    options = [str(part) for flag, file in files.items() for part in (flag, tmp_path / file)]
    url = postgres.new_database()
    trusting = grpc.ssl_channel_credentials(authority.cert_pem.bytes())
    with ExitStack() as stack:
        one, other = (
            stack.enter_context(server_process(*machine(url, *options, "--cluster-host", f"127.0.0.{host}")))
            for host in (1, 2)
        )
        # an owner that is still reading what it took has no address yet
        addresses = "SELECT address FROM owners WHERE address <> ''"
        wait_until(lambda: len({address.split()[0] for (address,) in query(url, addresses)}) == 2)
        client = stack.enter_context(HullClient(one.address, tls=trusting, token="me"))
        client.create_hull("fleet", keyed="str", shards=SHARDS)
        client.put("fleet", [f"k{i}" for i in range(200)], POINTS[:200])
        assert client.verify("fleet").equal
        beside = stack.enter_context(HullClient(other.address, tls=trusting, token="me"))
        assert beside.positions("fleet", ["k7"]).positions.tolist() == [POINTS[7].tolist()]


@with_all_cases
def test_a_database_goes_from_workers_to_a_cluster_into_a_folder_and_back(postgres: PostgreSQL, tmp_path: Path) -> None:
    """Each has the same hull, and goes on: roots of a new database begin above all that the shards know of."""
    workers = ("--workers", "2", "--gateways", "1", *QUIET)
    first, second = postgres.new_database(), postgres.new_database()
    folder, other = tmp_path / "folder", tmp_path / "other"

    def grow(*options: str) -> None:
        with server_process(*options) as server, HullClient(server.address, retries=1000) as client:
            info = client.create_hull("fleet", shards=3, exist_ok=True)
            turn = info.revision + 1
            client.apply("fleet", insert=POINTS[turn : turn + 1], producer="p", sequence=turn)
            assert client.get_hull("fleet").info.points == turn
            assert client.verify("fleet").equal
            assert client.count("fleet", POINTS[1 : turn + 1]).counts.tolist() == [1] * turn

    def move(source: object, target: object) -> None:
        done = dynhull("move", source, target)
        assert done.exit_code == 0, done.stderr
        assert "1 hull, 3 shards, 0 fences," in done.stdout

    grow(*workers, "--journal", first)
    grow(*machine(first))  # its owners have greater numbers now than those of the next database would have
    move(first, folder)
    grow(*workers, "--data", str(folder))
    move(folder, second)
    grow(*machine(second))
    grow(*workers, "--journal", second)
    move(second, other)
    grow(*workers, "--data", str(other))
