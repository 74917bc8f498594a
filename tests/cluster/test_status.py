"""What operators see of servers that serve, have been stopped, or have ended: on one machine, too."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from cases import with_all_cases
from cluster import processes
from command_line import dynhull
from metrics import measured, samples
from patience import wait_until
from postgresql import PostgreSQL, query
from proxy import proxy
from psycopg.conninfo import conninfo_to_dict
from server_process import server_process

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")

QUIET = ("--scrub-cpu", "0", "--log-level", "error")


def shown(url: str) -> list[str]:
    """The lines of `dynhull cluster status`."""
    done = dynhull("cluster", "status", "--journal", url)
    assert done.exit_code == 0, done.stderr
    return done.stdout.splitlines()


@contextmanager
def stopped(process: int) -> Iterator[None]:
    os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(process, signal.SIGCONT)


def test_a_single_server_is_shown_as_what_it_is(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    with server_process("--journal", url, *QUIET, killed=True) as server:
        ((name,),) = query(url, "SELECT worker FROM owners")
        assert name.startswith(f"{socket.gethostname()}-{server.process.pid}-")
        assert shown(url) == ["1 partition", f"{name}  serves, without --cluster  1: 0"]
        refused = dynhull("cluster", "move", "0", "another", "--journal", url)
        assert f"no worker of the cluster has this name; there are {name}" in refused.stderr
        with stopped(server.process.pid):
            query(url, "UPDATE owners SET until = clock_timestamp()")  # five seconds pass
            lost = f"{name}  is stopped or cut off: it does not renew its lease  1: 0"
            assert shown(url) == ["1 partition", lost, "nobody serves 0"]
        wait_until(lambda: shown(url) == ["1 partition", f"{name}  serves, without --cluster  1: 0"])
        server.process.kill()
        server.process.wait()
        wait_until(lambda: shown(url) == ["1 partition", f"{name}  has ended  1: 0", "nobody serves 0"])
    with server_process("--journal", url, *QUIET):
        ((other,),) = query(url, "SELECT worker FROM owners")
        assert f"{other}  serves, without --cluster  1: 0" in shown(url)  # perhaps beside the one that was killed
    assert shown(url)[-1] == "nobody serves 0"
    assert not any(line.startswith(other) for line in shown(url))


@with_all_cases
def test_the_metrics_of_a_worker_that_was_stopped_say_so(postgres: PostgreSQL) -> None:
    given = conninfo_to_dict(postgres.new_database())
    with proxy(f"{given['host']}/.s.PGSQL.5432") as between:
        host, port = between.address.split(":")
        where = f"host={host} port={port} dbname={given['dbname']} user={given['user']}"
        with measured("--cluster", "--partitions", "2", "--journal", where, *QUIET) as (server, page):
            serving, partitions = (
                f'dynhull_{each}{{process="worker-0"}}' for each in ("process_serving", "partitions")
            )
            found = samples(page)
            assert (found[serving], found[partitions]) == (1, 2)
            with stopped(processes(server.process.pid)["worker-0"]):
                found = samples(page)
                assert (found[serving], partitions in found) == (0, False)
            wait_until(lambda: samples(page).get(partitions) == 2)
            path, between.server = between.server, ""
            between.cut()
            wait_until(lambda: samples(page)[partitions] == 0)
            assert samples(page)[serving] == 1
            between.server = path
            wait_until(lambda: samples(page)[partitions] == 2)
