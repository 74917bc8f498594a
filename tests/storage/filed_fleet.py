"""A hull with a history, in a storage of its own, whose batches are known."""

from dataclasses import replace

import numpy as np
from folders import no_progress

from dynhull.keys import PackedKeys
from dynhull_server.state.contents import replayed
from dynhull_server.state.records import FOREVER, Append, Create, HullRow, HullSettings, Kept, KeyRows, Record
from dynhull_server.storage.rows.filed import Filed
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.sqlite.storage import SQLiteStorage

SECOND = 1_000_000
BEGIN = 2_000 * SECOND
SETTINGS = HullSettings("str", history=FOREVER)
KEYS = [f"vehicle {i}" for i in range(7)]


class Fleet:
    """A hull with a history, and what its batches were."""

    def __init__(self, folder, settings=SETTINGS, archive=None, make=None):
        self.folder, self.settings = folder, settings
        self.archive = archive or Archive(folder / "history")
        self.make = make or (lambda: SQLiteStorage(folder / "data", archive=self.archive))
        self.records, self.time = [], BEGIN
        self.storage = self.make()
        self.storage.open(no_progress)
        self.storage.commit([Create(HullRow(1, "fleet", "0123", 12.5, settings))], BEGIN)

    def make_reader(self):
        """The storage again, which has not read any file."""
        self.storage._filed = Filed(self.archive)
        return self.storage

    def put(self, commits):
        """Commits of two batches each, a second apart."""
        for _ in range(commits):
            self.time += SECOND
            first = len(self.records) + 1
            batches = [move(revision) for revision in (first, first + 1)]
            stamp = self.storage.commit([Append(1, batches)], self.time)
            self.records += [replace(each, committed=stamp) for each in batches]

    def snapshot(self):
        """A snapshot of the last revision but one, in the middle of a row of the journal."""
        revision = len(self.records) - 1
        contents = replayed(Kept(records=self.records[:revision]), self.settings).stored()
        self.carry_out(self.storage.snapshot(1, Kept(revision, contents)))

    def file(self):
        self.carry_out(self.storage.file_history(self.time))

    def carry_out(self, steps):
        for step in steps:
            self.storage.commit([step], self.time)

    def fill(self, times=5):
        for _ in range(times):
            self.put(4)
            self.snapshot()
            self.file()
        return self

    @property
    def files(self):
        return sorted(str(each.relative_to(self.archive.path)) for each in self.archive.path.rglob("*.parquet*"))


def move(revision):
    some = np.arange(revision % 3, 7, 2)
    points = np.round(np.random.default_rng(revision).random((len(some), 2)) * 100, 5)
    return Record(
        revision, KeyRows(PackedKeys.pack([KEYS[i] for i in some]), points, PackedKeys.pack([])), cause="batch"
    )


def read_back(storage, until):
    found, after = [], storage.oldest_moment(1).revision
    while after < until:
        found += storage.batches(1, after, until)
        after = found[-1].revision
    return found
