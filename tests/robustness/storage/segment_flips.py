"""Damage segments, one bit at a time, and see whether the past is ever answered wrongly, or a hole not named.

    python tests/robustness/storage/segment_flips.py [--flips 10000] [--seed 0] [--folder /dev/shm]

Hulls of points, of keys and with windows, each with several segments. The flips are spread over all bytes of all files;
then each file is cut, exchanged for each other one of its kind, and taken away. After each, the revisions that need the
file are refused with a DamagedError that names them, as the holes of the storage do. After every hundredth all other
revisions are answered as they were, and `check` names those. Any other outcome is a fault, and makes the exit code 1.
"""

import argparse
import logging
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_server.state.contents import replayed
from dynhull_server.state.records import (
    FOREVER,
    Append,
    Create,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    PointRows,
    Record,
    Window,
)
from dynhull_server.storage.port import DamagedError
from dynhull_server.storage.rows.filed import Filed
from dynhull_server.storage.segments.archive import BATCHES, STATE, Archive
from dynhull_server.storage.sqlite import copies
from dynhull_server.storage.sqlite.storage import SQLiteStorage

SECOND = 1_000_000
BEGIN = 2_000 * SECOND
KINDS = (
    HullSettings("str", history=FOREVER),
    HullSettings("int", history=FOREVER),
    HullSettings(history=FOREVER),
    HullSettings(window=Window(max_age=10**4 * SECOND), history=FOREVER),
)
SEGMENTS, BATCHES_EACH = 4, 8
CHECKED = 100  # every so many flips


@dataclass(frozen=True)
class File:
    """A file of a segment, and the revisions of its hull that it has, or that are rebuilt from it."""

    path: Path
    number: int
    first: int
    last: int
    holds: str


class Past:
    """Hulls with several segments each, and what their revisions were."""

    def __init__(self, folder: Path, kinds: Sequence[HullSettings] = KINDS) -> None:
        self.folder = folder
        self.archive = Archive(folder / "history")
        self.storage = SQLiteStorage(folder / "data", archive=self.archive)
        self.storage.open(lambda *_: None)
        self.records: dict[int, list[Record]] = {}
        self.files = list[File]()
        self.faults = list[str]()
        for number, settings in enumerate(kinds, 1):
            row = HullRow(number, f"hull {number}", f"uid{number}", 12.5, settings)
            self.storage.commit([Create(row)], BEGIN)
            self.records[number] = []
            self._fill(number, settings)
            self.files += self._found(number)

    def _fill(self, number: int, settings: HullSettings) -> None:
        records = self.records[number]
        for _ in range(SEGMENTS + 2):
            for _ in range(BATCHES_EACH):
                record = _batch(len(records) + 1, settings)
                stamp = self.storage.commit([Append(number, [record])], BEGIN + len(records) * SECOND)
                records.append(replace(record, committed=stamp))
            contents = replayed(Kept(records=records), settings).stored()
            for step in self.storage.snapshot(number, Kept(len(records), contents, clock=records[-1].clock)):
                self.storage.commit([step])
            for step in self.storage.file_history(BEGIN):
                self.storage.commit([step])

    def _found(self, number: int) -> Iterator[File]:
        for segment in self.storage._ledger.hulls[number].segments:
            for end in (BATCHES, STATE):
                path = self.archive.path / (segment.file + end)
                if path.exists():
                    yield File(path, number, segment.first, segment.last, end)

    def close(self) -> None:
        self.storage.close()

    def look(self, file: File, what: str, *, check: bool) -> None:
        """Require that the damage of a file is named, and that no other revision is concerned."""
        self.storage._filed = Filed(self.archive)  # nothing is in memory
        at = f"{file.path.name} of hull {file.number}, {what}"
        if file.holds == BATCHES:
            need = lambda: self.storage.gathered(file.number, file.first - 1, file.last)  # noqa: E731
            named, hole = f"revisions {file.first} to {file.last} cannot be read", (file.first, file.last)
        else:
            need = lambda: self.storage.state(file.number, file.first - 1)  # noqa: E731
            named, hole = f"the state at revision {file.first - 1} cannot be read", (file.first - 1, file.first - 1)
        try:
            need()
            self.faults.append(f"{at}: it was read")
        except DamagedError as error:
            if named not in str(error) or file.path.name not in str(error):
                self.faults.append(f"{at}: {error}")
        if [(each.number, each.first, each.last) for each in self.storage.holes()] != [(file.number, *hole)]:
            self.faults.append(f"{at}: the holes are {self.storage.holes()}")
        if check:
            for number, records in self.records.items():
                for segment in self.storage._ledger.hulls[number].segments:
                    if (number, segment.first) != (file.number, file.first):
                        self._require_same(number, records, segment.first - 1, segment.last, at)
            notes = copies.check(self.folder / "data", lambda *_: None, self.archive.path).notes
            if len(notes) != 1 or f"revisions {file.first} to {file.last}" not in notes[0]:
                self.faults.append(f"{at}: check says {notes}")

    def _require_same(self, number: int, records: list[Record], after: int, until: int, at: str) -> None:
        found = self.storage.batches(number, after, until)
        if [(each.revision, _bytes(each)) for each in found] != [
            (each.revision, _bytes(each)) for each in records[after:until]
        ]:
            self.faults.append(f"{at}: revisions {after + 1} to {until} of hull {number} are others")


