"""The page about feeds: its follower, killed and started again beside the writes, has the positions of the hull."""

import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial
from pathlib import Path

import pytest
from patience import wait_until
from server_process import server_process

from dynhull_client import HullClient

DEFAULT_ADDRESS = "127.0.0.1:50051"
HULL = "feed/vans"


def test_the_follower_has_a_copy(
    take_program: Callable[[str, str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = take_program("how-to/feed", "follower.py")
    monkeypatch.chdir(tmp_path)

    with server_process("--data", str(tmp_path / "data")) as server, HullClient(server.address) as client:
        program.write_text(program.read_text().replace(DEFAULT_ADDRESS, server.address))
        client.create_hull(HULL, keyed="str")
        for key in ("UA17", "AF22"):
            client.put(HULL, ["LH400", "gone"], [(0, 0), (1, 0)])
            with subprocess.Popen([sys.executable, program]) as follower:
                client.remove(HULL, ["gone"])
                client.put(HULL, [key], [(0, 7)])
                wait_until(partial(_has, key))
                follower.kill()
        stored = client.entities(HULL)
        assert _copied() == dict(zip(stored.keys, map(tuple, stored.points.tolist()), strict=True))


def _has(key: str) -> bool:
    return Path("copy.db").exists() and key in _copied()


def _copied() -> dict[str, tuple[float, float]]:
    with closing(sqlite3.connect("copy.db")) as db, suppress(sqlite3.OperationalError):  # there is no table so far
        return {key: (x, y) for key, x, y in db.execute("SELECT key, x, y FROM position")}
    return {}
