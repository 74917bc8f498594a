"""`dynhull cluster split`: a database that one server has used first gets partitions, while a cluster serves it.

Callers of every kind notice nothing but that they wait, whoever is killed meanwhile.
"""

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from subprocess import PIPE
from typing import Any

import pytest
from cases import slow, with_all_cases
from cluster import processes
from command_line import dynhull
from forked import Process
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import Server, server_process
from steady_callers import KINDS, Caller, Consumes, Numbered, Plain, PlainOverShards, Watches
from steady_writer import SteadyWriter

from dynhull_client import Batch, FenceEvent, HullClient, HullUnsuitableError, Prefix
from dynhull_cluster.placement import worker_of
from dynhull_cluster.postgres.splitting import OF_FENCES, OF_HULLS

SIGNALLED = Path(__file__).parents[1] / "support" / "signalled_command.py"
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
FIRSTS = "abcdefgh"
PARTITIONS = 4
SERVED = "SELECT worker FROM owners WHERE until > '-infinity' AND address <> ''"
STANDS = "SELECT worker FROM owners WHERE until > '-infinity' AND starts_with(worker, 'split by ')"
OWNERS = SERVED.replace("worker", "DISTINCT worker")
# What a split sends when all has been committed.
AFTER = "UPDATE owners SET until = '-infinity'"
TABLES = [*OF_HULLS, *OF_FENCES, "chunks", "events", "format"]

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")


@pytest.fixture
def url(postgres: PostgreSQL) -> str:
    return postgres.new_database()


@contextmanager
def one_server(url: str) -> Iterator[HullClient]:
    with server_process("--journal", url, "--scrub-cpu", "0") as server, HullClient(server.address) as client:
        yield client


def machine(url: str, **expected: Any) -> AbstractContextManager[Server]:
    options = ("--cluster", "--partitions", "1", "--scrub-cpu", "0", "--create-on-write")
    return server_process(*options, "--journal", url, **expected)


@contextmanager
def machines(url: str, **expected: Any) -> Iterator[list[Server]]:
    """Two servers of a cluster: one of them has the only partition."""
    with ExitStack() as stack:
        servers = [stack.enter_context(machine(url, **expected)) for _ in range(2)]
        wait_until(lambda: len(query(url, "SELECT worker FROM workers")) == 2)
        yield servers


def split(url: str, count: int = PARTITIONS) -> Any:
    return dynhull("cluster", "split", count, "--journal", url)


def killed_split(url: str, statement: object) -> int:
    """The exit code of a split that is killed before a statement."""
    with signalled_split(url, "KILL", statement) as process:
        process.communicate()
    return process.returncode


def signalled_split(url: str, signal: str, statement: object) -> Process:
    """A split that gets a signal before a statement."""
    command = [sys.executable, str(SIGNALLED), signal, str(statement), "cluster", "split", str(PARTITIONS)]
    return Process([*command, "--journal", url], stdout=PIPE, stderr=PIPE, text=True)


def partitions(url: str) -> int:
    return query(url, "SELECT partitions FROM format")[0][0]


def rows(url: str) -> list[list[tuple[Any, ...]]]:
    return [sorted(query(url, f"SELECT * FROM {table}"), key=str) for table in TABLES]


def fill(client: HullClient) -> None:
    """Hulls and fences of several parts, with events of many fences in one commit."""
    for first in FIRSTS:
        client.create_hull(f"{first}/hull", keyed="str")
        client.create_fence(f"{first}/fence", SQUARE, Prefix(f"{first}/"))
        client.ack_feed(f"{first}/hull", consumer="index", after=0)
    for number in range(1, 6):
        places = [[number % 2 * 9 + 1, 1], [2, 2]]
        batches = {f"{first}/hull": Batch(keys=["k", f"k{number}"], points=places) for first in FIRSTS}
        client.transfer(batches, producer="p", sequence=number)
        if number == 3:
            with client.feed(prefix="a/", after=0) as feed:
                read = [next(feed) for _ in range(number)]
            client.ack_feed(prefix="a/", consumer="sink", after=read[-1].after or b"")
    client.ack_feed("a/hull", consumer="index", after=4)


