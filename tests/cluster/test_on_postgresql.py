"""`dynhull serve --journal`: hulls in a PostgreSQL database outlive the server, and belong to one server at a time."""

import os
import signal
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import pytest
from cases import slow, with_all_cases
from cluster import processes
from command_line import dynhull
from metrics import scrape
from patience import PATIENCE, wait_until
from postgresql import PostgreSQL, query
from proxy import proxy
from psycopg.conninfo import conninfo_to_dict
from server_process import run, server_process

from dynhull_client import Circle, HullClient, Quarantine
from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

QUIET = ("--scrub-cpu", "0", "--log-level", "error")
ONE = batch_pb2.Batch(inserts=points_pb2.Points(coordinates=[1, 2]))


@pytest.fixture
def url(postgres: PostgreSQL) -> str:
    return postgres.new_database()


def fill(client: HullClient, prefix: str = "") -> None:
    points, fleet = f"{prefix}points", f"{prefix}fleet"
    client.create_hull(points)
    client.apply(points, insert=np.random.default_rng(1).normal(size=(1000, 2)), producer="p", sequence=1)
    client.create_hull(fleet, keyed="str")
    client.create_hull(f"{prefix}held", keyed="str", quarantine=Quarantine(max_growth=1.5))
    client.put(f"{prefix}held", ["a", "b", "c"], [[0, 0], [1, 0], [0, 1]])
    client.put(f"{prefix}held", ["far"], [[100, 100]])
    client.create_fence(f"{prefix}depot", area=Circle(0, 0, 2), subjects=fleet)
    for x in (1, 5, 1):
        client.put(fleet, ["a"], [[x, 0]])


def state(client: HullClient, prefix: str = "") -> list[Any]:
    """What a client can learn of all that."""
    with client.watch_fence(f"{prefix}depot", after=0) as watch:
        return [*points_of(client, prefix), [next(watch) for _ in range(3)]]


def points_of(client: HullClient, prefix: str = "") -> list[Any]:
    """The same without the fence."""
    points = client.get_hull(f"{prefix}points")
    fleet = client.positions(f"{prefix}fleet", ["a", "b"])
    held = list(client.list_held(f"{prefix}held"))
    assert [each.key for each in held] == ["far"]
    last = client.last_sequence(f"{prefix}points", "p")
    return [
        points.info,
        points.vertices.tolist(),
        fleet.revision,
        fleet.present.tolist(),
        fleet.positions[0].tolist(),
        held,
        last,
    ]


@slow
@pytest.mark.one_process("its owner is the process that the test starts")
def test_a_killed_server_its_backup_and_the_next_one_have_the_same(
    url: str, postgres: PostgreSQL, tmp_path: Path
) -> None:
    with server_process("--journal", url, *QUIET, killed=True) as server, HullClient(server.address) as client:
        fill(client)
        before = state(client)
        refused = run("serve", "--port", "0", "--journal", url, *QUIET)
        assert refused.returncode == 2
        assert f"is served by {socket.gethostname()}-{server.process.pid}-" in refused.stderr
        assert "stop that server first, choose another database, or start both with --cluster" in refused.stderr
        assert state(client) == before
        server.process.kill()
    with server_process("--journal", url, *QUIET) as server, HullClient(server.address) as client:
        assert state(client) == before
    restored = postgres.restored_copy(url, tmp_path)
    with server_process("--journal", restored, *QUIET) as server, HullClient(server.address) as client:
        info, *rest = points_of(client)
        assert info.restored
        assert [replace(info, uid=before[0].uid), *rest, before[-1]] == before
        assert client.apply("points", insert=[[9, 9]], producer="p", sequence=1).duplicate
        assert client.apply("points", insert=[[9, 9]], producer="p", sequence=2).revision == 2
        assert client.verify("points").equal


def test_workers_are_killed_and_have_their_partitions_again(url: str) -> None:
    options = ("--journal", url, "--workers", "2", "--gateways", "1", *QUIET)
    prefixes = "north/", "fleet/"  # of the workers 0 and 1
    with (
        server_process(*options, killed=True, complaints="is started again") as server,
        HullClient(server.address, retries=100) as client,
    ):
        for prefix in prefixes:
            fill(client, prefix)
        before = [state(client, prefix) for prefix in prefixes]
        worker = processes(server.process.pid)["worker-0"]
        os.kill(worker, signal.SIGKILL)
        assert [state(client, prefix) for prefix in prefixes] == before  # the client tries again until it can
        assert processes(server.process.pid)["worker-0"] != worker
        refused = run("serve", "--port", "0", "--journal", url, *QUIET)
        assert "is divided among 2 workers: start the server with --workers 2" in refused.stderr
        server.process.kill()
    with server_process(*options) as server, HullClient(server.address) as client:
        assert [state(client, prefix) for prefix in prefixes] == before


@with_all_cases
@pytest.mark.one_process("a gateway answers for a worker that is away")
def test_a_network_to_the_database_that_swallows_bytes(url: str) -> None:
    given = conninfo_to_dict(url)
    with proxy(f"{given['host']}/.s.PGSQL.5432") as between:
        host, port = between.address.split(":")
        where = f"host={host} port={port} dbname={given['dbname']} user={given['user']} tcp_user_timeout=1000"
        with server_process("--journal", where, *QUIET) as server, HullClient(server.address) as client:
            client.create_hull("a", keyed="str")
            client.put("a", ["first"], [[1, 1]])
            between.silence()
            with client.writer("a", producer="p") as writer:  # repeats what was not committed
                writer.put(keys=["second"], points=[[2, 2]])
            found = client.get_hull("a")
            assert (found.revision, found.info.points) == (2, 2)


