"""Flip bits of data folders, one at a time, and see whether the storage ever loses an acknowledged batch in silence.

    python tests/robustness/storage/flips.py [--flips 20000] [--seed 0] [--processes 2] [--folder /dev/shm]

Folders of killed and of stopped servers, with hulls of points, of keys and with windows, and a fence. Every bit of the
headers: of the database, of the log, of its frames, of all pages; then bits at random, anywhere. After each flip the
folder is opened and compared with what was acknowledged; where it opens, one more batch is committed, and the folder
opened again: damage may strike later.

harmless: everything is there. repaired: a note says what was lost or mended. refused: a StorageError says why. Any
other outcome is a fault, and makes the exit code 1.
"""

import argparse
import random
import shutil
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.records import (
    AddFence,
    Consumer,
    EventType,
    FenceEvent,
    FenceRow,
    Inside,
    Members,
    PutConsumer,
)
from dynhull_server.state.records import (
    NO_TIME,
    Append,
    Contents,
    Create,
    Delete,
    Expiry,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    PointRows,
    Record,
    Rows,
    Window,
)
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.port import StorageError
from dynhull_server.storage.sqlite.folder import DATABASE
from dynhull_server.storage.sqlite.origin import NOTE
from dynhull_server.storage.sqlite.storage import SQLiteStorage

LOG = f"{DATABASE}-wal"
# Without the note a copy is not known for one, whose identities would be others.
UNNOTED = shutil.ignore_patterns(NOTE)
NOTHING = np.empty((0, 2))

HARMLESS, REPAIRED, REFUSED, SILENT, TRACEBACK = "harmless", "repaired", "refused", "silent losses", "tracebacks"
FAULTS = SILENT, TRACEBACK

# In a database: the file's header, and that of a page that is no part of an overflow chain.
FILE_HEADER_BYTES, PAGE_HEADER_BYTES = 100, 12
TREE_PAGES = (2, 5, 10, 13)
LOG_HEADER_BYTES, FRAME_HEADER_BYTES = 32, 24

# The time by the server's clock, about.
NOW = 1_800_000_000_000_000

Acknowledged = dict[int, list[Record]]

FENCE = 90
FENCE_ROW = FenceRow(FENCE, "gate", "uid", 1.5, FenceConfig(CircleArea(1.0, 2.0, 3.0), "hull", "hull 2", margin=0.5))


@dataclass(frozen=True)
class Flip:
    """One bit of one file of one folder."""

    folder: str
    file: str
    bit: int


def hull_row(number: int) -> HullRow:
    """A hull of the folder: 2 and 5 have string keys, 4 and 6 integers, 3 a window."""
    identity = {2: "str", 4: "int", 5: "str", 6: "int"}.get(number, "multiset")
    window = Window(max_age=9, max_skew=0, clock="data") if number in (2, 3) else None
    settings = HullSettings(identity, number * 100, window, by_event_time=number == 4)
    return HullRow(number, f"hull {number}", f"{number:016x}", 1.7e9 + number, settings)


def record(number: int, revision: int, points: int = 3) -> Record:
    """The batch that made a revision of a hull: always the same."""
    clock = None if number == 1 else revision
    return Record(revision, rows(number, revision, points), f"writer {revision % 4}", revision, clock)


def rows(number: int, revision: int, count: int) -> Rows:
    """What it changed."""
    rng = np.random.default_rng([number, revision])
    if number != 1 and revision % 4 == 0:
        return Expiry(revision - 9, count)
    times = rng.integers(0, 2**53, count) if number in (2, 3) else None
    points, removed = rng.random((count, 2)), revision % 3
    if number in (1, 3):
        return PointRows(points, rng.random((removed, 2)), revision % 5 == 0, times)
    deadlines = rng.integers(0, 2**53, count) if revision % 2 else None
    return KeyRows(keys(number, rng, count), points, keys(number, rng, removed), times, deadlines, "present")


def keys(number: int, rng: np.random.Generator, count: int) -> PackedKeys | np.ndarray:
    """Keys of a hull."""
    integers = rng.integers(0, 2**64 - 1, count, np.uint64)
    return integers if number in (4, 6) else PackedKeys.pack([f"é {integer}" for integer in integers.tolist()])