def goes_on(client: HullClient) -> None:
    """The consumers of feeds are where they were."""
    assert [each.after for each in client.list_feed_consumers("a/")][1:] == [4]
    with client.feed("a/hull", consumer="index") as feed:
        assert next(feed).revision == 5
    with client.feed("b/hull", consumer="index") as feed:
        assert next(feed).revision == 1
    with client.feed(prefix="a/", consumer="sink") as feed:
        assert [next(feed).revision for _ in range(3)] == [0, 4, 5]


def events(client: HullClient, fence: str, last: int) -> list[FenceEvent]:
    """All events of a fence."""
    found: list[FenceEvent] = []
    with client.watch_fence(fence, after=0) as watch:
        for event in watch:
            found.append(event)
            if event.sequence == last:
                return found
    raise AssertionError("the fence was deleted")


def seen(client: HullClient) -> dict[str, Any]:
    """What a client sees of all that `fill` has made."""
    found: dict[str, Any] = {}
    for first in FIRSTS:
        hull, fence = f"{first}/hull", f"{first}/fence"
        last = client.get_fence(fence).last_sequence
        contents = [client.get_hull(hull), client.last_sequence(hull, "p"), client.get_fence(fence)]
        found[first] = [*contents, list(client.entities(hull).keys), events(client, fence, last)]
    return found


def begun(address: str, kinds: Sequence[type[Caller]]) -> list[Caller]:
    callers = [kind(address, number) for number, kind in enumerate(kinds)]
    for caller in callers:
        caller.begin()
    return callers


def finish(callers: Sequence[Caller]) -> None:
    for caller in callers:
        caller.finish()
    assert [each.errors for each in callers] == [[]] * len(callers)


def more(callers: Sequence[Caller]) -> None:
    """Wait until each has had answers to what it asks from now on."""
    counts = [each.calls for each in callers]
    wait_until(lambda: all(each.errors or each.calls > count + 1 for each, count in zip(callers, counts, strict=True)))


@slow
def test_a_database_is_divided_while_all_kinds_of_callers_go_on(url: str) -> None:
    with one_server(url) as client:
        fill(client)
        before = seen(client)
        refused = split(url)
        assert (refused.exit_code, partitions(url)) == (2, 1)
        assert "without --cluster" in refused.stderr
    with ExitStack() as stack:
        first, second = stack.enter_context(machines(url, complaints=None))
        client = stack.enter_context(HullClient(second.address))
        callers = begun(second.address, [Plain, Numbered, PlainOverShards, Watches, Consumes])
        more(callers)
        done = split(url)
        assert (done.exit_code, partitions(url)) == (0, PARTITIONS), done.output
        more(callers)
        finish(callers)
        goes_on(client)
        with pytest.raises(HullUnsuitableError):
            client.transfer({f"{each}/hull": Batch(remove=["k"]) for each in FIRSTS})
        assert seen(client) == before
        assert all(client.verify(f"{each}/hull").equal for each in FIRSTS)
        with HullClient(first.address) as other:
            assert seen(other) == before
            assert {each.name for each in other.list_hulls()} > {f"{each}/hull" for each in FIRSTS}
        assert len(query(url, OWNERS)) == 2
        assert "has 4 partitions already" in split(url).stdout


@slow
def test_fences_that_would_lie_apart_are_named_and_nothing_is_changed(url: str) -> None:
    with one_server(url) as client:
        fill(client)
        client.create_fence("apart", SQUARE, Prefix("b/"))
        client.create_fence("b/any", SQUARE, Prefix("b"))
        client.create_fence("b/far", "c/hull", "b/hull")
        for consumer in ("relay", "audit"):
            client.ack_fence("apart", consumer, 0)
    before = rows(url)
    refused = split(url)
    assert refused.exit_code == 2
    apart, b, c = (worker_of(name, PARTITIONS) for name in ("apart", "b", "c"))
    of_apart = f"it would be in partition {apart}, and its subjects are in hulls b/…, in partition {b}"
    assert refused.stderr.splitlines()[:-1] == [
        f"fence 'apart' with the consumers 'audit', 'relay': {of_apart}",
        "fence 'b/any': hulls whose names begin with 'b' may be in any partition: the prefix has no \"/\"",
        f"fence 'b/far': it would be in partition {b}, and its area is that of hull 'c/hull', in partition {c}",
    ]
    assert "1000 partitions need 2000 connections to PostgreSQL at the least" in split(url, 1000).stderr
    assert rows(url) == before


