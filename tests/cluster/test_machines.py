"""`dynhull serve --cluster`: servers that share a database serve all of its hulls together, and replace each other."""

import os
import re
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from datetime import UTC, datetime
from pathlib import Path
from struct import pack
from typing import Any

import grpc
import pytest
import trustme
from cases import slow
from cluster import processes
from command_line import dynhull
from forked import COMMAND
from logged_process import logged_process
from patience import PATIENCE, wait_until
from postgresql import PostgreSQL, query
from server_process import Server, server_process

from dynhull_client import Batch, HullClient, HullUnsuitableError, Prefix
from dynhull_cluster.machines.board import join
from dynhull_cluster.placement import worker_of
from dynhull_cluster.postgres.database import Database
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

NAMES = [f"{first}/hull" for first in "abcdefgh"]
QUIET = ("--scrub-cpu", "0", "--log-level", "error", "--create-on-write")


@pytest.fixture
def url(postgres: PostgreSQL) -> str:
    return postgres.new_database()


def machine(url: str, **expected: Any) -> AbstractContextManager[Server]:
    """One of the servers."""
    return server_process("--cluster", "--partitions", "4", "--journal", url, *QUIET, **expected)


def apply_all(client: HullClient, sequence: int) -> list[int]:
    """A numbered batch to each hull; their revisions."""
    points = [[sequence, 1], [1, sequence]]
    return [client.apply(name, insert=points, producer="p", sequence=sequence).revision for name in NAMES]


