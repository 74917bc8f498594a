"""Backup, restore, export and import, as commands beside a running server."""

import subprocess

import numpy as np
import pytest
from server_process import COMMAND, PATIENCE, server_process

from dynhull_client import HullClient
from dynhull_server.storage.sqlite.folder import DATABASE


def run(*command):
    return subprocess.run([COMMAND, *map(str, command)], capture_output=True, text=True, timeout=PATIENCE, check=False)


def sorted_rows(points):
    return points[np.lexsort((points[:, 1], points[:, 0]))]


POINTS = np.concatenate([np.random.default_rng(4).normal(size=(20_000, 2)), [[1e308, -5e-324], [0.1, 0.2], [0.1, 0.2]]])


def test_backup_while_serving_and_restore(tmp_path):
    data, copy, new = (tmp_path / name for name in ("data", "copy", "new"))
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("a/b")
        client.create_hull("empty")
        client.apply("a/b", insert=POINTS)
        done = run("backup", copy, "--data", data)
        assert (done.returncode, done.stdout) == (0, f"{copy}: 2 hulls\n"), done.stderr
        client.apply("a/b", insert=[[7, 7]])
        again = run("backup", copy, "--data", data)
        assert (again.returncode, again.stderr) == (1, f"error: {copy} is there already: name a folder that is not\n")
    done = run("restore", copy, "--data", new)
    assert (done.returncode, done.stdout) == (0, f"{new}: 2 hulls\n"), done.stderr
    assert "is not empty" in run("restore", copy, "--data", new).stderr
    with server_process("--data", str(new)) as server, HullClient(server.address) as client:
        hull = client.get_hull("a/b")
        assert (hull.revision, hull.info.points) == (1, len(POINTS))
        assert client.verify("a/b").equal


def test_a_damaged_backup_is_not_restored(tmp_path):
    data, copy, new = (tmp_path / name for name in ("data", "copy", "new"))
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=POINTS[:100])
        client.apply("a", insert=POINTS[100:200])
        run("backup", copy, "--data", data)
    database = copy / DATABASE
    content = bytearray(database.read_bytes())
    content[content.index(POINTS[50].tobytes())] ^= 1
    database.write_bytes(content)
    done = run("restore", copy, "--data", new)
    assert done.returncode == 1
    assert "revisions 1 to 1 of hull 1 are damaged" in done.stderr
    assert not new.exists()


@pytest.mark.parametrize("suffix", ["csv", "parquet", "geojson"])
def test_export_and_import(tmp_path, suffix):
    data, file = tmp_path / "data", tmp_path / f"points.{suffix}"
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("from")
        client.apply("from", insert=POINTS)
        done = run("export", "from", file, "--data", data)
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"{file}: 20,003 points of from at revision 1\n"
        done = run("import", "to", file, "--address", server.address)
        assert done.returncode == 0, done.stderr
        assert done.stdout == "to: 20,003 points loaded, 20,003 in the hull\n"
        run("export", "to", tmp_path / "again.csv", "--data", data)
    again = np.loadtxt(tmp_path / "again.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(sorted_rows(again), sorted_rows(POINTS))


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["backup", "copy", "--data", "nowhere"], "nowhere holds no hulls"),
        (["export", "h", "points.csv", "--data", "nowhere"], "nowhere holds no hulls"),
        (["export", "h", "points.xls"], "the name must end in .csv, .parquet, .geojson"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(tmp_path, monkeypatch, command, message):
    monkeypatch.chdir(tmp_path)
    done = run(*command)
    assert done.returncode == 1
    assert message in done.stderr
    assert "Traceback" not in done.stderr