def no_progress(done: int, total: int) -> None:
    """Ignore the progress."""


def commit(storage: SQLiteStorage, batches: Sequence[Append]) -> None:
    """Commit batches, which know their commits from then on."""
    storage.commit(batches, NOW + batches[0].records[0].revision)
    for each in batches:
        kept = storage.read(each.number).records[-len(each.records) :]
        for record, stored in zip(each.records, kept, strict=True):
            assert stored.committed is not None  # it is of the present format
            record.committed = stored.committed


class Builder:
    """Fills a folder, and remembers what was acknowledged."""

    def __init__(self, path: Path, durability: Durability) -> None:
        self.storage = SQLiteStorage(path, durability)
        self.storage.open(no_progress)
        self.acknowledged: Acknowledged = {}

    def create(self, number: int) -> None:
        """A hull."""
        row = hull_row(number)
        self.storage.commit([Create(row)])
        self.acknowledged[number] = []

    def append(self, counts: dict[int, int], points: int = 3) -> None:
        """Batches for hulls in one commit."""
        changes = []
        for number, count in counts.items():
            revision = len(self.acknowledged[number])
            changes.append(Append(number, [record(number, revision + i + 1, points) for i in range(count)]))
        commit(self.storage, changes)
        for change in changes:
            self.acknowledged[change.number] += change.records

    def snapshot(self, number: int, points: int) -> None:
        """Store a snapshot of the current revision."""
        revision = len(self.acknowledged[number])
        for step in self.storage.snapshot(
            number, Kept(revision, snapshot_contents(number, revision, points), {"a": revision}, clock=-revision)
        ):
            self.storage.commit([step])

    def fence(self, turn: int) -> None:
        """Events of a fence, and what else is stored of it; the fence itself at first."""
        events: list[Any] = self.acknowledged.setdefault(FENCE, [])
        if not turn:
            inside = Inside(0, (Members("hull 2", PackedKeys.pack(["a", "é"]), 1),))
            self.storage.commit([AddFence(FENCE_ROW, inside)])
        made = [fence_event(len(events) + i + 1) for i in range(1 + turn % 3)]
        consumer = PutConsumer(FENCE, Consumer("mail", turn, 0))
        self.storage.commit([AppendEvents(block_of({FENCE: made})), consumer])
        events += made
        if turn == 2:
            members = Members("hull 2", PackedKeys.pack(["a"]), 5)
            for step in self.storage.inside(FENCE, Inside(len(events), (members,))):
                self.storage.commit([step])

    def delete(self, number: int, *, sweep: bool = True) -> None:
        """Delete a hull; with `sweep`, also remove the rows that it leaves."""
        self.storage.commit([Delete(number)])
        del self.acknowledged[number]
        for step in self.storage.sweep() if sweep else ():
            self.storage.commit([step])


def fence_event(sequence: int) -> FenceEvent:
    """An event of the fence: always the same."""
    kind = EventType.ENTER if sequence % 2 else EventType.EXIT
    distance = 0.0 if sequence % 2 else 0.75
    place = (float(sequence), -0.5)
    return FenceEvent(sequence, kind, 1, "hull 2", f"é{sequence}", 1, 0, place, place, distance, NO_TIME, sequence)


def snapshot_contents(number: int, revision: int, count: int = 0) -> Contents:
    """The contents that a hull is said to have at a revision. The first point says how many."""
    rng = np.random.default_rng([number, revision, 7])
    points = rng.random((count, 2))
    if count:
        points[0] = count
    if number == 1:
        return Contents(points)
    times, deadlines = rng.integers(0, 2**53, (2, count))
    return Contents(points, None if number == 3 else keys(number, rng, count), times, deadlines)


