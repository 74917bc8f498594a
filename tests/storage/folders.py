"""Data folders in the states that tests need them in."""

import dataclasses
import shutil
from pathlib import Path

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_server.state.contents.joining import in_one
from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.model.config import FenceConfig, PolygonArea
from dynhull_server.state.fences.model.records import (
    AddFence,
    Cause,
    Consumer,
    Delay,
    EventType,
    FenceEvent,
    FenceRow,
    Inside,
    Members,
    PutConsumer,
    PutDelays,
)
from dynhull_server.state.records import Append, Contents, Create, HullRow, Kept, PointRows, Record
from dynhull_server.storage.sqlite.folder import DATABASE
from dynhull_server.storage.sqlite.storage import SQLiteStorage

OLD_FOLDERS = Path(__file__).parent.parent / "data"
LOG = f"{DATABASE}-wal"
NOTHING = np.empty((0, 2))


def no_progress(done, total):
    """Ignore the progress."""


def opened(path, *options, **more):
    """A storage, and what it found."""
    storage = SQLiteStorage(path, *options, **more)
    return storage, storage.open(no_progress)


def points(n, seed=0):
    return np.random.default_rng(seed).random((n, 2))


def record(revision, n=3):
    return Record(revision, PointRows(points(n, revision), NOTHING))


def records(first, last):
    return [record(revision) for revision in range(first, last + 1)]


def same(found, expected):
    """Assert that values are equal, field by field and row by row; of commits, only those that are expected."""
    if isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)
    elif dataclasses.is_dataclass(expected):
        assert type(found) is type(expected)
        for field in dataclasses.fields(expected):
            if not field.compare and getattr(expected, field.name) is None:
                continue
            same(getattr(found, field.name), getattr(expected, field.name))
    elif isinstance(expected, list | tuple):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            same(one, other)
    else:
        assert found == expected


def fill(storage, last, name="fleet", number=1):
    """A hull with a commit for each batch."""
    storage.commit([Create(HullRow(number, name, "0123", 12.5))])
    append(storage, 1, last, number)


def committed_at(revision):
    """The time of the commit of a revision that `append` has added."""
    return 1_800_000_000_000_000 + revision


def append(storage, first, last, number=1):
    for each in records(first, last):
        storage.commit([Append(number, [each])], committed_at(each.revision))


def fence_row(number=9, name="gate", hull="fleet"):
    area = PolygonArea(((np.array([[0, 0], [4, 0], [0, 3]], "<f8").tobytes(),),))
    return FenceRow(number, name, f"uid{number}", 12.5, FenceConfig(area, "hull", hull, margin=0.5))


def event(sequence, kind=None, key=None):
    """An event: keys enter and leave in turn."""
    kind = kind or (EventType.ENTER if sequence % 2 else EventType.EXIT)
    key = key or f"é{(sequence + 1) // 2}"
    here, before = (float(sequence), 0.1), (sequence - 0.5, 0.1)
    distance = 0.0 if kind is EventType.ENTER else 0.625
    time = 1_700_000_000_000_000 + sequence
    return FenceEvent(
        sequence, kind, int(Cause.MOVED), "fleet", key, sequence, 0, here, before, distance, time - 9, time
    )


def events(first, last):
    return [event(sequence) for sequence in range(first, last + 1)]


def appended(number, made):
    """The change that adds events of one fence."""
    return AppendEvents(block_of({number: made}))


def read_fence(storage, number):
    (fence,) = storage.read_fences([number])
    return fence


def fill_fence(storage, last, number=9, hull="fleet"):
    """A fence with a commit for each event, a consumer, a delay, and one who was inside from the beginning."""
    inside = Inside(0, (Members(hull, PackedKeys.pack(["a"]), 1),))
    storage.commit([AddFence(fence_row(number, hull=hull), inside)])
    for each in events(1, last):
        storage.commit([appended(number, [each])])
    storage.commit([PutConsumer(number, Consumer("mail", 1, 0))])
    storage.commit([PutDelays(number, {(hull, "é"): Delay(True, 2**50, 1, int(Cause.MOVED))})])


def snapshot(storage, revision, number=1):
    for step in storage.snapshot(number, Kept(revision, Contents(points(100, -revision % 1000)))):
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


def state(storage, number, until):
    """The newest state of a revision not after another one, with its contents."""
    kept, parts = storage.state(number, until)
    found = list(parts.parts)
    assert sum(map(len, found)) == parts.count
    return dataclasses.replace(kept, contents=in_one(found))
