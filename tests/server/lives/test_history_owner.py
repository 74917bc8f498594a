"""One place has the past of one database: another one is refused at the start, and changes nothing there."""

import shutil
from contextlib import ExitStack
from itertools import count

import pytest
from cases import slow
from postgresql import postgresql
from server_process import run, server_process, shape_options

from dynhull_client import HullClient
from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.marks import DatabaseMarks
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.segments.owner import CLAIMS, Claimant, OccupiedError
from dynhull_server.storage.sqlite.owner import FolderMarks

QUIET = ("--snapshot-points", "50")


def refused(*options):
    """What a server says that does not start."""
    done = run("serve", "--port", "0", *shape_options(), *map(str, options))
    assert done.returncode == 2, done.stderr
    return done.stderr


def test_a_second_data_folder_is_refused_until_the_first_one_gives_way(tmp_path):
    first, past = tmp_path / "first", tmp_path / "past"
    for _ in range(2):
        with server_process("--data", str(first), "--history-dir", str(past), *QUIET):
            pass
    first = shutil.move(first, tmp_path / "moved")  # within its file system it stays the same
    with (
        server_process("--data", str(first), "--history-dir", str(past)) as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history=True)
        client.put("fleet", ["a"], [(1, 2)])
    before = sorted(past.rglob("*"))
    (claim,) = (past / CLAIMS).iterdir()

    copy = shutil.copytree(first, tmp_path / "copy")
    for other in (copy, tmp_path / "new"):
        said = refused("--data", other, "--history-dir", past)
        assert f"{past} has the past of another database, the data folder {first} of " in said
        assert f"{CLAIMS}/{claim.name}" in said
    assert sorted(past.rglob("*")) == before

    with server_process("--data", str(copy), "--history-dir", str(tmp_path / "own"), complaints=None):
        pass
    claim.unlink()
    with server_process("--data", str(copy), "--history-dir", str(past), complaints=None):
        pass
    assert "has the past of another database" in refused("--data", first, "--history-dir", past)


def test_of_two_that_claim_a_place_at_the_same_moment_none_goes_on_beside_the_other(tmp_path):
    class Late(Archive):
        """A place that another one claims between two looks."""

        def _claims(self):
            found = super()._claims()
            if not found:
                other = Archive(self.path)
                other.owner = Claimant("other", "the other one")
                other.claim()
            return found

    late = Late(tmp_path)
    late.owner = Claimant("late", "the late one")
    for _ in range(2):
        with pytest.raises(OccupiedError, match="the other one"):
            late.write("uid/name", b"content")
        with pytest.raises(OccupiedError, match="the other one"):
            late.remove("uid/name")
    assert [each.name for each in tmp_path.rglob("*") if each.is_file()] == ["other"]


def archive(past, marks):
    found = Archive(past)
    found.owner = Claimant("same", "the database", marks)
    return found


def require_noticed(past, first, copied):
    """Of two databases of one name the one that claims a place later has it, until it gives way."""
    one = archive(past, first)
    one.write("uid/name.batches.parquet", b"content")
    other = archive(past, copied())  # made while the first is served
    archive(past, first).claim()
    with pytest.raises(OccupiedError, match="the past of a copy"):
        other.claim()  # the first was served anew since then

    other = archive(past, copied())
    one.remove("uid/nothing")
    other.claim()
    other.remove("uid/nothing")
    for attempt in (
        lambda: one.remove("uid/name"),
        lambda: one.write("uid/later.batches.parquet", b"what the other one would take for nobody's"),
        lambda: archive(past, first).claim(),
    ):
        with pytest.raises(OccupiedError, match=f"the past of a copy of this database.* remove {CLAIMS}/same"):
            attempt()
    assert [each.name for each in (past / "uid").iterdir()] == ["name.batches.parquet"]
    (past / CLAIMS / "same").unlink()
    one.remove("uid/name")
    assert not (past / "uid").exists()
    with pytest.raises(OccupiedError, match="the past of a copy"):
        other.remove("uid/name")


def test_a_copy_of_a_disk_which_has_the_same_name_is_noticed_before_anything_is_removed(tmp_path):
    first, copies = tmp_path / "first", (tmp_path / f"copy {number}" for number in count())
    first.mkdir()
    require_noticed(tmp_path / "past", FolderMarks(first), lambda: FolderMarks(shutil.copytree(first, next(copies))))


def test_a_claim_of_which_a_store_keeps_a_part_is_that_of_its_owner(tmp_path):
    data, past = tmp_path / "data", tmp_path / "past"
    data.mkdir()
    archive(past, FolderMarks(data)).claim()
    copy = FolderMarks(shutil.copytree(data, tmp_path / "copy"))
    for size in range(len((past / CLAIMS / "same").read_bytes())):
        archive(past, FolderMarks(data)).claim()
        claim = past / CLAIMS / "same"
        claim.write_bytes(claim.read_bytes()[:size])
        archive(past, FolderMarks(data)).claim()
    claim.write_bytes(claim.read_bytes()[:-1])
    with pytest.raises(OccupiedError, match="the past of a copy of this database"):
        archive(past, copy).claim()


def test_a_place_that_cannot_be_written_adds_no_marks(tmp_path):
    (tmp_path / "data").mkdir()
    past, marks = tmp_path / "past", FolderMarks(tmp_path / "data")
    found = archive(past, marks)
    past.write_text("in the way")
    for _ in range(3):
        with pytest.raises(OSError, match="File exists"):
            found.claim()
    past.unlink()
    found.claim()
    assert len(marks.known()) == 2  # who takes a place that nobody has, and then the process


@slow
def test_a_copy_of_the_files_of_postgresql_is_noticed_too(tmp_path):
    with ExitStack() as stack:
        original = stack.enter_context(postgresql())
        original.query("CREATE SCHEMA dynhull", database="postgres")

        def marks(database):
            return DatabaseMarks(Database(database.url("postgres")))

        require_noticed(
            tmp_path / "past", marks(original), lambda: marks(stack.enter_context(postgresql(copied=original)))
        )


def test_a_folder_of_an_earlier_version_goes_on(tmp_path):
    """Its claim has no mark."""
    data, past = tmp_path / "data", tmp_path / "past"
    for _ in range(2):
        with server_process("--data", str(data), "--history-dir", str(past), *QUIET):
            pass
        (claim,) = (past / CLAIMS).iterdir()
        about, _, mark = claim.read_text().partition("\n")
        assert mark in FolderMarks(data).known()
        claim.write_text(about)
        (data / "dynhull.marks").unlink()
