"""`dynhull cluster scale`: Ray starts the servers of a cluster, and starts those anew that die."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from cluster import descendants, processes
from forked import COMMAND, Process
from patience import PATIENCE, wait_until
from postgresql import PostgreSQL, query

from dynhull_client import HullClient

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(os.environ.get("RAY_CASES") != "all", reason="with `make ray`: Ray takes many seconds to start"),
]


def servers(launcher: int) -> list[int]:
    """The processes that the actors have started."""
    found = []
    for each in descendants(launcher):
        try:
            words = Path(f"/proc/{each}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"serve" in words and b"--cluster" in words:
            found.append(each)
    return found


def test_servers_are_started_and_started_again_and_end_with_their_ray(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    options = ("--", "--partitions", "4", "--scrub-cpu", "0", "--create-on-write", "--log-level", "error")
    command = [COMMAND, "cluster", "scale", "2", "--journal", url, *options]
    with (
        TemporaryDirectory(prefix="ray", ignore_cleanup_errors=True) as folder,
        Process(
            command,
            stdout=subprocess.PIPE,
            stderr=sys.stderr,
            text=True,
            env={**os.environ, "TMPDIR": folder},
        ) as launcher,
    ):
        try:
            said = [launcher.stdout.readline() for _ in range(2)]
            assert all("dynhull serving on 127.0.0.1:" in each for each in said), said
            served = "SELECT DISTINCT worker FROM owners WHERE until > '-infinity' AND address <> ''"
            wait_until(lambda: len(query(url, served)) == 2)
            with HullClient(said[0].split()[-1], retries=0) as client:
                assert client.apply("a", insert=[[1, 2]], producer="p", sequence=1).revision == 1
            first, before = servers(launcher.pid), set(query(url, served))
            assert len(first) == 2
            os.kill(first[1], signal.SIGKILL)  # its actor ends with it, and Ray makes another
            wait_until(lambda: len(after := servers(launcher.pid)) == 2 and first[1] not in after)
            wait_until(lambda: len(now := set(query(url, served))) == 2 and now != before)
            assert all(processes(each) for each in servers(launcher.pid))
        finally:
            launcher.terminate()
            launcher.wait(PATIENCE)
    wait_until(lambda: not query(url, served))
