"""A relay of a server whose disk, a file system of its own, is full: it goes on when there is room."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cases import slow
from patience import wait_until
from receiver import Receiver
from relay_process import FAST, acknowledged, fence, pass_through, relay_process
from server_process import Server, server_process

from dynhull_client import HullClient, LimitExceededError

SMALL_DISK = 'mount -t tmpfs -o size=4m none "$0" && exec "$@"'
PLAIN = ("--unsigned", "--allow-private", *FAST)


@contextmanager
def on_a_small_disk(folder: Path) -> Iterator[tuple[Server, HullClient, Path]]:
    """A server with events of a fence, and a file of that disk that may fill it."""
    folder.mkdir()
    wrap = ["unshare", "--map-root-user", "--mount", "sh", "-c", SMALL_DISK, str(folder)]
    with (
        server_process("--data", str(folder / "data"), wrap=wrap, complaints=None) as server,
        HullClient(server.address) as client,
    ):
        fence(client, "yard")
        client.create_hull("filler")
        yield server, client, Path(f"/proc/{server.process.pid}/root{folder}/ballast")


def fill(client: HullClient, ballast: Path) -> None:
    """Fill the disk, until the server can commit nothing more: its files may have room of their own."""
    with ballast.open("wb") as file:
        file.write(bytes(os.statvfs(ballast).f_bavail * os.statvfs(ballast).f_frsize))
    for points in (1000, 1):
        wait_until(lambda points=points: refuses(client, points))


def refuses(client: HullClient, points: int) -> bool:
    try:
        client.apply("filler", insert=[[row, row] for row in range(points)])
    except LimitExceededError as error:
        return error.reason == "DISK_FULL"
    return False


@slow
def test_a_disk_that_is_full_when_the_relay_starts(tmp_path: Path, endpoint: Receiver) -> None:
    with on_a_small_disk(tmp_path / "small") as (server, client, ballast):
        fill(client, ballast)
        with relay_process(server.address, tmp_path, "yard", "--to", endpoint.url, *PLAIN) as relay:
            assert "the disk is full" in relay.wait_for("no events from the server, trying again")["error"]
            ballast.unlink()
            wait_until(lambda: client.get_fence("yard").consumers)
            pass_through(client, "yard", ["truck"])
            wait_until(lambda: acknowledged(client, "yard") == 2)
    assert delivered(endpoint) == [1, 2]


@slow
def test_a_disk_that_becomes_full_while_the_relay_delivers(tmp_path: Path, endpoint: Receiver) -> None:
    with (
        on_a_small_disk(tmp_path / "small") as (server, client, ballast),
        relay_process(server.address, tmp_path, "yard", "--to", endpoint.url, *PLAIN) as relay,
    ):
        wait_until(lambda: client.get_fence("yard").consumers)
        endpoint.answer = lambda _: (503, {})
        pass_through(client, "yard", ["first", "second"])
        relay.wait_for("not delivered, trying again")
        fill(client, ballast)
        endpoint.answer = lambda _: (200, {})
        assert "the disk is full" in relay.wait_for("not acknowledged, trying again")["error"]
        wait_until(lambda: delivered(endpoint) == [1, 2, 3, 4])
        assert acknowledged(client, "yard") == 0
        ballast.unlink()
        wait_until(lambda: acknowledged(client, "yard") == 4)
        pass_through(client, "yard", ["third"])
        wait_until(lambda: acknowledged(client, "yard") == 6)
    assert delivered(endpoint) == [1, 2, 3, 4, 5, 6]


def delivered(endpoint: Receiver) -> list[int]:
    """The sequences in the order of their first delivery."""
    return list(dict.fromkeys(event["data"]["sequence"] for event in endpoint.events("yard")))
