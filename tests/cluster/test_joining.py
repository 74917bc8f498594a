"""Which machines may join a cluster: those with a right clock that the others can reach."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from cases import with_all_cases
from command_line import dynhull
from forked import COMMAND
from metrics import scrape
from patience import wait_until
from peers import missing, program
from postgresql import PostgreSQL, query
from server_process import finished, server_process
from wall_clock import at

from dynhull_client import HullClient
from dynhull_cluster.machines.joining import clock_difference

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
        assert "the clock of this machine is 3600.0 s ahead of that of the database" in refused.stderr
        refused = joined((), url, "--cluster-host", "192.0.2.7", "--insecure")
        assert refused.returncode != 0
        assert "cannot listen on --cluster-host 192.0.2.7: Cannot assign requested address" in refused.stderr
        owners = query(url, "SELECT DISTINCT worker FROM owners WHERE until > '-infinity'")
        assert len(owners) == 1
        assert {name: client.get_hull(name).revision for name in revisions} == revisions


@with_all_cases
def test_a_clock_that_becomes_wrong_is_said(postgres: PostgreSQL, tmp_path: Path) -> None:
    url = postgres.new_database()
    clock = tmp_path / "clock"
    clock.write_text("+0")
    follows = [*at("+0"), f"FAKETIME_TIMESTAMP_FILE={clock}", "FAKETIME_NO_CACHE=1"]
    follows.remove("FAKETIME=+0")
    options = ("--metrics-port", "0", *machine(url), "--log-level", "warning")
    said = "set it, or raise --max-clock-difference' work='clock of the machine'"
    with (
        server_process(*options, wrap=follows, complaints=said) as server,
        HullClient(server.address) as client,
    ):
        page = server.process.stdout.readline().split("//")[1].removesuffix("/metrics\n")
        client.apply("a/hull", insert=[[1, 2]])
        assert scrape(page)["dynhull_clock_difference_seconds"] == 0
        clock.write_text("-1h")
        wait_until(lambda: scrape(page)["dynhull_clock_difference_seconds"] < -3000)
        assert client.apply("a/hull", insert=[[1, 3]]).revision == 2


@with_all_cases
def test_a_limit_can_be_raised(postgres: PostgreSQL) -> None:
    options = machine(postgres.new_database(), "--max-clock-difference", "7200")
    with server_process(*options, wrap=at("-1h")) as server, HullClient(server.address) as client:
        assert client.apply("hull", insert=[[1, 2]]).revision == 1


def test_a_slow_database_is_no_wrong_clock() -> None:
    assert clock_difference(100, 105, 200) == 0
    assert clock_difference(100, 99, 200) == 1
    assert clock_difference(100, 203, 200) == -3


def test_an_address_that_stands_for_all_is_refused() -> None:
    refused = dynhull("config", "--cluster-host", "0.0.0.0")
    assert refused.exit_code == 2
    assert "--cluster-host 0.0.0.0 is no address for others" in refused.stderr
