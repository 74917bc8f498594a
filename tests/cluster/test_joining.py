"""Which machines may join a cluster: those with a right clock that the others can reach."""

import re
import subprocess
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from subprocess import CompletedProcess

import grpc
import pytest
from cases import slow, with_all_cases
from cluster import processes
from command_line import dynhull
from forked import COMMAND
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub
from logged_process import logged_process
from metrics import scrape
from patience import wait_until
from peers import missing, program
from postgresql import PostgreSQL, query
from server_process import finished, server_process
from wall_clock import at

from dynhull_client import HullClient
from dynhull_cluster.machines.board import join
from dynhull_cluster.machines.joining import admit, clock_difference
from dynhull_cluster.placement import worker_of
from dynhull_cluster.postgres import ownership
from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.ownership import Leases
from dynhull_server.storage.port import LockedError

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")

QUIET = ("--scrub-cpu", "0", "--log-level", "error", "--create-on-write")
# With a loopback address of its own, as another machine has it. The database is reached by a file.
APART = 'ip link set lo up && ip address add 10.0.0.7 dev lo && exec "$@"'


def machine(url: str, *options: str) -> Sequence[str]:
    """The options of a server."""
    return ("--cluster", "--partitions", "2", "--journal", url, *QUIET, *options)


def another_machine() -> list[str]:
    """The words before a command that runs it with a network of its own."""
    words = [program("unshare"), "--net", "sh", "-c", APART, "sh"]
    if subprocess.run([*words, "true"], capture_output=True, check=False).returncode:
        missing("right to make a network", "run the tests as root")
    return words


def joined(wrap: Sequence[str], url: str, *options: str) -> CompletedProcess[str]:
    """A server that is expected not to start."""
    return finished([*wrap, COMMAND, "serve", "--port", "0", *machine(url, *options)])