@slow
def test_a_split_that_is_killed_has_changed_nothing_and_the_next_one_ends_it(url: str) -> None:
    with machine(url) as server:
        writer = writing([server])
        before = query(url, "SELECT secret FROM cluster")
        assert killed_split(url, "COMMIT") == -signal.SIGKILL
        assert (partitions(url), query(url, "SELECT secret FROM cluster")) == (1, before)
        assert split(url).exit_code == 0
        assert query(url, "SELECT secret FROM cluster") != before, "gateways that have not heard of it would be let in"
        check(writer, [server])


@with_all_cases
def test_no_kind_of_caller_notices_a_split(url: str) -> None:
    with filled_machines(url) as servers:
        callers = begun(servers[1].address, KINDS)
        more(callers)
        assert split(url).exit_code == 0
        more(callers)
        finish(callers)


@with_all_cases
def test_a_split_that_is_killed_and_not_repeated_is_one_that_was_not_begun(url: str) -> None:
    with filled_machines(url) as servers:
        writer = writing(servers)
        for statement in ("INSERT INTO wishes", "INSERT INTO heirs", "SELECT pg_advisory_xact_lock", "UPDATE chunks"):
            assert killed_split(url, statement) == -signal.SIGKILL
            writer.more()
            assert partitions(url) == 1
        assert killed_split(url, AFTER) == -signal.SIGKILL
        assert partitions(url) == PARTITIONS
        assert "already" in split(url).stdout
        check(writer, servers)


@with_all_cases
def test_a_split_that_is_killed_before_any_of_its_statements(url: str) -> None:
    with filled_machines(url) as servers:
        writer = writing(servers)
        number = 1
        while partitions(url) == 1:
            assert killed_split(url, number) == -signal.SIGKILL
            number += 1
        check(writer, servers)


@with_all_cases
def test_a_split_that_stands_still_is_replaced_and_changes_nothing_when_it_goes_on(url: str) -> None:
    with filled_machines(url) as servers:
        writer = writing(servers)
        with signalled_split(url, "STOP", "UPDATE cluster SET secret") as process:
            try:
                wait_until(lambda: query(url, STANDS))
                wait_until(lambda: query(url, OWNERS))
                writer.more()
            finally:
                process.send_signal(signal.SIGCONT)
            _, said = process.communicate()
            assert (process.returncode, "was not divided" in said) == (2, True), said
        assert partitions(url) == 1
        writer.more()
        assert split(url).exit_code == 0
        check(writer, servers)


@with_all_cases
def test_a_gateway_that_slept_during_a_split_passes_calls_to_the_right_partitions(url: str) -> None:
    with filled_machines(url) as servers:
        writers = [SteadyWriter(servers[1].address, f"{each}/new") for each in FIRSTS]
        gateway = processes(servers[1].process.pid)["gateway-0"]
        os.kill(gateway, signal.SIGSTOP)
        try:
            assert split(url).exit_code == 0
            wait_until(lambda: len(query(url, SERVED)) == PARTITIONS)
            for writer in writers:
                writer.start()
        finally:
            os.kill(gateway, signal.SIGCONT)
        for writer in writers:
            check(writer, servers)
        with HullClient(servers[0].address) as client:
            assert len([each for each in client.list_hulls() if each.name.endswith("/new")]) == len(FIRSTS)


def writing(servers: Sequence[Server]) -> SteadyWriter:
    writer = SteadyWriter(servers[-1].address, "a/points")
    writer.start()
    writer.more()
    return writer


def check(writer: SteadyWriter, servers: Sequence[Server]) -> None:
    writer.more()
    writer.stop()
    for server in servers:
        writer.check(server.address)


@contextmanager
def filled_machines(url: str) -> Iterator[list[Server]]:
    with one_server(url) as client:
        fill(client)
    with machines(url, complaints=None) as servers:
        yield servers
