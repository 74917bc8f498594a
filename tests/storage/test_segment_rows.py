"""A damaged row of a segment is put right, or is a hole in the past of its hull alone."""

import sqlite3
from contextlib import closing

import pytest
from filed_fleet import SECOND, SETTINGS, Fleet, move, read_back
from folders import no_progress, same, state
from postgresql import query

from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.state.records import Append, Create, Delete, HullRow
from dynhull_server.storage.port import DamagedError, StorageError
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.sqlite import copies

COLUMNS = "id", "hull", "first", "last", "file", "facts", "checksum"
TEXTS = "file", "facts"
BITS = 0, 1, 7, 13, 31  # of numbers


@pytest.fixture
def fleet(tmp_path):
    """A hull with three segments, beside one without any; the storage is closed."""
    fleet = Fleet(tmp_path)
    fleet.fill(4)
    fleet.storage.commit([Create(HullRow(2, "other", "4567", 12.5, SETTINGS)), Append(2, [move(1)])], fleet.time)
    fleet.storage.close()
    return fleet


class Table:
    """The rows of segments of a folder, changed behind the back of any server."""

    def __init__(self, fleet):
        self.file = fleet.folder / "data" / "dynhull.db"
        (self.row,) = self.execute("SELECT * FROM segments WHERE id = 2")

    def execute(self, sql, *values):
        with closing(sqlite3.connect(self.file, isolation_level=None)) as connection:
            found = connection.execute(sql, values).fetchall()
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            return found

    def put(self, column, value):
        """Change a column of the second segment; bytes are a text."""
        place = "CAST(? AS TEXT)" if isinstance(value, bytes) else "?"
        self.execute(f"UPDATE segments SET {column} = {place} WHERE id = 2", value)


def flips(row):
    """Each column with each of its bits the other way."""
    for column, value in zip(COLUMNS, row, strict=True):
        if column not in TEXTS:
            yield from ((column, value ^ 1 << bit) for bit in BITS)
            continue
        content = value.encode()
        for bit in range(0, 8 * len(content), 67):
            flipped = bytearray(content)
            flipped[bit // 8] ^= 1 << bit % 8
            yield column, bytes(flipped)


def served(fleet):
    """The storage, opened again, and what it says."""
    fleet.storage = fleet.make()
    return [note.partition(": ")[2] for note in fleet.storage.open(no_progress).notes]


def require_writes(fleet):
    """Both hulls take batches, and are read as they are."""
    fleet.put(1)
    assert fleet.storage.read(1).last_revision == len(fleet.records)
    last = fleet.storage.read(2).last_revision
    fleet.storage.commit([Append(2, [move(last + 1)])], fleet.time)
    assert fleet.storage.read(2).last_revision == last + 1


def test_a_flipped_bit_of_any_column_is_put_right(fleet):
    table = Table(fleet)
    count, right = 0, "hull 'fleet': the row of the past of revisions 8 to 15 was damaged, and could be put right"
    for column, value in flips(table.row):
        if column == "id" and value in (1, 3, 4):  # the row of another segment
            continue
        table.put(column, value)
        assert served(fleet) == [right], (column, value)
        same(read_back(fleet.storage, len(fleet.records)), fleet.records)
        fleet.storage.close()
        assert table.execute("SELECT * FROM segments WHERE id = 2") == [table.row]
        count += 1
    assert count > 50
    assert served(fleet) == []
    require_writes(fleet)
    fleet.storage.close()


@pytest.mark.parametrize("column", ["hull", "first", "last", "checksum"])
def test_a_number_that_is_another_one_is_put_right(fleet, column):
    """By the name of the file, and by the totals."""
    Table(fleet).put(column, 1_234_567)
    assert served(fleet)[0].endswith("could be put right")
    same(read_back(fleet.storage, len(fleet.records)), fleet.records)
    fleet.storage.close()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("file", b"0123/0000000000000000001-0000000000000000007-0-1111111111111111"),
        ("file", b"\xff\xfe/etc/passwd"),
        ("facts", b"\x00" * 300),
        ("facts", b'{"bytes": 7}'),
    ],
)
def test_what_cannot_be_put_right_is_a_hole_of_one_hull_with_its_revisions(fleet, column, value):
    table = Table(fleet)
    table.put(column, value)
    named = "revisions 8 to 15"
    report = copies.check(fleet.folder / "data", no_progress, fleet.archive.path)
    assert [each.name for each in report.hulls if not each.whole] == ["fleet"]
    assert any(named in note and "cannot be read" in note for note in report.notes)

    assert served(fleet) == [f"hull 'fleet': the row of the past of {named} was damaged: they cannot be read"]
    require_writes(fleet)
    storage = fleet.storage
    same(read_back(storage, 7), fleet.records[:7])
    for after in (7, 10, 14):
        with pytest.raises(DamagedError, match=f"{named} cannot be read"):
            storage.batches(1, after, 20)
    for time in (fleet.records[9].committed.time, fleet.records[7].committed.time):
        with pytest.raises(DamagedError, match=f"{named} cannot be read"):
            storage.moment(1, time)
    assert storage.moment(1, fleet.records[3].committed.time).revision == 4
    same(storage.batches(1, 15, 20)[:3], fleet.records[15:18])
    assert state(storage, 1, 16).revision == 15
    assert [(each.first, each.last) for each in storage.holes()] == [(8, 15)]
    storage.close()

    assert served(fleet) == []  # it has been said; `check` goes on saying it
    storage = fleet.storage
    report = copies.check(fleet.folder / "data", no_progress, fleet.archive.path)
    assert [each.name for each in report.hulls if not each.whole] == ["fleet"]
    assert any(f"{named} of its past cannot be read" in note for note in report.notes)
    fleet.fill(2)
    assert storage.history(1).first.revision == 0
    fleet.carry_out([storage.set_history(1, 3 * SECOND, 0)])
    fleet.file()
    assert storage.history(1).first.revision > 15
    fleet.carry_out([Delete(1)])
    fleet.file()
    left = [] if column == "facts" else [each for each in fleet.files if "/0000000000000000008-" in each]
    assert fleet.files == left  # whose name nobody knows
    storage.close()