@slow
@pytest.mark.one_process("a gateway answers for a worker that is away")
def test_a_database_that_is_away_for_a_while(url: str) -> None:
    given = conninfo_to_dict(url)
    socket = f"{given['host']}/.s.PGSQL.5432"
    with proxy(socket) as between:
        host, port = between.address.split(":")
        options = ("--journal", f"host={host} port={port} dbname={given['dbname']} user={given['user']}", *QUIET)
        with (
            server_process(*options, "--metrics-port", "0") as server,
            grpc.insecure_channel(server.address) as channel,
        ):
            metrics = server.process.stdout.readline().split("//")[1].split("/")[0]
            stub = HullServiceStub(channel)
            stub.CreateHull(pb.CreateHullRequest(name="a"))
            assert apply(stub, 1) == 1
            watch = stub.Watch(pb.WatchRequest(name="a", progress_interval={"nanos": 100_000_000}), timeout=PATIENCE)
            next(watch)
            between.server = ""
            between.cut()
            with pytest.raises(grpc.RpcError) as unwritten:
                stub.Apply(pb.ApplyRequest(name="a", batch=ONE, producer="p", sequence=2))
            assert "the database of the server, PostgreSQL, cannot be used at present" in unwritten.value.details()
            assert "\n" not in unwritten.value.details(), "PostgreSQL's own words are for the log"
            refused = [unwritten.value.code(), apply(stub, 2)]
            assert set(refused) <= {grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.UNKNOWN}, refused
            with pytest.raises(grpc.RpcError) as ended:
                for _ in watch:  # marks, as long as no other server can have the hulls
                    pass
            assert ended.value.code() == grpc.StatusCode.UNAVAILABLE
            assert "the server waits for its database" in ended.value.details()
            with pytest.raises(grpc.RpcError) as unread:
                stub.GetHull(pb.GetHullRequest(name="a"))
            assert unread.value.code() == grpc.StatusCode.UNAVAILABLE
            done = dynhull("query", "a", "vertices", "--address", server.address)
            assert done.exit_code == 3
            assert done.stderr.startswith(f"error: the server at {server.address} answers, but cannot do this now: ")
            assert "dynhull serve" not in done.stderr
            wait_until(lambda: scrape(metrics)['dynhull_background_failures_total{work="lease"}'])
            between.server = socket
            wait_until(lambda: apply(stub, 2) == 2)
            assert apply(stub, 2) == 2
            hull = stub.GetHull(pb.GetHullRequest(name="a")).hull
            assert (hull.revision, hull.point_count) == (2, 2)


def apply(stub: HullServiceStub, sequence: int) -> Any:
    """The revision of a numbered batch, or the code of its refusal."""
    try:
        return stub.Apply(pb.ApplyRequest(name="a", batch=ONE, producer="p", sequence=sequence)).result.revision
    except grpc.RpcError as error:
        return error.code()


REFUSED = {
    "no address": ("postgresql://?what=1", "--journal: no address of a PostgreSQL database: "),
    "no server": ("postgresql://tester@127.0.0.1:1/hulls", "cannot connect to the database hulls on 127.0.0.1:1: "),
    "no rights": ("{url}&user=guarded&password=right", 'have its owner say GRANT CREATE ON DATABASE "test'),
    "no database": ("{url}&dbname=missing", 'database "missing" does not exist'),
    "a wrong password": ("{url}&user=guarded&password=secret", "password authentication failed"),
}


@pytest.mark.parametrize(("address", "words"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_served_is_said_in_a_line(guarded: str, address: str, words: str) -> None:
    journal = ("--journal", address.format(url=guarded))
    refused = run("serve", "--port", "0", *journal, "--start-patience", "0", "--scrub-cpu", "0")
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line.startswith("error: cannot serve: ")
    assert words in line
    assert "secret" not in line


@pytest.fixture(scope="module")
def guarded(postgres: PostgreSQL) -> str:
    """A database whose user `guarded` needs a password."""
    url = postgres.new_database()
    rules = Path(query(url, "SHOW hba_file")[0][0])
    if "guarded" not in rules.read_text():
        rules.write_text("local all guarded scram-sha-256\n" + rules.read_text())
        query(url, "CREATE ROLE guarded LOGIN PASSWORD 'right'")
        query(url, "SELECT pg_reload_conf()")
    return url


def test_commands_for_folders_say_what_to_use_instead(url: str) -> None:
    for command in (["check", url], ["backup", "copy", "--data", url], ["export", "a", "a.csv", "--data", url]):
        refused = dynhull(*command)
        assert refused.exit_code == 2
        assert "copy a database with pg_dump" in refused.stderr
    for options, words in {
        ("--data", url): "--data is a folder: give the address of a database as --journal",
        ("--journal", url, "--data", "x"): "--journal takes the place of the folder",
        ("--journal", url, "--in-memory"): "--in-memory stores nothing, so --journal has no effect",
        ("--journal", "mysql://me:secret@host/hulls"): "--journal: mysql:// is no database that can have hulls: write "
        "postgresql://user@host/database\n",
    }.items():
        refused = dynhull("config", *options)
        assert refused.exit_code == 2
        assert words in refused.stderr


@pytest.mark.parametrize(
    "address", ["postgresql://me:secret@host/hulls", "postgresql:///hulls?user=me&password=secret", "password=secret"]
)
def test_a_password_is_not_shown(address: str) -> None:
    shown = dynhull("config", "--journal", address)
    assert shown.exit_code == 0
    assert "***" in shown.stdout
    assert "secret" not in shown.stdout
