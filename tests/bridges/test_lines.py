"""Events of fences in a file and on standard output."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from patience import PATIENCE, wait_until
from relay_process import FAST, acknowledged, fence, pass_through, relay_process

from dynhull_client import HullClient


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        fence(client, name)
        yield client


def sequences(file: Path) -> list[int]:
    return [json.loads(line)["data"]["sequence"] for line in file.read_text().splitlines()]


def test_a_file_has_each_event_once(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    file = tmp_path / "events.ndjson"
    to = (name, "--to", file)
    with relay_process(address, tmp_path, *to, killed=True) as relay:
        pass_through(client, name, ["a", "b"])
        wait_until(lambda: file.exists() and len(sequences(file)) == 4)
        relay.process.kill()
    with file.open("a") as unfinished:
        unfinished.write('{"specversion": "1.0", "id": ')
    pass_through(client, name, ["c"])
    client.delete_consumer(name, "test")  # as if nothing had been acknowledged
    with relay_process(address, tmp_path, *to):
        wait_until(lambda: acknowledged(client, name) == 6)
    assert sequences(file) == [1, 2, 3, 4, 5, 6]


def test_a_file_that_cannot_be_written(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    with relay_process(address, tmp_path, name, "--to", "/dev/full", *FAST) as relay:
        pass_through(client, name, ["a"])
        assert "No space left" in relay.wait_for("not delivered, trying again")["error"]
    assert acknowledged(client, name) == 0


def test_standard_output_until_it_is_closed(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    with relay_process(address, tmp_path, name, "--to", "-") as relay:
        pass_through(client, name, ["a"])
        lines = [json.loads(relay.process.stdout.readline()) for _ in range(2)]
        assert [line["type"] for line in lines] == ["dynhull.fence.enter", "dynhull.fence.exit"]
        wait_until(lambda: acknowledged(client, name) == 2)
        relay.process.stdout.close()
        assert relay.process.wait(PATIENCE) == 0, "without another event"


def test_integer_keys_and_the_snapshot(address: str, name: str, tmp_path: Path) -> None:
    with HullClient(address) as client:
        client.create_hull(name, keyed="int")
        client.put(name, [2**64 - 1], [[1, 1]])
        client.create_fence(name, area=[[0, 0], [4, 0], [4, 4]], subjects=name)
        client.put(name, [7], [[2, 1]])
        with relay_process(address, tmp_path, name, "--to", "-") as relay:
            snapshot, enter = (json.loads(relay.process.stdout.readline()) for _ in range(2))
            wait_until(lambda: acknowledged(client, name) == 2)
    assert snapshot["data"]["inside"] == [{"hull": name, "keys": [2**64 - 1], "revision": 1}]
    assert (enter["subject"], enter["data"]["key"]) == ("7", 7)
