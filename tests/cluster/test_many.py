"""Many hulls through a gateway of several workers: over kills watchers end with what there is, and never go back."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cases import slow, with_all_cases
from cluster import processes
from command_line import dynhull
from one_gateway import entries
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import Server, server_process

from dynhull_client import HullClient, HullCopies, ManyWatch, PermissionDeniedError, UnauthenticatedError

WORKERS = ("--workers", "2", "--gateways", "1")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    with server_process(*WORKERS, "--data", str(tmp_path), complaints="is started again") as server:
        yield server


def follow(watch: ManyWatch, revisions: dict[str, tuple[str, int]], kind: str) -> None:
    """Read up to a change of a kind; no hull goes back."""
    for change in watch:
        if change.kind == "state":
            uid, revision = revisions.get(change.hull, ("", 0))
            assert uid != change.uid or revision <= change.revision
            revisions[change.hull] = change.uid, change.revision
        if change.kind == kind:
            return
    raise AssertionError(f"the watch has ended without {kind}")


def present(client: HullClient) -> dict[str, tuple[str, int, list[list[float]]]]:
    hulls = [client.get_hull(info.name) for info in client.list_hulls()]
    return {hull.info.name: (hull.info.uid, hull.revision, hull.vertices.tolist()) for hull in hulls}


def held(copies: HullCopies) -> dict[str, tuple[str, int, list[list[float]]]]:
    return {name: (copy.uid, copy.revision, copy.vertices.tolist()) for name, copy in copies.items()}


# The supervisor waits up to ten seconds before it starts a process again that ends again and again.
MANY_KILLS = pytest.param(34, marks=[with_all_cases, pytest.mark.timeout(1500)])


@slow
@pytest.mark.parametrize("rounds", [1, MANY_KILLS])
def test_kills(server: Server, rounds: int) -> None:
    """Workers are killed while their hulls change, are deleted and made again, and then the gateway."""
    random = np.random.default_rng(5)
    names = [f"{part}/{number}" for part in ("north", "fleet") for number in range(5)]
    copies, revisions = HullCopies(), dict[str, tuple[str, int]]()
    with HullClient(server.address, retries=20) as client:
        for name in names:
            client.create_hull(name)
        with client.watch_many(copies=copies) as watch:
            follow(watch, revisions, "complete")
            for turn, victim in enumerate(["worker-0", "worker-1", "gateway-0"] * rounds):
                killed = processes(server.process.pid)[victim]
                for name in random.permutation(names)[:6]:
                    client.apply(name, insert=random.normal(size=(3, 2)), producer=f"test-{turn}", sequence=1)
                os.kill(killed, signal.SIGKILL)
                again = names[turn % len(names)]
                wait_until(
                    lambda killed=killed, victim=victim: processes(server.process.pid).get(victim, killed) != killed
                )
                client.delete_hull(again)
                client.create_hull(again)
            while held(copies) != present(client):
                follow(watch, revisions, "position")


@with_all_cases
@pytest.mark.timeout(900)
@pytest.mark.one_process("a cluster has a shape of its own")
def test_moves_between_machines(postgres: PostgreSQL) -> None:
    """Partitions move to and fro while their hulls change, are deleted and made again, and workers are killed."""
    random = np.random.default_rng(6)
    names = [f"{part}/{number}" for part in ("north", "fleet", "depot", "port") for number in range(3)]
    copies, revisions = HullCopies(), dict[str, tuple[str, int]]()
    url = postgres.new_database()
    options = ("--cluster", "--partitions", "2", "--journal", url, "--scrub-cpu", "0", "--log-level", "error")
    with (
        server_process(*options, complaints=None) as server,
        server_process(*options, complaints=None) as other,
        HullClient(server.address, retries=1000) as client,
    ):
        for name in names:
            client.create_hull(name)
        wait_until(lambda: len(query(url, "SELECT worker FROM workers")) == 2)
        with client.watch_many(copies=copies) as watch:
            follow(watch, revisions, "complete")
            for turn in range(60):
                partition = turn % 2
                for name in random.permutation(names)[:6]:
                    client.apply(name, insert=random.normal(size=(3, 2)), producer=f"test-{turn}", sequence=1)
                if turn % 6 == 5:
                    killed = processes((server, other)[turn % 4 // 2].process.pid)["worker-0"]
                    os.kill(killed, signal.SIGKILL)
                target = moved(url, partition)
                wait_until(lambda partition=partition, target=target: owner(url, partition) == target)
                again = names[turn % len(names)]
                client.delete_hull(again)
                client.create_hull(again)
                follow(watch, revisions, "position")
            while held(copies) != present(client):
                follow(watch, revisions, "position")


def owner(url: str, partition: int) -> str | None:
    """The worker that serves a partition."""
    served = "SELECT worker FROM owners WHERE until > '-infinity' AND address <> '' AND partition = "
    return next((worker for (worker,) in query(url, served + str(partition))), None)


def moved(url: str, partition: int) -> str:
    """Have a partition served by another worker; its name."""
    wait_until(lambda: owner(url, partition) is not None and len(query(url, "SELECT worker FROM workers")) > 1)
    target = next(worker for (worker,) in query(url, "SELECT worker FROM workers") if worker != owner(url, partition))
    assert dynhull("cluster", "move", partition, target, "--journal", url).exit_code == 0
    return target


def test_rights_of_prefixes_and_tokens_that_go(tmp_path: Path) -> None:
    """A prefix that is wider than the token is refused, not thinned; the watch ends when the token goes."""
    tokens = tmp_path / "tokens.toml"
    narrow = entries("narrow").replace('[""]', '["fleet/"]')
    tokens.write_text(entries("all") + narrow)
    with (
        server_process(*WORKERS, "--in-memory", "--tokens", str(tokens), "--log-level", "error") as server,
        HullClient(server.address, token="all") as everybody,
        HullClient(server.address, token="narrow") as client,
    ):
        for name in ("fleet/a", "north/b"):
            everybody.create_hull(name)
        with pytest.raises(PermissionDeniedError):
            next(client.watch_many())
        with pytest.raises(PermissionDeniedError):
            next(client.watch_many(names=["fleet/a", "north/b"]))
        with client.watch_many("fleet/") as watch, everybody.watch_many("fleet/") as other:
            assert [next(watch).hull, next(other).hull] == ["fleet/a", "fleet/a"]
            tokens.write_text(entries("all"))
            with pytest.raises((UnauthenticatedError, PermissionDeniedError)):
                list(watch)
            assert {next(other).kind, next(other).kind} == {"complete", "position"}