def test_a_damaged_row_that_names_files_to_remove_removes_no_others(fleet):
    served(fleet)
    fleet.carry_out([Delete(1)])
    fleet.storage.close()
    table = Table(fleet)
    (other,) = table.execute("SELECT file FROM segments WHERE id = 1")
    table.put("file", other[0].encode())
    assert served(fleet) == ["a row of files of the past that are to go was damaged"]
    fleet.storage.close()


def test_a_row_of_which_too_much_is_damaged_refuses_the_start(fleet):
    """Whether batches are missing could not be noticed."""
    table = Table(fleet)
    for column, value in (("facts", b""), ("first", 5), ("file", b"")):
        table.put(column, value)
    with pytest.raises(DamagedError, match="the row of the past of revisions 5 to 15 is damaged"):
        served(fleet)


def test_a_row_whose_neighbour_lacks_a_batch_refuses_the_start(fleet):
    """What is damaged explains nothing else."""
    table = Table(fleet)
    table.put("facts", b"")
    table.execute("UPDATE batches SET checksum = checksum + 1 WHERE rowid = (SELECT max(rowid) FROM batches)")
    with pytest.raises(DamagedError, match="rows are missing"):
        served(fleet)


def test_of_a_database_too(postgres, tmp_path):
    url = postgres.new_database()
    archive = Archive(tmp_path / "history")
    make = lambda: PostgresStorage(Database(url), pytest.fail, archive=archive)  # noqa: E731
    fleet = Fleet(tmp_path, archive=archive, make=make)
    fleet.fill(4)
    fleet.storage.close()
    query(url, "UPDATE segments SET last = last + 4 WHERE id = 2")
    assert served(fleet)[0].endswith("could be put right")
    same(read_back(fleet.storage, len(fleet.records)), fleet.records)
    fleet.storage.close()
    query(url, "UPDATE segments SET facts = 'nothing' WHERE id = 2")
    assert served(fleet)[0].endswith("cannot be read")
    with pytest.raises(DamagedError, match="revisions 8 to 15 cannot be read"):
        read_back(fleet.storage, 20)
    fleet.storage.close()


def settled(fleet):
    """The storage decides a commit whose outcome is not known, and goes on."""
    fleet.storage._unsettled = True
    with pytest.raises(StorageError, match="not known yet"):
        fleet.storage.read(1)
    fleet.storage.settle()
    same(read_back(fleet.storage, len(fleet.records)), fleet.records)
    require_writes(fleet)
    fleet.file()


def test_a_row_that_is_damaged_while_a_commit_is_in_doubt_is_put_right(fleet):
    """Nobody has to restart the server for it, and what was committed since agrees with the totals."""
    table = Table(fleet)
    assert served(fleet) == []
    table.execute("UPDATE segments SET last = last + 4 WHERE id = 2")
    settled(fleet)
    fleet.storage.close()
    assert table.execute("SELECT * FROM segments WHERE id = 2") == [table.row]
    assert served(fleet) == []
    fleet.storage.close()
    assert copies.check(fleet.folder / "data", no_progress, fleet.archive.path).notes == []


def test_of_a_database_too_while_a_commit_is_in_doubt(postgres, tmp_path):
    url = postgres.new_database()
    archive = Archive(tmp_path / "history")
    fleet = Fleet(tmp_path, archive=archive, make=lambda: PostgresStorage(Database(url), pytest.fail, archive=archive))
    fleet.fill(4)
    fleet.storage.commit([Create(HullRow(2, "other", "4567", 12.5, SETTINGS)), Append(2, [move(1)])], fleet.time)
    before = query(url, "SELECT * FROM segments WHERE id = 2")
    query(url, "UPDATE segments SET last = last + 4 WHERE id = 2")
    settled(fleet)
    assert query(url, "SELECT * FROM segments WHERE id = 2") == before
    fleet.storage.close()
    assert served(fleet) == []
    fleet.storage.close()
