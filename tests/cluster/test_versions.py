"""Servers of a cluster that are of other versions: they serve together, or say that they do not, and why."""

import asyncio
import json
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

import psycopg
import pytest
from command_line import dynhull
from forked import COMMAND
from logged_process import logged_process
from pacing import pause
from patience import PATIENCE, wait_until
from postgresql import PostgreSQL, query
from server_process import finished, server_process

from dynhull_client import HullClient
from dynhull_cluster.asking_frames import AskingFrames
from dynhull_cluster.frame_server import FrameServer
from dynhull_cluster.frames import ANSWERS_PINGS, HEADER, Kind
from dynhull_cluster.machines.addresses import Addresses
from dynhull_cluster.machines.board import Owner, Tables
from dynhull_cluster.machines.entrance import proof_of
from dynhull_cluster.machines.member import STRANGER
from dynhull_cluster.versions import NEWEST, own_versions

PARTITION, WORKER, SECRET = 3, "north-1/0", "secret"
PROOF = proof_of(PARTITION, WORKER, SECRET).encode()
LATER = {"program": "dynhull 9.0.0", "oldest": 8, "newest": 9, "since": "a later version"}
APART = (
    r"worker {} is of dynhull 9\.0\.0 \(protocol 8 to 9\) and this program of dynhull \S+ \(protocol 1\), which do not "
    "call each other: stop all servers of the cluster, then start those of one version"
)
OPTIONS = ("--cluster", "--partitions", "2", "--scrub-cpu", "0")
JOIN = (
    "INSERT INTO workers (worker, draining, process, host, seen, versions) "
    "VALUES (%s, false, '', '127.0.0.1', clock_timestamp(), %s) "
    "ON CONFLICT (worker) DO UPDATE SET seen = clock_timestamp()"
)


@contextmanager
def joined(url: str, worker: str, said: dict[str, Any]) -> Iterator[None]:
    """A worker in the tables that says this of its versions, and renews its row."""
    left = Event()

    def renew() -> None:
        with psycopg.connect(url, autocommit=True, options="-c search_path=dynhull") as connection:
            while not left.is_set():
                connection.execute(JOIN, [worker, json.dumps(said)])
                pause(0.2)
            connection.execute("DELETE FROM workers WHERE worker = %s", [worker])

    renewing = Thread(target=renew)
    renewing.start()
    try:
        yield
    finally:
        left.set()
        renewing.join()


@pytest.mark.one_process("a cluster has a shape of its own")
def test_what_has_no_version_in_common_is_refused_and_gets_nothing(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    command = [COMMAND, "serve", "--port", "0", "--journal", url, *OPTIONS, "--log-format", "json"]
    with logged_process([*command, "--create-on-write"]) as server:
        address = server.process.stdout.readline().split()[-1]
        with joined(url, "far/0", LATER), HullClient(address) as client:
            said = server.wait_for(STRANGER)
            assert re.fullmatch(APART.format("far/0"), said["reason"])
            shown = dynhull("cluster", "status", "--journal", url).stdout
            assert re.search(f"^{APART.format('far/0')}$", shown, re.MULTILINE)
            refused = finished(command)
            assert refused.returncode != 0
            assert re.search(f"^error: cannot serve: {APART.format('far/0')}$", refused.stderr, re.MULTILINE)
            assert [client.apply(name, insert=[[1, 1]]).points for name in ("a", "b", "c", "d")] == [1] * 4
            served = {worker for (worker,) in query(url, "SELECT worker FROM owners WHERE until > '-infinity'")}
            assert len(served) == 1
            assert "far/0" not in served
        with joined(url, "near/0", LATER | {"oldest": 1}):
            wait_until(lambda: query(url, "SELECT 1 FROM workers WHERE worker = 'near/0'"))
            shown = dynhull("cluster", "status", "--journal", url).stdout
            assert re.search(
                r"^the workers are of dynhull \S+ \(protocol 1\) and dynhull 9.0.0 \(protocol 1 to 9\)$",
                shown,
                re.MULTILINE,
            )
        assert len(server.said(STRANGER)) == 1


@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_split_refuses_what_is_of_another_version(postgres: PostgreSQL) -> None:
    """Servers of another version would not have the new partitions; a later format has rows that are unknown here."""
    url = postgres.new_database()
    with server_process("--journal", url, "--scrub-cpu", "0", "--cluster", "--partitions", "1"):
        pass

    def refused(because: str) -> None:
        said = dynhull("cluster", "split", 4, "--journal", url)
        assert (said.exit_code, bool(re.search(because, said.stderr))) == (2, True), said.output
        assert query(url, "SELECT partitions FROM format") == [(1,)]
        assert not query(url, "SELECT FROM owners WHERE until > '-infinity'")
        assert not query(url, "SELECT worker FROM workers WHERE starts_with(worker, 'split')")

    with joined(url, "far/0", LATER):
        wait_until(lambda: query(url, "SELECT worker FROM workers WHERE worker = 'far/0'"))
        refused(APART.format("far/0"))
    query(url, "UPDATE format SET format = 99")
    refused("has format 99, this version reads formats ")


def frame(number: int, kind: Kind, rest: bytes = b"") -> bytes:
    return HEADER.pack(len(rest), number, kind) + rest


def says(**spoken: int) -> bytes:
    """The frame of versions of another program."""
    return frame(0, Kind.VERSIONS, json.dumps(LATER | spoken).encode())


OWN = frame(0, Kind.VERSIONS, own_versions().text.encode())


@pytest.mark.parametrize(
    ("said", "answer"),
    [
        (says(), b""),
        (says(oldest=1), frame(9, Kind.ANSWER, ANSWERS_PINGS)),
        (b"", frame(9, Kind.ANSWER, ANSWERS_PINGS)),
    ],
    ids=["apart", "later", "unsaid"],
)
def test_a_worker_answers_who_speaks_one_of_its_versions(said: bytes, answer: bytes) -> None:
    async def run() -> None:
        bound = socket.create_server(("127.0.0.1", 0))
        server = FrameServer((), {}, PROOF)
        await server.listen_on(bound, None)
        reader, writer = await asyncio.open_connection(*bound.getsockname())
        writer.write(said + frame(9, Kind.GREETING, PROOF))
        assert await reader.readexactly(len(OWN + answer)) == OWN + answer
        if answer:
            writer.close()
        assert await reader.read() == b""
        writer.close()
        server.say_goodbye()
        await server.close()

    asyncio.run(asyncio.wait_for(run(), PATIENCE))


def test_a_gateway_says_that_an_owner_is_of_another_version(caplog: pytest.LogCaptureFixture) -> None:
    async def refuse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readexactly(len(OWN + frame(NEWEST, Kind.GREETING, PROOF)))
        writer.write(says())
        writer.close()

    async def run() -> None:
        server = await asyncio.start_server(refuse, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        ways = Addresses(SECRET, None, 10.0)
        ways.learn(
            Tables(
                {PARTITION: Owner(1, WORKER, "", f"127.0.0.1 1 {port}", "now", False, True)}, {}, {}, {}, PARTITION + 1
            )
        )
        for _ in range(2):
            with pytest.raises(OSError, match=APART.format(WORKER)):
                await ways.connect(PARTITION, AskingFrames)
        server.close()

    asyncio.run(asyncio.wait_for(run(), PATIENCE))
    (logged,) = caplog.records
    assert logged.getMessage() == "the owner of a partition cannot be reached"
    assert re.fullmatch(APART.format(WORKER), logged.reason)