def fill(builder: Builder) -> None:
    """A folder with hulls of every kind."""
    for number in range(1, 6):
        builder.create(number)
    for turn in range(5):
        builder.append({number: 1 + (turn + number) % 3 for number in (1, 2, 3, 4)})
        builder.fence(turn)
        if turn in (1, 2, 3):
            builder.snapshot(1, 700)
        if turn == 2:
            builder.snapshot(2, 50)
            builder.snapshot(4, 50)
    builder.append({2: 1}, 1500)
    builder.delete(3)
    builder.append({1: 2})


def build(root: Path) -> dict[str, Acknowledged]:
    """Folders by name, and what was acknowledged in each."""
    built = {}
    for name, durability in (("killed", Durability.SYNC), ("killed-interval", Durability.INTERVAL)):
        builder = Builder(root / "work", durability)
        fill(builder)
        built[name] = copied(builder, root / name)
        builder.storage.close()
        if name == "killed":
            shutil.copytree(root / "work", root / "stopped", ignore=UNNOTED)
            built["stopped"] = builder.acknowledged
        shutil.rmtree(root / "work")
    # Most of it in the database, some of it in a log with frames of an earlier use behind it.
    builder = Builder(root / "work", Durability.SYNC)
    fill(builder)
    builder.storage._copy_log("RESTART")  # as `checkpoint` does when the log is long
    builder.append({1: 2})
    builder.create(6)
    builder.append({6: 1})
    builder.delete(4, sweep=False)
    built["checkpointed"] = copied(builder, root / "checkpointed")
    builder.storage.close()
    shutil.rmtree(root / "work")
    return built


def copied(builder: Builder, target: Path) -> Acknowledged:
    """The folder as a killed process leaves it."""
    shutil.copytree(builder.storage._folder.path, target, ignore=UNNOTED)
    return {number: list(records) for number, records in builder.acknowledged.items()}


def headers(root: Path) -> Iterator[Flip]:
    """Every bit of every header."""
    for folder in sorted(path.name for path in root.iterdir()):
        database = (root / folder / DATABASE).read_bytes()
        page_bytes = struct.unpack(">H", database[16:18])[0]
        spans = [(DATABASE, 0, FILE_HEADER_BYTES)]
        for start in range(0, len(database), page_bytes):
            first = start + (FILE_HEADER_BYTES if start == 0 else 0)
            if database[first] in TREE_PAGES:
                spans.append((DATABASE, first, PAGE_HEADER_BYTES))
        log = root / folder / LOG
        if log.exists():
            spans.append((LOG, 0, LOG_HEADER_BYTES))
            frames = range(LOG_HEADER_BYTES, log.stat().st_size, FRAME_HEADER_BYTES + page_bytes)
            spans += [(LOG, start, FRAME_HEADER_BYTES) for start in frames]
        for file, start, length in spans:
            yield from (Flip(folder, file, bit) for bit in range(start * 8, (start + length) * 8))


def anywhere(root: Path, count: int, seed: int) -> Iterator[Flip]:
    """Bits at random: every folder as often as the others, every bit of it too."""
    rng = random.Random(seed)
    folders = sorted(root.iterdir())
    sizes = {folder: [(file.name, file.stat().st_size) for file in sorted(folder.iterdir())] for folder in folders}
    for i in range(count):
        folder = folders[i % len(folders)]
        names, weights = zip(*sizes[folder], strict=True)
        (file,) = rng.choices(names, weights)
        yield Flip(folder.name, file, rng.randrange(8 * dict(sizes[folder])[file]))


