"""The page about the past: its programs read segments with pandas, DuckDB and geopandas, bit for bit."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
from blocks import blocks
from patience import wait_until
from server_process import finished, run, server_process

from dynhull_client import HullClient

HULL = "past/fleet"
KEYS = ["AF22", "LH400", "UA17"]
SNAPSHOTS = ("--snapshot-points", "50")


def test_segments_are_read_with_duckdb_and_geopandas(
    take_program: Callable[[str, str], Path], site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = take_program("how-to/past", "moves.py")
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    none = finished([sys.executable, str(program), "empty", "d3739201dc74bc27"])
    assert (none.returncode, none.stderr) == (1, "there is no segment so far: the journal has it all\n")
    put: dict[tuple[str, int], tuple[float, float]] = {}
    rng = np.random.default_rng(5)
    with server_process("--data", "before", *SNAPSHOTS) as server, HullClient(server.address) as client:
        client.create_hull(HULL, keyed="str", history=True)
        decimals = _filed(client, put, lambda: np.round(rng.random((3, 2)) * 90, 7))
    assert run("restore", "before", "--data", "data").returncode == 0
    with server_process("--data", "data", *SNAPSHOTS) as server, HullClient(server.address) as client:
        # Doubles of all their digits are stored as such; the segments after the restore are in a folder of their own.
        last = _filed(client, put, lambda: rng.random((3, 2)) * 90)
        uid = client.get_hull(HULL).info.uid
    assert decimals < last
    assert len(list(Path("data/history").iterdir())) == 2

    done = finished([sys.executable, str(program), "data/history", uid])
    assert done.returncode == 0, done.stderr
    assert all(key in done.stdout for key in KEYS)
    read = geopandas.read_file("moves.gpkg")
    found = {(key, revision): xy for key, revision, *xy in zip(read["key"], read.revision, read.x, read.y, strict=True)}
    assert found == {each: list(xy) for each, xy in put.items() if each[1] <= last}
    assert read.crs == "EPSG:4326"
    assert [(point.x, point.y) for point in read.geometry] == list(zip(read.x, read.y, strict=True))

    (page,) = [
        block.text for block in blocks((site / "how-to/past/index.html").read_text()) if "pq.read_table" in block.text
    ]
    names: dict[str, Any] = {}
    exec(page, names)
    for file in Path("data/history").rglob("*.batches.parquet"):
        frame = names["positions"](file)
        for key, revision, x, y in zip(frame["key"], frame.revision, frame.x, frame.y, strict=True):
            assert put[key, revision] == (x, y)


def _filed(client: HullClient, put: dict[tuple[str, int], tuple[float, float]], positions: Callable[[], Any]) -> int:
    """Write until the past has more than before; returns the last revision that it has."""
    before = client.history(HULL).batches

    def filed() -> bool:
        for _ in range(10):
            points = positions()
            revision = client.put(HULL, KEYS, points).revision
            put.update(((key, revision), (x, y)) for key, (x, y) in zip(KEYS, points.tolist(), strict=True))
        return client.history(HULL).batches > before

    wait_until(filed)
    return client.history(HULL).batches