def served(url: str) -> dict[str, int]:
    """How many partitions each worker serves."""
    rows = query(url, "SELECT worker, count(*) FROM owners WHERE until > '-infinity' AND address <> '' GROUP BY worker")
    return dict(rows)


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_machines_come_and_go_and_callers_notice_only_that_some_calls_take_longer(url: str) -> None:
    with ExitStack() as stack:
        first = stack.enter_context(machine(url))
        client = stack.enter_context(HullClient(first.address, retries=0))
        assert apply_all(client, 1) == [1] * len(NAMES)
        assert sorted(served(url).values()) == [4]
        second = stack.enter_context(machine(url))
        other = stack.enter_context(HullClient(second.address, retries=0))
        assert apply_all(other, 2) == [2] * len(NAMES)
        wait_until(lambda: sorted(served(url).values()) == [2, 2])
        assert apply_all(client, 3) == [3] * len(NAMES)
        assert [info.name for info in other.list_hulls()] == NAMES
        with other.watch(NAMES[0]) as watch:
            assert next(watch).revision == 3
        before = {worker for worker, count in served(url).items() if count}
        first.process.terminate()
        sequence = 4
        while first.process.poll() is None:  # each batch is applied once, though its hull moves
            assert apply_all(other, sequence) == [sequence] * len(NAMES)
            sequence += 1
        assert apply_all(other, sequence) == [sequence] * len(NAMES)
        (left,) = served(url)
        assert left in before
        # Two servers may have the same host name and number, in containers or on copies of a machine.
        assert all(re.fullmatch(rf"{re.escape(socket.gethostname())}-\d+-[0-9a-f]{{4}}/0", each) for each in before)
        assert all(other.verify(name).equal for name in NAMES)


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_reads_of_a_pipeline_wait_while_partitions_move(url: str) -> None:
    with machine(url) as first, machine(url) as second, HullClient(second.address, retries=0) as client:
        assert apply_all(client, 1) == [1] * len(NAMES)
        wait_until(lambda: sorted(served(url).values()) == [2, 2])
        with client.pipeline(batch_reads=4) as pipeline:
            first.process.terminate()
            asked = [pipeline.get_hull(name) for name in NAMES]
            while first.process.poll() is None:
                asked += [pipeline.get_hull(name) for name in NAMES]
                asked[-1].result()
        assert [each.result().info.name for each in asked] == NAMES * (len(asked) // len(NAMES))


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_servers_that_stop_together_leave_nothing_to_each_other(url: str) -> None:
    """Neither waits for the other one to take over, which it would complain about in the end."""
    options = ("--cluster", "--partitions", "4", "--journal", url, "--scrub-cpu", "0")
    with server_process(*options) as first, server_process(*options) as second:
        wait_until(lambda: sorted(served(url).values()) == [2, 2])
        for each in (first, second):
            each.process.terminate()


@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_killed_machine_and_a_stopped_one_are_replaced(url: str) -> None:
    """A machine that was stopped ends when it goes on: it can commit nothing, and its processes are started again."""
    with ExitStack() as stack:
        first = stack.enter_context(machine(url, killed=True, complaints=""))
        second = stack.enter_context(machine(url, complaints="taken over"))
        wait_until(lambda: sorted(served(url).values()) == [2, 2])
        client = stack.enter_context(HullClient(first.address, retries=0))
        assert apply_all(client, 1) == [1] * len(NAMES)
        for name in NAMES:
            client.create_fence(f"{name}-fence", [[0, 0], [9, 0], [0, 9]], Prefix(name[:2]))
        frozen = processes(second.process.pid)["worker-0"]
        os.kill(frozen, signal.SIGSTOP)
        try:
            begun = [stack.enter_context(client.watch(name, reconnect=False)) for name in NAMES]
            alarms = [
                stack.enter_context(client.watch_fence(f"{name}-fence", progress_interval=1, reconnect=False))
                for name in NAMES
            ]
            assert apply_all(client, 2) == [2] * len(NAMES)
            assert len(served(url)) == 1
            assert {next(each).revision for each in begun} <= {1, 2}
            assert {next(each).type for each in alarms} == {"progress"}
        finally:
            os.kill(frozen, signal.SIGCONT)
        wait_until(lambda: sorted(served(url).values()) == [2, 2])  # it was started again, and has its share
        other = stack.enter_context(HullClient(second.address, retries=100))
        first.process.kill()
        assert apply_all(other, 3) == [3] * len(NAMES)
        assert all(other.verify(name).equal for name in NAMES)


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_operators_see_who_serves_what_and_move_it(url: str) -> None:
    with machine(url) as first, machine(url) as second, HullClient(first.address, retries=0) as client:
        wait_until(lambda: sorted(served(url).values()) == [2, 2])
        one, other = sorted(served(url))
        shown = dynhull("cluster", "status", "--journal", url).stdout
        assert shown.startswith("4 partitions\n")
        assert f"{one}  serves  2: " in shown
        assert dynhull("cluster", "move", "0", one, "--journal", url).exit_code == 0
        assert dynhull("cluster", "move", "1", one, "--journal", url).exit_code == 0
        owner = "SELECT DISTINCT worker FROM owners WHERE partition < 2 AND until > '-infinity' AND address <> ''"
        wait_until(lambda: query(url, owner) == [(one,)])
        assert f"partition 0 is to be on {one}" in dynhull("cluster", "status", "--journal", url).stdout
        assert dynhull("cluster", "move", "0", "anywhere", "--journal", url).exit_code == 0
        assert dynhull("cluster", "drain", one, "--journal", url).exit_code == 0
        wait_until(lambda: served(url) == {other: 4})
        assert f"{one}  gives up its partitions  0: -" in dynhull("cluster", "status", "--journal", url).stdout
        assert apply_all(client, 1) == [1] * len(NAMES)
        refused = dynhull("cluster", "drain", "nobody", "--journal", url)
        assert refused.exit_code == 2
        assert f"no worker of the cluster has this name; there are {one}, {other}" in refused.stderr
        refused = dynhull("cluster", "move", "4", one, "--journal", url)
        assert "PARTITION is 4: there are 4, from 0 to 3" in refused.stderr
        assert second.process.poll() is None


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_worker_that_gave_up_its_partitions_takes_some_when_it_is_started_again(url: str) -> None:
    """It was the last one: nobody else would ever serve them."""
    with machine(url, complaints=None) as server, HullClient(server.address, retries=1000) as client:
        (worker,) = served(url)
        assert "no worker takes" not in dynhull("cluster", "status", "--journal", url).stdout
        assert dynhull("cluster", "drain", worker, "--journal", url).exit_code == 0
        assert "no worker takes partitions, because all" in dynhull("cluster", "status", "--journal", url).stdout
        assert apply_all(client, 1) == [1] * len(NAMES)
        drained = processes(server.process.pid)["worker-0"]
        os.kill(drained, signal.SIGKILL)
        there = "SELECT process FROM owners WHERE until > '-infinity' AND address <> ''"
        wait_until(lambda: not any(f" {drained} " in process for (process,) in query(url, there)) and served(url))
        assert apply_all(client, 2) == [2] * len(NAMES)


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_worker_that_is_slower_than_another_one_has_not_failed(url: str) -> None:
    join(Database(url), 1)
    query(
        url,
        """
        CREATE FUNCTION be_faster() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
            INSERT INTO owners VALUES (NEW.partition, 1, 'another/0', '', '', clock_timestamp() + interval '5 s');
            RETURN NULL;
        END $$;
        CREATE TRIGGER faster BEFORE INSERT ON owners FOR EACH ROW
            WHEN (NEW.worker <> 'another/0') EXECUTE FUNCTION be_faster()
        """,
    )

    def gives_way() -> bool:
        query(url, "UPDATE owners SET until = until + interval '1 s'")
        return bool(server.said("another worker has taken a partition"))

    with logged_process(
        [COMMAND, "serve", "--port", "0", "--cluster", "--journal", url, "--log-format", "json"]
    ) as server:
        wait_until(gives_way)
        query(url, "UPDATE owners SET until = '-infinity'")
        server.wait_for("a partition is served")
        assert not server.said("a partition cannot be served")


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_cluster_beside_a_server_of_one_process_says_that_it_waits_for_its_end(url: str) -> None:
    options = ("--journal", url, *QUIET)
    beside = ("--cluster", *options, "--log-level", "warning", "--log-format", "json")
    with server_process(*options) as first, HullClient(first.address) as client:
        assert client.apply("hull", insert=[[1, 1]]).points == 1
        with logged_process([COMMAND, "serve", "--port", "0", *beside]) as second:
            said = second.wait_for("nothing to serve: a server without --cluster has it, until that is stopped")
            assert said["served_by"].startswith(f"{socket.gethostname()}-{first.process.pid}-")
            shown = dynhull("cluster", "status", "--journal", url).stdout
            assert f"{said['served_by']}  serves, without --cluster  1: 0\n" in shown
            query(url, "UPDATE owners SET until = '-infinity'")  # until the first one renews it
            query(url, "NOTIFY dynhull")
            wait_until(lambda: query(url, "SELECT worker FROM owners WHERE until > '-infinity'"))
            assert query(url, "SELECT worker, epoch FROM owners") == [(said["served_by"], 1)]
            first.process.terminate()
            with HullClient(second.process.stdout.readline().split()[-1], retries=100) as other:
                assert other.apply("hull", insert=[[2, 2]]).points == 2
            assert second.log() == [said]


@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_worker_for_which_no_partition_is_left_says_so(url: str) -> None:
    options = ("--cluster", "--partitions", "1", "--workers", "2", "--journal", url, "--scrub-cpu", "0")
    with server_process(*options, complaints="to divide it among several, run `dynhull cluster split N`"):
        assert sorted(served(url).values()) == [1]
        assert "run `dynhull cluster split N`" in dynhull("cluster", "status", "--journal", url).stdout


@pytest.fixture(scope="module")
def alone(postgres: PostgreSQL) -> Iterator[tuple[str, str]]:
    """The address of a cluster of one machine, and its database."""
    url = postgres.new_database()
    with machine(url) as server:
        yield server.address, url


@pytest.mark.one_process("a cluster has a shape of its own")
def test_names_apart_are_refused_wherever_they_are(alone: tuple[str, str]) -> None:
    """By their partitions, not by who serves them: otherwise a request would succeed today and fail tomorrow."""
    address, url = alone
    with HullClient(address) as client:
        apply_all(client, 1)
        assert len(served(url)) == 1
        apart = next(name for name in NAMES if worker_of(name, 4) != worker_of(NAMES[0], 4))
        with pytest.raises(HullUnsuitableError) as refused:
            client.transfer({NAMES[0]: Batch(insert=[[5, 5]]), apart: Batch(delete=[[1, 1]])})
        assert refused.value.reason == "HULLS_APART"


@pytest.mark.one_process("a cluster has a shape of its own")
def test_only_gateways_may_call_workers(alone: tuple[str, str]) -> None:
    worker, address = query(alone[1], "SELECT worker, address FROM owners WHERE partition = 0")[0]
    host, port, frames = address.split()
    ((secret,),) = query(alone[1], "SELECT secret FROM cluster")
    wrong = "0/guess", f"0/{secret}", f"0/{worker}/guess", f"1/{worker}/{secret}", f"0/another/{secret}"
    said = (("dynhull-owner", "me"), ("dynhull-token-hash", "gateway"))
    with grpc.insecure_channel(f"{host}:{port}") as channel:
        for proof in ((), *((("dynhull-gateway-proof", each),) for each in wrong)):
            with pytest.raises(grpc.RpcError) as refused:
                HullServiceStub(channel).ListHulls(pb.ListHullsRequest(), metadata=said + proof, timeout=PATIENCE)
            assert refused.value.code() == grpc.StatusCode.UNAVAILABLE
            assert "this worker does not own the partition" in refused.value.details()
    for greeting in (each.encode() for each in wrong):
        with socket.create_connection((host, int(frames))) as connection:
            connection.sendall(pack("<IIB", len(greeting), 0, 4) + greeting)
            assert connection.recv(1) == b"", "the connection is closed"


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture
def certified(tmp_path: Path, authority: trustme.CA) -> Callable[..., tuple[str, ...]]:
    """The options of a server, with a certificate for these names."""

    def issue(*names: str, by: trustme.CA = authority, until: datetime | None = None) -> tuple[str, ...]:
        issued = by.issue_cert(*names, not_after=until)
        issued.private_key_and_cert_chain_pem.write_to_path(tmp_path / "cert.pem")
        authority.cert_pem.write_to_path(tmp_path / "ca.pem")
        cert = str(tmp_path / "cert.pem")
        return ("--tls-cert", cert, "--tls-key", cert, "--cluster-ca", str(tmp_path / "ca.pem"))

    return issue


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_servers_of_a_cluster_connect_with_tls(
    url: str, authority: trustme.CA, certified: Callable[..., tuple[str, ...]]
) -> None:
    options = ("--cluster", "--partitions", "4", "--journal", url, *QUIET, *certified("127.0.0.1"))
    root = grpc.ssl_channel_credentials(authority.cert_pem.bytes())
    with server_process(*options) as first, server_process(*options) as second:
        wait_until(lambda: sorted(served(url).values()) == [2, 2])
        for server in (first, second):
            with HullClient(server.address, tls=root) as client:
                assert {client.apply(name, insert=[[0, 0]]).points for name in NAMES} == {1 + (server is second)}


OTHERS = trustme.CA()
UNBELIEVED: dict[str, tuple[str, dict[str, Any], str]] = {
    "another name": ("127.0.0.2", {}, "IP address mismatch, certificate is not valid for '127.0.0.1'"),
    "expired": ("127.0.0.1", {"until": datetime(2020, 1, 1, tzinfo=UTC)}, "certificate has expired"),
    "of somebody": ("127.0.0.1", {"by": OTHERS}, "unable to get local issuer certificate"),
}


@pytest.mark.parametrize(("name", "given", "words"), UNBELIEVED.values(), ids=UNBELIEVED)
def test_a_server_that_the_others_would_not_believe_does_not_start(
    certified: Callable[..., tuple[str, ...]], name: str, given: dict[str, Any], words: str
) -> None:
    """They could not reach the partitions that it takes, and only its own callers would know."""
    refused = dynhull("serve", "--cluster", "--journal", "postgresql://x/y", *certified(name, **given))
    assert refused.exit_code == 2
    assert "would not accept it at --cluster-host 127.0.0.1: " + words in refused.stderr


REFUSED = {
    "without a database": (("--cluster",), "--cluster needs --journal: the servers share a database"),
    "for other machines without TLS": (
        ("--cluster", "--journal", "postgresql://x/y", "--cluster-host", "10.0.0.1"),
        "--cluster-host 10.0.0.1 can be reached by other machines: give --cluster-ca, or --insecure",
    ),
    "with a certificate of nobody": (
        ("--cluster", "--journal", "postgresql://x/y", "--cluster-ca", "ca.pem"),
        "--cluster-ca needs --tls-cert and --tls-key",
    ),
}


@pytest.mark.parametrize(("options", "words"), REFUSED.values(), ids=REFUSED)
def test_what_makes_no_cluster_is_refused(options: tuple[str, ...], words: str) -> None:
    refused = dynhull("config", *options)
    assert refused.exit_code == 2
    assert words in refused.stderr