def outcome(root: Path, acknowledged: Acknowledged, flip: Flip, scratch: Path) -> tuple[str, str]:
    """What one flip does, and in which words."""
    shutil.copytree(root / flip.folder, scratch)
    path = scratch / flip.file
    content = bytearray(path.read_bytes())
    content[flip.bit // 8] ^= 1 << flip.bit % 8
    path.write_bytes(content)
    words: list[str] = []
    try:
        expected = dict(acknowledged)
        grown = None
        for _ in range(2):
            storage = SQLiteStorage(scratch, Durability.NONE)
            contents = storage.open(no_progress)
            words += contents.notes
            try:
                differs = difference(storage, expected)
                if differs and not words:
                    return SILENT, differs
                if grown is None:
                    numbers = [row.number for row in contents.hulls]
                    if not numbers:
                        return REPAIRED, "; ".join(words)
                    grown = min(numbers)
                    last = storage.read(grown).last_revision
                    new = record(grown, last + 1)
                    commit(storage, [Append(grown, [new])])
                    expected[grown] = [*expected[grown][:last], new]
            finally:
                storage.close()
    except StorageError as error:
        return (REFUSED, str(error)) if str(error) else (TRACEBACK, repr(error))
    except Exception as error:
        return TRACEBACK, repr(error)
    finally:
        shutil.rmtree(scratch)
    return (REPAIRED, "; ".join(words)) if words else (HARMLESS, "")


def difference(storage: SQLiteStorage, acknowledged: Acknowledged) -> str:
    """How the storage differs from what was acknowledged; empty where it does not."""
    for number, records in acknowledged.items():
        if number == FENCE:
            (fence,) = storage.read_fences([FENCE])
            if fence is None or fence.row != FENCE_ROW or fence.consumers != {"mail": Consumer("mail", 4, 0)}:
                return f"the fence is {fence}"
            if storage.read_events(FENCE, 0, 10**6) != records or fence.last != len(records):
                return "the events of the fence differ"
            continue
        row = storage.row(number)
        if row != hull_row(number):
            return f"hull {number} is {row}"
        kept = storage.read(number)
        if not same(number, kept, records):
            return f"hull {number} ends at {kept.last_revision}, not at {len(records)}, or differs"
    return ""


def same(number: int, kept: Kept, records: list[Record]) -> bool:
    """Whether a hull is as it was acknowledged."""
    revision = kept.revision
    expected = Kept()
    if revision:
        contents = snapshot_contents(number, revision, len(kept.contents))
        committed = records[revision - 1].committed
        expected = Kept(revision, contents, {"a": revision}, clock=-revision, committed=committed)
    expected.records = records[revision:]
    return equal(kept, expected)


def equal(one: Any, other: Any) -> bool:
    """Field by field, row by row."""
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(equal(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))
    if isinstance(one, list):
        return len(one) == len(other) and all(map(equal, one, other))
    return np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


def tried(work: tuple[Path, Path, Acknowledged, Flip, int]) -> tuple[Flip, str, str]:
    """In a process of the pool."""
    root, scratch, acknowledged, flip, number = work
    return flip, *outcome(root, acknowledged, flip, scratch / str(number))


def run(folder: Path, count: int, seed: int, processes: int, every: int = 1) -> tuple[Counter[str], list[str]]:
    """Outcomes counted, and what the faults were. Of the headers' bits one in `every`."""
    root, scratch = folder / "folders", folder / "scratch"
    root.mkdir()
    scratch.mkdir()
    built = build(root)
    flips = [*list(headers(root))[::every], *anywhere(root, count, seed)]
    work = ((root, scratch, built[flip.folder], flip, number) for number, flip in enumerate(flips))
    counts: Counter[str] = Counter()
    faults = []
    # A forked process would wait for the threads of gRPC, which a program around this one may have started.
    with get_context("spawn").Pool(processes) as pool:
        for flip, what, words in pool.imap_unordered(tried, work, chunksize=16):
            counts[what] += 1
            if what in FAULTS:
                faults.append(f"{what}: {flip}: {words}")
        pool.close()
        pool.join()  # a worker that ends by itself reports the lines that it ran
    return counts, faults


def main() -> None:
    parser = argparse.ArgumentParser(description="Flip bits of data folders; count what the storage makes of it.")
    parser.add_argument("--flips", type=int, default=20_000, help="at random, beside those of the headers")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--every", type=int, default=1, help="of the headers' bits, flip every Nth")
    parser.add_argument("--folder", type=Path, default=None, help="where to work; in memory is quickest")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        counts, faults = run(Path(folder), options.flips, options.seed, options.processes, options.every)
    print(f"{counts.total():,} flips")
    for what in (HARMLESS, REPAIRED, REFUSED, SILENT, TRACEBACK):
        print(f"{what:14}{counts[what]:>8,}")
    print(*faults, sep="\n")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
