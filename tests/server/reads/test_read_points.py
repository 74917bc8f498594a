"""All points of a hull from a server: `read_points`, and `dynhull export --address`, which writes what a folder has."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from cases import slow
from command_line import dynhull
from proxy import Proxy
from server_process import server_process

from dynhull_client import AsyncHullClient, HullClient, HullNotFoundError, Stored, UnavailableError

MANY = 9_000  # more than one part


def filled(client: HullClient) -> list[str]:
    """Hulls of all kinds, with what their exports have."""
    rng = np.random.default_rng(3)
    points, moments = rng.normal(size=(MANY, 2)), 10**15 + np.arange(MANY)
    times = moments.astype("datetime64[us]")
    client.create_hull("points")
    client.apply("points", insert=np.concatenate([points, points[:5], [[1e308, -5e-324]]]))
    client.create_hull("none")
    client.create_hull("window", max_points=MANY, clock="data")
    client.apply("window", insert=points, times=times[::-1])
    client.create_hull("words", keyed="str")
    client.put("words", [f'"é,{row}' for row in range(MANY)], points)
    client.put("words", ["timed", "a"], points[:2], times=times[:2])
    client.put("words", ["leaves", "a"], points[:2], expire_times=np.array(["2200-01-01"] * 2, "datetime64[us]"))
    client.create_hull("numbers", keyed="int", ordering="event_time")
    client.put("numbers", np.arange(MANY, dtype=np.uint64) + np.uint64(2**63), points, times=times)
    client.create_hull("no-keys", keyed="int")
    client.create_hull("globe", keyed="str", geographic=True)
    client.put("globe", ["w", "e"], [[-190, 10], [185, -10]])
    return ["points", "none", "window", "words", "numbers", "no-keys", "globe"]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path, list[str]]]:
    """The address of a server, its folder, and its hulls."""
    folder = tmp_path_factory.mktemp("served") / "data"
    with server_process("--data", str(folder)) as server, HullClient(server.address) as client:
        yield server.address, folder, filled(client)


@pytest.mark.parametrize("suffix", ["csv", "parquet", pytest.param("geojson", marks=slow)])
def test_a_server_exports_what_its_folder_does(
    served: tuple[str, Path, list[str]], tmp_path: Path, suffix: str
) -> None:
    address, folder, names = served
    for name in names:
        here, there = tmp_path / f"folder.{suffix}", tmp_path / f"server.{suffix}"
        of_folder = dynhull("export", name, here, "--data", folder)
        of_server = dynhull("export", name, there, "--address", address)
        assert (of_folder.exit_code, of_server.exit_code) == (0, 0), (of_folder.stderr, of_server.stderr)
        assert of_server.stdout == of_folder.stdout.replace("folder.", "server.")
        assert rows(there) == rows(here)
        assert sorted(tmp_path.iterdir()) == [here, there]


def rows(file: Path) -> object:
    """What is in a file; the groups of rows of Parquet are those of the parts."""
    if file.suffix != ".parquet":
        return file.read_bytes()
    import pyarrow.parquet as pq

    table = pq.read_table(file)
    return table.schema, table.to_pydict()


def test_a_hull_over_shards_is_exported(served: tuple[str, Path, list[str]], tmp_path: Path) -> None:
    address, _, _ = served
    given = np.random.default_rng(1).integers(0, 9, (300, 2)).astype(float)
    with HullClient(address) as client:
        client.create_hull("divided", shards=3)
        client.apply("divided", insert=given)
    done = dynhull("export", "divided", tmp_path / "points.csv", "--address", address)
    assert done.exit_code == 0, done.stderr
    exported = np.loadtxt(tmp_path / "points.csv", delimiter=",", skiprows=1)
    assert sorted(exported.tolist()) == sorted(given.tolist())


def test_parts_are_of_one_revision(client: HullClient, address: str, hull: str) -> None:
    given = np.random.default_rng(2).normal(size=(MANY, 2))
    client.apply(hull, insert=given)

    def whole(parts: list[Stored]) -> bool:
        read = np.concatenate([part.points for part in parts])
        return len(parts) > 1 and sorted(read.tolist()) == sorted(given.tolist()) and parts[-1].info == parts[0].info

    async def read() -> list[Stored]:
        async with AsyncHullClient(address) as client:
            parts = client.read_points(hull)
            first = await anext(parts)
            await client.apply(hull, insert=[[9, 9]])
            return [first, *[part async for part in parts]]

    assert whole(asyncio.run(read()))
    given = np.concatenate([given, [[9, 9]]])
    parts = client.read_points(hull)
    first = next(parts)
    client.apply(hull, delete=given)
    assert whole([first, *parts])


def test_what_cannot_be_read_says_so(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    with pytest.raises(HullNotFoundError):
        next(client.read_points(name))
    file = tmp_path / "points.csv"
    for words, said in (
        (["--address", address], f"there is no hull '{name}'"),
        (["--address", address, "--data", tmp_path], "give --data or --address, not both"),
        (["--address", "127.0.0.1:1"], "no answer from 127.0.0.1:1"),
    ):
        ended = dynhull("export", name, file, *words)
        assert ended.exit_code != 0
        assert said in ended.stderr
    refused = dynhull("export", name, tmp_path / "points.xls", "--address", address)
    assert "the name must end in .csv" in refused.stderr
    assert not list(tmp_path.iterdir())


class Tearing(Proxy):
    """Ends all connections whenever so many bytes have passed."""

    apart = 400_000

    def __init__(self, server: str) -> None:
        self._left, self._lock = self.apart, threading.Lock()
        super().__init__(server)

    def passed(self, data: bytes) -> bytes:
        with self._lock:
            self._left -= len(data)
            torn = self._left <= 0
            if torn:
                self._left = self.apart
        if torn:
            self.cut()
        return data


def test_a_connection_that_breaks_leaves_the_file_of_yesterday(
    client: HullClient, address: str, hull: str, tmp_path: Path
) -> None:
    client.apply(hull, insert=np.random.default_rng(4).normal(size=(60_000, 2)))  # a megabyte, and 128 KiB a part
    file = tmp_path / "points.csv"
    file.write_text("of yesterday")
    with closing(Tearing(address)) as way:
        torn = dynhull("export", hull, file, "--address", way.address)
        assert torn.exit_code == 3, torn.stdout
    with closing(Tearing(address)) as way, HullClient(way.address) as other, pytest.raises(UnavailableError):
        list(other.read_points(hull))
    assert list(tmp_path.iterdir()) == [file]
    assert file.read_text() == "of yesterday"
