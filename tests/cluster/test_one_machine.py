"""`dynhull serve --workers --journal`: a cluster of one machine, which nobody else joins."""

import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import pytest
from cases import slow, with_all_cases
from cluster import processes
from command_line import dynhull
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import Server, run, server_process

from dynhull_client import HullClient, UnavailableError
from dynhull_cluster.machines.joining import PRESENT

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")

QUIET = ("--scrub-cpu", "0", "--log-level", "error")
NAMES = [f"{first}/hull" for first in "abcdefgh"]
OWNERS = "SELECT partition, worker, epoch FROM owners ORDER BY partition"


@pytest.fixture
def url(postgres: PostgreSQL) -> str:
    return postgres.new_database()


def fill(server: Server) -> None:
    with HullClient(server.address, retries=0) as client:
        for name in NAMES:
            client.create_hull(name)
            assert client.apply(name, insert=[[1, 2]], producer="p", sequence=1).revision == 1


def goes_on(server: Server, sequence: int) -> None:
    """All hulls are as they were, and take the next batch."""
    with HullClient(server.address, retries=0) as client:
        for name in NAMES:
            assert client.apply(name, insert=[[1, 2]], producer="p", sequence=sequence - 1).duplicate
            assert client.apply(name, insert=[[1, 2]], producer="p", sequence=sequence).revision == sequence


def refused(*options: str) -> str:
    """What a server says that does not start."""
    done = run("serve", "--port", "0", *options, *QUIET)
    assert done.returncode == 2, done.stderr
    return done.stderr


def test_workers_on_a_database_are_a_cluster_of_their_own(url: str) -> None:
    options = ("--journal", url, *QUIET)
    with server_process("--workers", "2", *options, killed=True, complaints="is started again") as server:
        fill(server)
        name = f"{socket.gethostname()}-{server.process.pid}-"
        wait_until(lambda: len({worker for _, worker, _ in query(url, OWNERS)}) == 2)  # one may have begun first
        shown = dynhull("cluster", "status", "--journal", url).stdout.splitlines()
        assert shown[0] == "2 partitions"
        assert [each.split("  ")[1] for each in shown[1:]] == ["serves, without --cluster"] * 2
        assert sorted(each.split("  ")[2] for each in shown[1:]) == ["1: 0", "1: 1"]
        before = query(url, OWNERS)
        for other in (("--workers", "2"), ("--cluster",)):
            said = refused(*other, *options)
            assert f"is served by {name}" in said
            assert "stop that server first, choose another database, or start both with --cluster" in said
        assert query(url, OWNERS) == before
        worker = processes(server.process.pid)["worker-0"]
        os.kill(worker, signal.SIGKILL)
        goes_on(server, 2)
        wait_until(lambda: processes(server.process.pid).get("worker-0", worker) != worker)
        wait_until(lambda: {worker for _, worker, _ in query(url, OWNERS)} == {worker for _, worker, _ in before})
        server.process.kill()
    with server_process("--workers", "1", *options) as server:  # any number of workers has all partitions
        goes_on(server, 3)


@slow
def test_a_database_of_workers_of_before_opens(url: str) -> None:
    """They had no tables of a cluster, and one address for callers. They were killed."""
    options = ("--workers", "2", "--journal", url, *QUIET)
    with server_process(*options, killed=True) as server:
        fill(server)
        server.process.kill()
    query(url, "DROP TABLE IF EXISTS cluster, workers, heirs, wishes")
    query(url, "UPDATE owners SET worker = 'process 1 on ' || worker, address = '127.0.0.1:50051'")
    with server_process(*options) as server:
        goes_on(server, 2)


def test_workers_do_not_begin_beside_a_single_server(url: str) -> None:
    with server_process("--journal", url, *QUIET) as server, HullClient(server.address) as client:
        client.create_hull("a")
        assert f"is served by {socket.gethostname()}-{server.process.pid}-" in refused(
            "--workers", "1", "--journal", url
        )
        assert client.apply("a", insert=[[1, 2]]).revision == 1


@with_all_cases
@pytest.mark.parametrize("options", [(), ("--workers", "1")], ids=["one process", "workers"])
def test_a_server_takes_over_from_one_elsewhere_that_has_died(url: str, options: tuple[str, ...]) -> None:
    with server_process("--journal", url, *QUIET, killed=True) as server, HullClient(server.address) as client:
        client.create_hull("a")
        server.process.kill()
    for table in ("owners", "workers"):
        query(url, f"UPDATE {table} SET process = 'elsewhere'")
    renewed = time.monotonic()
    query(url, "UPDATE workers SET seen = clock_timestamp()")
    with server_process(*options, "--journal", url, *QUIET) as server, HullClient(server.address) as client:
        assert client.apply("a", insert=[[1, 2]]).revision == 1
        assert time.monotonic() > renewed + PRESENT


@with_all_cases
def test_a_server_that_was_stopped_is_replaced_and_serves_again_when_the_other_one_has_gone(url: str) -> None:
    options = ("--workers", "2", "--journal", url, *QUIET)
    with server_process(*options, complaints=None) as first:
        fill(first)
        with ExitStack() as later:
            with stopped(first.process.pid):
                second = later.enter_context(server_process(*options))
                goes_on(second, 2)
            owners = query(url, OWNERS)
            goes_on(second, 3)
            with HullClient(first.address, retries=0) as client, pytest.raises(UnavailableError):
                client.get_hull(NAMES[0])
            assert query(url, OWNERS) == owners
        with HullClient(first.address, retries=1000) as client:
            assert client.get_hull(NAMES[0]).revision == 3
        goes_on(first, 4)


@contextmanager
def stopped(server: int) -> Iterator[None]:
    """A server, all processes of which are stopped."""
    there = [server, *processes(server).values()]
    for each in there:
        os.kill(each, signal.SIGSTOP)
    try:
        yield
    finally:
        for each in there:
            with suppress(ProcessLookupError):
                os.kill(each, signal.SIGCONT)
