"""Data folders in the states that tests need them in."""

import shutil
from pathlib import Path

import numpy as np

from dynhull_server.state.records import Append, Create, HullRow, Record
from dynhull_server.storage.sqlite.folder import DATABASE
from dynhull_server.storage.sqlite.storage import SQLiteStorage

FORMAT_1 = Path(__file__).parent.parent / "data" / "format1"
LOG = f"{DATABASE}-wal"
NOTHING = np.empty((0, 2))


def no_progress(done, total):
    """Nobody watches."""


def opened(path, *options, **more):
    """A storage, and what it found."""
    storage = SQLiteStorage(path, *options, **more)
    return storage, storage.open(no_progress)


def points(n, seed=0):
    return np.random.default_rng(seed).random((n, 2))


def record(revision, n=3):
    return Record(revision, points(n, revision), NOTHING)


def records(first, last):
    return [record(revision) for revision in range(first, last + 1)]


def same(found, expected):
    assert [each.revision for each in found] == [each.revision for each in expected]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.inserts, other.inserts)


def fill(storage, last, name="fleet", number=1):
    """A hull with a commit for each batch."""
    storage.commit([Create(HullRow(number, name, "0123", 12.5))])
    append(storage, 1, last, number)


def append(storage, first, last, number=1):
    for each in records(first, last):
        storage.commit([Append(number, [each])])


def snapshot(storage, revision, number=1):
    for step in storage.snapshot(number, revision, points(100, -revision % 1000), {}):
        storage.commit([step])


def killed(path, target):
    """A copy of a folder, as the sudden end of its server leaves it."""
    target.mkdir()
    for file in path.glob(f"{DATABASE}*"):
        shutil.copyfile(file, target / file.name)
    return target


def stopped(path, last=9):
    """A folder with one hull and `last` batches."""
    storage, _ = opened(path)
    fill(storage, last)
    storage.close()
    return path


def flip(file, needle, nth=0):
    """Damage a file where it holds some bytes that were written."""
    content = bytearray(file.read_bytes())
    content[content.index(needle) + nth] ^= 0x40
    file.write_bytes(content)