def _batch(revision: int, settings: HullSettings) -> Record:
    rng = np.random.default_rng(revision)
    points = np.round(rng.random((5, 2)) * 100, 5)
    if settings.identity == "multiset":
        times = None if settings.window is None else np.full(5, BEGIN + revision * SECOND)
        clock = None if settings.window is None else BEGIN + revision * SECOND
        return Record(revision, PointRows(points, points[:0], times=times), clock=clock, cause="batch")
    who = rng.choice(9, 5, replace=False)
    keys = PackedKeys.pack([f"key {each}" for each in who]) if settings.identity == "str" else who.astype(np.uint64)
    return Record(revision, KeyRows(keys, points, keys[:0]), cause="batch")


def _bytes(record: Record) -> bytes:
    rows = record.rows
    return b"".join(
        column.lengths + column.data if isinstance(column, PackedKeys) else column.tobytes()
        for name in ("keys", "points", "inserts", "times")
        if (column := getattr(rows, name, None)) is not None
    )


def flips(past: Past, count: int, seed: int) -> Counter[str]:
    """Flip bits, spread over all bytes of all files."""
    rng = random.Random(seed)
    done: Counter[str] = Counter()
    sizes = [file.path.stat().st_size for file in past.files]
    total, before = 8 * sum(sizes), 0
    for file, size in zip(past.files, sizes, strict=True):
        content = file.path.read_bytes()
        first, last = count * before // total, count * (before + 8 * size) // total
        for number in range(first, last):
            low, high = total * number // count - before, total * (number + 1) // count - before
            bit = min(max(rng.randrange(low, max(high, low + 1)), 0), 8 * size - 1)
            changed = bytearray(content)
            changed[bit // 8] ^= 1 << bit % 8
            file.path.write_bytes(changed)
            past.look(file, f"bit {bit} is another one", check=number % CHECKED == 0)
            done["flipped"] += 1
        file.path.write_bytes(content)
        before += 8 * size
    return done


def other_damage(past: Past) -> Counter[str]:
    """Cut each file, exchange it for each other one of its kind, and take it away."""
    done: Counter[str] = Counter()
    contents = {file: file.path.read_bytes() for file in past.files}
    for file, content in contents.items():
        for length in (0, 1, len(content) // 2, len(content) - 1):
            file.path.write_bytes(content[:length])
            past.look(file, f"cut at byte {length}", check=False)
            done["cut"] += 1
        for other in past.files:
            if other is not file and other.holds == file.holds:
                file.path.write_bytes(contents[other])
                past.look(file, f"with the bytes of {other.path.name}", check=False)
                done["exchanged"] += 1
        file.path.unlink()
        past.look(file, "taken away", check=True)
        done["taken away"] += 1
        file.path.write_bytes(content)
    return done


def main() -> None:
    parser = argparse.ArgumentParser(description="Damage segments, and see whether that is named.")
    parser.add_argument("--flips", type=int, default=10_000, help="bits to flip (default 10,000)")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of bits (default 0)")
    parser.add_argument("--folder", type=Path, default=None, help="where to put the data (default: the system's)")
    options = parser.parse_args()
    logging.disable()  # a line for each file that cannot be read
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        past = Past(Path(folder))
        try:
            done = flips(past, options.flips, options.seed) + other_damage(past)
        finally:
            past.close()
    size = sum(1 for _ in past.files)
    print(f"{size} files: {dict(done)}, {len(past.faults)} faults")
    for fault in past.faults[:20]:
        print(fault)
    sys.exit(1 if past.faults else 0)


if __name__ == "__main__":
    main()
