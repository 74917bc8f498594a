"""`dynhull cluster scale`: Ray starts the servers of a cluster, and starts those anew that die."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from tempfile import TemporaryDirectory

import pytest
from cluster import processes
from forked import COMMAND, Process
from patience import PATIENCE, wait_until
from postgresql import PostgreSQL, query
from proxy import Proxy
from ray_nodes import ENVIRONMENT, nodes_of_ray, servers
from steady_writer import SteadyWriter

from dynhull_client import HullClient

SERVED = "SELECT DISTINCT worker FROM owners WHERE until > '-infinity' AND address <> ''"
HULLS = [f"{first}/hull" for first in "abcdefgh"]  # in all of four partitions

pytestmark = [pytest.mark.long, pytest.mark.only_with("RAY_CASES")]  # Ray takes many seconds to start


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
            wait_until(lambda: len(query(url, SERVED)) == 2)
            with HullClient(said[0].split()[-1], retries=0) as client:
                assert client.apply("a", insert=[[1, 2]], producer="p", sequence=1).revision == 1
            first, before = servers(launcher.pid), set(query(url, SERVED))
            assert len(first) == 2
            os.kill(first[1], signal.SIGKILL)  # its actor ends with it, and Ray makes another
            wait_until(lambda: len(after := servers(launcher.pid)) == 2 and first[1] not in after)
            wait_until(lambda: len(now := set(query(url, SERVED))) == 2 and now != before)
            assert all(processes(each) for each in servers(launcher.pid))
        finally:
            launcher.terminate()
            launcher.wait(PATIENCE)
    wait_until(lambda: not query(url, SERVED))


def scale(count: int, url: str, address: str) -> list[str]:
    """The addresses of the servers."""
    options = ("--", "--partitions", "4", "--scrub-cpu", "0", "--create-on-write", "--log-level", "error", "--insecure")
    command = [COMMAND, "cluster", "scale", str(count), "--journal", url, *options]
    environment = {**os.environ, **ENVIRONMENT, "RAY_ADDRESS": address}
    said = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert said.returncode == 0, said.stderr
    addresses = [line.split()[-1] for line in said.stdout.splitlines() if "serving on" in line]
    assert len(addresses) == count, said.stdout
    return addresses


@pytest.mark.timeout(900)  # Ray takes long to notice what is gone
def test_nodes_and_the_gcs_of_ray_are_killed_and_nothing_is_lost(postgres: PostgreSQL) -> None:
    url = postgres.new_database()
    with ExitStack() as stack:
        first = stack.enter_context(nodes_of_ray(3))
        addresses = scale(2, url, first[0].address)
        wait_until(lambda: len(query(url, SERVED)) == 2)
        proxy = Proxy(addresses[0])
        stack.callback(proxy.close)
        writers = [SteadyWriter(proxy.address, name) for name in HULLS]
        for each in writers:
            each.start()

        def all_write() -> None:
            for each in writers:
                each.more()

        # A node is gone, and with it an actor and its server: Ray starts another one on the node that is left.
        all_write()
        before = {process for each in first for process in each.servers()}
        next(each for each in first if each.servers()).kill("raylet")
        wait_until(lambda: len([each for each in addresses if answers(each)]) == 1)
        (proxy.server,) = [each for each in addresses if answers(each)]
        all_write()
        wait_until(lambda: len(new := {each for node in first for each in node.servers()}) == 2 and new != before)
        wait_until(lambda: len(query(url, SERVED)) == 2)
        all_write()
        # Ray is gone: servers go on, until their nodes notice that. Another Ray starts others.
        second = stack.enter_context(nodes_of_ray(1))
        first[0].kill("gcs_server")
        for _ in range(3):
            all_write()
        wait_until(lambda: not any(each.servers() for each in first))
        (proxy.server,) = scale(1, url, second[0].address)
        all_write()
        for each in writers:
            each.stop()
            each.check(proxy.address)


def answers(address: str) -> bool:
    """Whether somebody listens there."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port))).close()
    except ConnectionRefusedError:
        return False
    return True
