"""`dynhull move`: every row of a folder is in the database, and every row of a database in the folder."""

import shutil
import sqlite3
from contextlib import closing

import pytest
from command_line import dynhull
from filed_fleet import Fleet
from folders import (
    DATABASE,
    OLD_FOLDERS,
    append,
    fill,
    fill_fence,
    killed,
    no_progress,
    opened,
    record,
    records,
    same,
)
from postgresql import query

from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.state.records import Contents, Kept
from dynhull_server.storage.rows.tables import COLUMNS
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.segments.owner import Claimant
from dynhull_server.storage.worker_folders import divide, worker_folder, write_manifest

LAST = 6  # revision of the hull


@pytest.fixture
def url(postgres):
    return postgres.new_database()


@pytest.fixture
def folder(tmp_path):
    """A folder with a hull that has a snapshot and batches, and a fence."""
    path = tmp_path / "data"
    filled(path)
    return path


def filled(path, name="fleet"):
    storage, _ = opened(path)
    fill(storage, 3, name)
    for step in storage.snapshot(1, Kept(3, Contents(record(1).rows.inserts))):
        storage.commit([step])
    append(storage, 4, LAST)
    if name == "fleet":
        fill_fence(storage, 3)
    storage.close()


def tables(path):
    """All rows of a folder, and its totals but for the copy's number."""
    with closing(sqlite3.connect(path / DATABASE)) as connection:
        read = {table: connection.execute(f"SELECT * FROM {table} ORDER BY 1").fetchall() for table in COLUMNS}
        return read, {row[1:] for row in connection.execute("SELECT * FROM totals")}


def moved(source, target, counts="1 hull, 1 fence,"):
    done = dynhull("move", source, target)
    assert done.exit_code == 0, done.stderr
    assert counts in done.stdout
    return done


def refused(source, target, words, code=2, history=None):
    done = dynhull("move", source, target, *(["--history-dir", history] if history else []))
    assert done.exit_code == code, done.stdout
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_there_and_back(folder, url, postgres, tmp_path):
    before = tables(folder)
    moved(folder, url)
    assert tables(folder) == before
    moved(url, tmp_path / "back")
    assert tables(tmp_path / "back") == before
    storage = PostgresStorage(Database(url), pytest.fail)
    with closing(storage):
        contents = storage.open(no_progress)
        assert contents.notes == []
        assert [row.name for row in (*contents.hulls, *contents.fences)] == ["fleet", "gate"]
        append(storage, LAST + 1, LAST + 1)
        same(storage.read(1).records, records(4, LAST + 1))
        refused(url, tmp_path / "beside", "is served by process")
    refused(folder, url, "has tables of dynhull: create another database")
    refused(url, folder, f"{folder} is not empty")
    storage, _ = opened(folder)
    with closing(storage):
        refused(folder, postgres.new_database(), f"a server uses {folder}: stop it first")


def test_the_folder_of_a_killed_server(folder, url, tmp_path):
    storage, _ = opened(folder)
    with closing(storage):
        append(storage, LAST + 1, LAST + 2)
        crash = killed(folder, tmp_path / "crash")
    moved(crash, url)
    storage = PostgresStorage(Database(url), pytest.fail)
    with closing(storage):
        storage.open(no_progress)
        same(storage.read(1).records, records(4, LAST + 2))


def test_the_parts_of_workers_become_partitions(url, tmp_path):
    folder = tmp_path / "data"
    divide(folder, 2)
    for number in range(2):
        filled(worker_folder(folder, number), f"{number}/hull")
    write_manifest(folder, 2, complete=True)
    moved(folder, url, "2 hulls, 0 fences")
    moved(url, tmp_path / "back", "2 hulls, 0 fences")
    for number in range(2):
        assert tables(worker_folder(tmp_path / "back", number)) == tables(worker_folder(folder, number))
    storage = PostgresStorage(Database(url), pytest.fail, partition=1, partitions=2)
    with closing(storage):
        assert [row.name for row in storage.open(no_progress).hulls] == ["1/hull"]


def test_a_copy_that_fails_leaves_nothing(folder, url, tmp_path):
    with closing(sqlite3.connect(folder / DATABASE)) as connection, connection:
        connection.execute("UPDATE batches SET checksum = checksum + 1 WHERE first = 4")
    refused(folder, url, "restore a backup", code=1)
    assert query(url, "SELECT to_regnamespace('dynhull')") == [(None,)]
    whole = tmp_path / "whole"
    filled(whole)
    moved(whole, url)
    query(url, "UPDATE batches SET checksum = checksum + 1 WHERE first = 4")
    refused(url, tmp_path / "copy", "restore a backup", code=1)
    assert not (tmp_path / "copy").exists()


def test_what_cannot_be_moved_is_said(folder, url, tmp_path):
    refused(folder, tmp_path / "other", "one of FROM and TO must be a folder")
    refused(url, url, "one of FROM and TO must be a folder")
    refused(url, tmp_path / "copy", "has no tables of dynhull")
    refused(tmp_path / "missing", url, f"{tmp_path / 'missing'} is no data folder")
    old = tmp_path / "old"
    shutil.copytree(OLD_FOLDERS / "format6" / "stopped", old)
    refused(old, url, "has format 6: copy it with `dynhull restore")


def test_a_move_that_is_refused_for_the_past_leaves_nothing(url, postgres, tmp_path):
    history, back, other = tmp_path / "past", tmp_path / "back", postgres.new_database()
    fleet = Fleet(tmp_path).fill()
    fleet.storage.close()
    source = shutil.move(tmp_path / "data", tmp_path / "source")
    shutil.move(fleet.archive.path, source / "history")
    assert dynhull("move", source, url, "--history-dir", history).exit_code == 0
    refused(url, back, "of past: say with --history-dir")
    assert not back.exists()
    archive = Archive(history)
    archive.owner = Claimant("0123", "the database url")
    archive.claim()
    before = sorted(history.rglob("*"))
    refused(source, other, "has the past of another database, the database url", history=history)
    assert (sorted(history.rglob("*")), query(other, "SELECT to_regnamespace('dynhull')")) == (before, [(None,)])
    min(history.rglob("*.batches.parquet")).unlink()
    refused(url, back, "of its past cannot be read", code=1, history=history)
    assert not back.exists()


def test_a_move_that_fails_halfway_leaves_no_files_in_the_folder_for_the_past(url, tmp_path):
    """Nor takes any from that of the source, which it is refused to be."""
    history = tmp_path / "past"
    fleet = Fleet(tmp_path).fill()
    fleet.storage.close()
    source = shutil.move(tmp_path / "data", tmp_path / "source")
    shutil.move(fleet.archive.path, source / "history")
    max((source / "history").rglob("*.batches.parquet")).write_bytes(b"something else")
    before = {each: each.read_bytes() for each in (source / "history").rglob("*.parquet")}
    refused(source, url, "of its past cannot be read", code=1, history=history)
    refused(source, url, f"has the past of {source}", history=source / "history")
    assert query(url, "SELECT to_regnamespace('dynhull')") == [(None,)]
    assert list(history.rglob("*.parquet")) == []
    assert {each: each.read_bytes() for each in (source / "history").rglob("*.parquet")} == before
