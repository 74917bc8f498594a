"""Many events of one commit are written in pieces ahead of it: all of them are there, or none."""

import random
import sqlite3
from contextlib import closing

import pytest
from faulty_disk import FaultyDisk, failure
from folders import DATABASE, event, fence_row, fill, killed, opened, record

from dynhull_server.state.fences.events.block import AppendEvents, block_of
from dynhull_server.state.fences.model.records import AddFence, DropEvents, DropFence, Inside
from dynhull_server.state.records import Append
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.port import DamagedError, NotCommittedError, StorageError
from dynhull_server.storage.rows import fence_ledger, staging

FENCES = [10, 11, 12]
ENDS = ["committed"] * 4 + ["killed", "stopped", "given up", "refused", "unknown"]


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """A few events are many."""
    monkeypatch.setattr(staging, "EVENTS_TOGETHER", 20)
    monkeypatch.setattr(staging, "EVENTS_AT_ONCE", 10)
    for module in (staging, fence_ledger):
        monkeypatch.setattr(module, "EVENTS_A_ROW", 5)


def at_once(first, count, moment):
    """Events of one moment."""
    return [event(first + row)._replace(subject_revision=moment, time=moment) for row in range(count)]


def filled(folder):
    storage, _ = opened(folder)
    fill(storage, 1)
    storage.commit([AddFence(fence_row(number, f"gate {number}"), Inside()) for number in FENCES])
    return storage


class Lives:
    """A storage that is killed and opened again, and what it must have."""

    def __init__(self, path, seed):
        self._path = path
        self._rng = random.Random(seed)
        self._disk = FaultyDisk()
        self._moment = self._lives = self.in_pieces = 0
        self._revision = 1
        self._events = {number: [] for number in FENCES}
        filled(path / "0").close()
        self._open("0")

    def step(self):
        """A commit, or what becomes of one that does not take place."""
        rng, end = self._rng, self._rng.choice(ENDS)
        made = {number: self._made(number) for number in rng.sample(FENCES, rng.randint(1, 3))}
        steps, changes = self.storage.ahead([Append(1, [record(self._revision + 1)]), AppendEvents(block_of(made))])
        self.in_pieces += bool(steps)
        whole = end in ("committed", "refused", "unknown")
        ahead = list(steps if whole else steps[: rng.randint(0, len(steps))])
        while ahead:
            count = rng.randint(1, 4)
            self.storage.commit(ahead[:count])
            del ahead[:count]
            if whole and rng.random() < 0.1:
                self._settle(kept=False)
        match end:
            case "committed":
                self.storage.commit(changes)
                self._keep(made)
            case "refused":
                with pytest.raises(NotCommittedError, match="there is no fence 99"):
                    self.storage.commit([*changes, DropEvents(99, 1)])
            case "unknown":
                kept = rng.random() < 0.5
                self._settle(changes, kept=kept)
                if kept:
                    self._keep(made)
            case "killed" | "stopped":
                self._again(kill=end == "killed")

    def compare(self):
        for number, expected in self._events.items():
            assert self.storage.read_events(number, 0, 10**6) == expected
            (kept,) = self.storage.read_fences([number])
            assert kept.last == len(expected)
        assert self.storage.read(1).records[-1].revision == self._revision

    def end(self):
        """Nothing is left of what was given up."""
        self._again(kill=True)
        for number in FENCES:
            self.storage.commit([DropFence(number)])
        for step in self.storage.sweep():
            self.storage.commit([step])
        self.storage.close()
        with closing(sqlite3.connect(self._path / str(self._lives) / DATABASE)) as database:
            assert database.execute("SELECT count(*) FROM events").fetchone() == (0,)

    def _made(self, number):
        made = []
        for count in self._rng.choices([1, 3, 12, 40], k=self._rng.randint(1, 3)):
            self._moment += 1
            made += at_once(len(self._events[number]) + len(made) + 1, count, self._moment)
        return made

    def _keep(self, made):
        self._revision += 1
        for number, events in made.items():
            self._events[number] += events

    def _settle(self, changes=(), *, kept):
        """A commit whose outcome has to be found out."""
        self._disk.fail("COMMIT", failure(sqlite3.SQLITE_IOERR_FSYNC), late=kept)
        with pytest.raises(StorageError):
            self.storage.commit(changes)
        self.storage.settle()

    def _again(self, *, kill):
        before = self._path / str(self._lives)
        self._lives += 1
        if kill:
            killed(before, self._path / str(self._lives))
            self.storage.close()
        else:
            self.storage.close()
            before.rename(self._path / str(self._lives))
        self._open(str(self._lives))

    def _open(self, folder):
        self.storage, contents = opened(self._path / folder, Durability.INTERVAL, self._disk)
        assert contents.notes == []


@pytest.mark.parametrize("seed", [1])
def test_all_events_of_a_commit_are_there_or_none(tmp_path, seed):
    lives = Lives(tmp_path, seed)
    for _ in range(15):
        lives.step()
        lives.compare()
    assert lives.in_pieces > 5
    lives.end()


def test_a_lost_row_is_not_taken_for_one_that_has_never_been(tmp_path):
    storage = filled(tmp_path / "data")
    steps, changes = storage.ahead([AppendEvents(block_of({10: at_once(1, 40, 7)}))])
    for step in steps:
        storage.commit([step])
    storage.commit(changes)
    storage.close()
    with closing(sqlite3.connect(tmp_path / "data" / DATABASE)) as database:
        database.execute("DELETE FROM events WHERE rowid = 2")
        database.commit()
    with pytest.raises(DamagedError, match="fence 'gate 10': events 6 to 10 are missing"):
        opened(tmp_path / "data")
