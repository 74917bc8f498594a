"""Whether an owner has ended: only what is known counts, and a process that cannot be seen or asked about is alive."""

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from blind import blind, may_blind
from cases import slow
from forked import COMMAND
from peers import missing
from postgresql import PostgreSQL
from server_process import finished, server_process

from dynhull_client import HullClient
from dynhull_cluster.postgres.processes import is_known_dead, this_process

QUIET = ("--scrub-cpu", "0", "--log-level", "error")
IDENTIFIED = "from dynhull_cluster.postgres.processes import this_process; print(this_process(), flush=True); input()"


@pytest.fixture
def other_user() -> list[str]:
    """The words before a command that another user runs, who sees no processes of others."""
    if not may_blind():
        missing("right to mount another /proc", "run the tests as root")
    return blind()


@slow
@pytest.mark.one_process("its owner is the process that the test starts")
def test_an_owner_whose_process_is_hidden_keeps_its_database(postgres: PostgreSQL, other_user: list[str]) -> None:
    options = ("--journal", postgres.new_database(), *QUIET)
    with server_process(*options) as server, HullClient(server.address) as client:
        client.create_hull("hull")
        other = finished([*other_user, COMMAND, "serve", "--port", "0", *options])
        assert other.returncode != 0
        assert f"is served by {socket.gethostname()}-{server.process.pid}-" in other.stderr
        assert client.apply("hull", insert=[[1, 2]]).revision == 1


class Process:
    """A process that has said who it is."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", IDENTIFIED], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.identity = self.process.stdout.readline().strip()

    def end(self, *, reap: bool = True) -> None:
        """Kill it; without `reap`, its number stays in use."""
        self.process.kill()
        if reap:
            self.process.wait()
        else:
            os.waitid(os.P_PID, self.process.pid, os.WEXITED | os.WNOWAIT)


@pytest.fixture
def other() -> Iterator[Process]:
    started = Process()
    with started.process:
        yield started
        started.process.kill()


@pytest.fixture
def hiding(tmp_path: Path) -> Path:
    """A /proc with this process alone."""
    for file in ("sys/kernel/random/boot_id", f"{os.getpid()}/stat"):
        (tmp_path / file).parent.mkdir(parents=True)
        shutil.copyfile(f"/proc/{file}", tmp_path / file)
    (tmp_path / f"{os.getpid()}/ns").mkdir()
    for each in ("pid", "net"):
        (tmp_path / f"{os.getpid()}/ns/{each}").symlink_to(Path(f"/proc/self/ns/{each}").readlink())
    (tmp_path / "self").symlink_to(str(os.getpid()))
    return tmp_path


def test_a_process_that_runs_is_not_dead_and_one_that_has_ended_is(other: Process) -> None:
    assert not is_known_dead(other.identity)
    other.end(reap=False)
    assert is_known_dead(other.identity)
    other.end()
    assert is_known_dead(other.identity)


def test_a_process_that_is_hidden_is_alive_until_its_number_is_free(other: Process, hiding: Path) -> None:
    assert this_process(hiding) == this_process()
    assert not is_known_dead(other.identity, hiding)
    other.end(reap=False)
    assert not is_known_dead(other.identity, hiding)
    other.end()
    assert is_known_dead(other.identity, hiding)


def test_a_number_that_is_used_again_is_another_process(other: Process, hiding: Path) -> None:
    boot, namespace, number, begun, network = other.identity.split()
    before = f"{boot} {namespace} {number} {int(begun) - 1} {network}"
    assert is_known_dead(before)
    assert not is_known_dead(before, hiding)


def test_processes_of_another_machine_or_namespace_are_alive(other: Process) -> None:
    boot, namespace, *rest = other.identity.split()
    other.end()
    for process in ("", f"another {namespace} {' '.join(rest)}", f"{boot} pid:[1] {' '.join(rest)}"):
        assert not is_known_dead(process)


def test_the_files_of_another_namespace_say_nothing(other: Process, hiding: Path) -> None:
    """As where /proc was mounted before the namespace was made."""
    (hiding / "1").mkdir()
    (hiding / "self").unlink()
    (hiding / "self").symlink_to("1")
    shutil.copytree(hiding / str(os.getpid()) / "ns", hiding / "1" / "ns", symlinks=True)
    shutil.copyfile("/proc/1/stat", hiding / "1" / "stat")
    (hiding / str(other.process.pid)).mkdir()
    shutil.copyfile("/proc/1/stat", hiding / str(other.process.pid) / "stat")
    assert not is_known_dead(other.identity, hiding)
    other.end()
    assert is_known_dead(other.identity, hiding)