@slow
def test_a_machine_that_others_cannot_reach_or_whose_clock_is_wrong_does_not_join(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    with server_process(*machine(url)) as server, HullClient(server.address) as client:
        revisions = {name: client.apply(name, insert=[[1, 2]]).revision for name in ("a/hull", "b/hull", "c/hull")}
        refused = joined(another_machine(), url)
        assert refused.returncode != 0
        assert "is on another machine, which cannot reach --cluster-host 127.0.0.1" in refused.stderr
        refused = joined(another_machine(), url, "--cluster-host", "10.0.0.7", "--insecure")
        assert refused.returncode != 0
        assert "is on another machine and listens on 127.0.0.1, which this one cannot reach" in refused.stderr
        refused = joined(at("+1h"), url)
        assert refused.returncode != 0
        # Less than an hour by what the database took to answer.
        assert re.search(r"the clock of this machine is 3\d{3}\.\d s ahead of that of the database", refused.stderr)
        refused = finished([*at("+1h"), COMMAND, "serve", "--port", "0", "--journal", postgres.new_database(), *QUIET])
        assert "s ahead of that of the database" in refused.stderr
        refused = joined((), url, "--cluster-host", "192.0.2.7", "--insecure")
        assert refused.returncode != 0
        assert "cannot listen on --cluster-host 192.0.2.7: Cannot assign requested address" in refused.stderr
        owners = query(url, "SELECT DISTINCT worker FROM owners WHERE until > '-infinity'")
        assert len(owners) == 1
        assert {name: client.get_hull(name).revision for name in revisions} == revisions


@with_all_cases
def test_a_clock_that_becomes_wrong_turns_health_and_its_machine_gets_no_more_partitions(
    postgres: PostgreSQL, tmp_path: Path
) -> None:
    url = postgres.new_database()
    clock = tmp_path / "clock"
    clock.write_text("+0")
    follows = [*at("+0"), f"FAKETIME_TIMESTAMP_FILE={clock}", "FAKETIME_NO_CACHE=1"]
    follows.remove("FAKETIME=+0")
    options = ("--port", "0", "--metrics-port", "0", *machine(url), "--log-level", "warning", "--log-format", "json")
    names = {worker_of(f"{first}/hull", 2): f"{first}/hull" for first in "abcdefgh"}
    owners = "SELECT partition FROM owners WHERE process LIKE %s AND until > '-infinity' AND address <> ''"
    with ExitStack() as stack:
        wrong = stack.enter_context(logged_process([*follows, COMMAND, "serve", *options]))
        address = wrong.process.stdout.readline().split()[-1]
        page = wrong.process.stdout.readline().split("//")[1].removesuffix("/metrics\n")
        health = HealthStub(stack.enter_context(grpc.insecure_channel(address)))
        client = stack.enter_context(HullClient(address, retries=1000))

        def has() -> list[int]:
            worker = processes(wrong.process.pid)["worker-0"]
            return [number for (number,) in query(url, owners, f"% {worker} %")]

        def is_well(partition: int) -> bool:
            request = HealthCheckRequest(service=f"dynhull.v1.worker/{partition}")
            return health.Check(request).status == HealthCheckResponse.SERVING

        right = stack.enter_context(server_process(*machine(url), killed=True))
        wait_until(lambda: len(has()) == 1)
        (own,) = has()
        revisions = {name: client.apply(name, insert=[[1, 2]]).revision for name in names.values()}
        assert scrape(page)["dynhull_clock_difference_seconds"] == 0
        clock.write_text("-1h")
        wait_until(lambda: scrape(page)["dynhull_clock_difference_seconds"] < -3000)
        right.process.kill()
        said = "set it, or raise --max-clock-difference"
        assert said in wrong.wait_for("a partition cannot be served")["reason"]
        assert client.apply(names[own], insert=[[1, 3]]).revision == 2
        assert said in wrong.wait_for("unhealthy: health is NOT_SERVING")["reason"]
        wait_until(lambda: not is_well(own))
        assert has() == [own]
        stack.enter_context(server_process(*machine(url)))
        assert {name: client.get_hull(name).revision for name in names.values()} == revisions | {names[own]: 2}
        assert has() == [own]
        clock.write_text("+0")
        wait_until(lambda: is_well(own))


@with_all_cases
def test_a_limit_can_be_raised(postgres: PostgreSQL) -> None:
    options = machine(postgres.new_database(), "--max-clock-difference", "7200")
    with server_process(*options, wrap=at("-1h")) as server, HullClient(server.address) as client:
        assert client.apply("hull", insert=[[1, 2]]).revision == 1


def test_a_server_without_cluster_waits_for_the_end_of_a_lease_that_nobody_renews(
    postgres: PostgreSQL, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ownership, "LEASE", 0.5)
    url = postgres.new_database()
    join(Database(url), 1)
    query(url, "INSERT INTO owners VALUES (0, 1, 'south-1-a', '', '', '2970-01-01')")
    renewed = time.monotonic()
    admit(Database(url), "north-1-a", "", 60, Leases())
    assert time.monotonic() > renewed + 0.5
    with ThreadPoolExecutor() as pool:
        admitted = pool.submit(admit, Database(url), "north-1-b", "", 60, Leases())

        def renews() -> bool:
            query(url, "UPDATE owners SET until = until + interval '1 s'")
            query(url, "UPDATE workers SET seen = '1970-01-01'")  # only the lease speaks against it
            return admitted.done()

        wait_until(renews)
        with pytest.raises(LockedError, match="is served by south-1-a: stop that server first"):
            admitted.result()


def test_a_slow_database_is_no_wrong_clock() -> None:
    assert clock_difference(100, 105, 200) == 0
    assert clock_difference(100, 99, 200) == 1
    assert clock_difference(100, 203, 200) == -3


def test_an_address_that_stands_for_all_is_refused() -> None:
    refused = dynhull("config", "--cluster-host", "0.0.0.0")
    assert refused.exit_code == 2
    assert "--cluster-host 0.0.0.0 is no address for others" in refused.stderr
