"""Backup, restore, check and export, as commands, beside servers that run or were killed."""

import resource
import signal
import sqlite3
import subprocess
import sys
from collections import Counter
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pytest
from cases import slow
from command_line import dynhull
from folders import (
    DATABASE,
    LOG,
    OLD_FOLDERS,
    append,
    fill,
    flip,
    killed,
    no_progress,
    opened,
    record,
    records,
    same,
    snapshot,
    stopped,
)
from forked import COMMAND, Process
from server_process import PATIENCE, server_process

from dynhull_client import HullClient
from dynhull_server.state.records import (
    Append,
    Contents,
    Create,
    Delete,
    HullRow,
    HullSettings,
    Kept,
    PointRows,
    Record,
    Shares,
    Tally,
)
from dynhull_server.storage.port import LockedError, StorageError
from dynhull_server.storage.sqlite import copies
from dynhull_server.storage.sqlite.log import FRAME_HEADER_BYTES
from dynhull_server.storage.sqlite.log import HEADER_BYTES as LOG_HEADER_BYTES

NEXT_START = "the server that runs does not read its log again, but the next one would find"
UNFINISHED = "is an unfinished copy: remove it, and copy again"


def done(*command, says):
    """Run a command that must succeed; `says` is its last line."""
    finished = dynhull(*command)
    assert finished.exit_code == 0, finished.stderr
    assert finished.stdout.splitlines()[-1] == says
    return finished


def refused(*command, says, code=2):
    """Run a command that must fail; `says` is in its error message."""
    finished = dynhull(*command)
    assert finished.exit_code == code
    assert says in finished.stderr
    assert "Traceback" not in finished.stderr


def served(folder, last, number=1):
    """Open a folder as a server does, and check what it holds."""
    storage, contents = opened(folder)
    same(storage.read(number).records, records(1, last))
    storage.close()
    return contents


def commits(storage):
    """The commit of each revision."""
    return [[each.committed for each in storage.read(number).records] for number in (1, 2)]


@pytest.fixture
def paths(tmp_path):
    return [tmp_path / name for name in ("data", "copy", "new")]


def test_backup_beside_a_server_and_restore(paths):
    data, copy, new = paths
    storage, _ = opened(data)
    fill(storage, 5)
    fill(storage, 3, "a/b", 2)
    before = commits(storage)
    done("backup", copy, "--data", data, says=f"{copy}: 2 hulls")
    append(storage, 6, 6)
    refused("backup", copy, "--data", data, says=f"{copy} is not empty")
    assert [file.name for file in copy.iterdir()] == [DATABASE]
    done("restore", copy, "--data", new, says=f"{new}: 2 hulls")
    refused("restore", copy, "--data", new, says=f"{new} is not empty")
    assert served(new, 5).notes == []
    assert served(copy, 3, 2).notes == []
    storage.close()
    for folder in (copy, new):
        storage, contents = opened(folder)
        assert commits(storage) == before
        assert contents.committed == max(each.time for records in before for each in records)
        storage.close()


def test_every_copy_has_uids_of_its_own(paths, tmp_path):
    data, copy, new = paths
    storage, _ = opened(data)
    storage.commit([Create(HullRow(1, "a", "0f1e", 0.0))])
    fill(storage, 3, "b", 2)
    storage.close()
    uids = []
    for command, source, target in (("backup", data, copy), ("restore", copy, new), ("restore", copy, tmp_path / "2")):
        copied = [target, "--data", source] if command == "backup" else [source, "--data", target]
        done(command, *copied, says=f"{target}: 2 hulls")
        done("check", target, says=f"{target}: 2 hulls, all whole")
        storage, contents = opened(target)
        uids.append([each.uid for each in contents.hulls])
        storage.close()
    assert len({uid for (uid, _) in uids}) == 3
    assert {uid.partition(".")[0] for (uid, _) in uids} == {"0f1e"}
    for first, second in uids:
        assert first.partition(".")[2] == second.partition(".")[2]


def test_a_backup_takes_the_moment_it_began_at(paths):
    """Commits go on meanwhile, as fast as they can."""
    data, copy, _ = paths
    storage, _ = opened(data)
    storage.commit([Create(HullRow(1, "large", "", 0.0))])
    batch = np.zeros((50_000, 2))
    for revision in range(1, 21):
        storage.commit([Append(1, [Record(revision, PointRows(batch, batch[:0]))])])
    with Process([COMMAND, "backup", copy, "--data", data]) as backup:
        revision = 20
        while backup.poll() is None:
            revision += 1
            storage.commit([Append(1, [Record(revision, PointRows(batch[:1], batch[:0]))])])
    assert backup.returncode == 0
    storage.close()
    storage, contents = opened(copy)
    assert 20 <= storage.read(1).last_revision < revision
    assert contents.notes == []
    storage.close()


def test_restore_takes_the_log_along(paths, tmp_path):
    data, copy, new = paths
    storage, _ = opened(data)
    fill(storage, 9)
    fill(storage, 2, "b", 2)
    crash = killed(data, tmp_path / "crash")
    storage.close()
    done("check", crash, says=f"{crash}: 2 hulls, all whole")
    done("restore", crash, "--data", new, says=f"{new}: 2 hulls")
    assert served(new, 9).notes == []
    # A backup that was served, by a server that was killed.
    done("backup", copy, "--data", crash, says=f"{copy}: 2 hulls")
    storage, _ = opened(copy)
    append(storage, 10, 12)
    crash = killed(copy, tmp_path / "crash of the copy")
    storage.close()
    done("restore", crash, "--data", tmp_path / "newer", says=f"{tmp_path / 'newer'}: 2 hulls")
    assert served(tmp_path / "newer", 12).notes == []


@pytest.mark.parametrize(
    ("folder", "hulls", "points", "revision"),
    [
        ("format1/stopped", 2, 83, 30),
        ("format1/killed", 2, 92, 33),
        ("format2/stopped", 3, 128, 40),
        ("format2/killed", 3, 139, 43),
    ],
)
def test_a_backup_of_an_earlier_format_is_checked_restored_and_exported(tmp_path, folder, hulls, points, revision):
    old = killed(OLD_FOLDERS / folder, tmp_path / "old")
    before = Counter(file.read_bytes() for file in old.iterdir())
    done("check", old, says=f"{old}: {hulls} hulls, all whole")
    done("restore", old, "--data", tmp_path / "new", says=f"{tmp_path / 'new'}: {hulls} hulls")
    done("check", tmp_path / "new", says=f"{tmp_path / 'new'}: {hulls} hulls, all whole")
    file = tmp_path / "points.csv"
    done("export", "fleet", file, "--data", old, says=f"{file}: {points} points of fleet at revision {revision}")
    assert before <= Counter(file.read_bytes() for file in old.iterdir())


def test_a_damaged_backup_is_not_restored(paths):
    data, copy, new = paths
    stopped(data)
    done("backup", copy, "--data", data, says=f"{copy}: 1 hull")
    flip(copy / DATABASE, record(4).rows.inserts.tobytes())
    refused(
        "restore", copy, "--data", new, says="hull 'fleet': revisions 4 to 4 are damaged, and later ones exist", code=1
    )
    assert not new.exists()


def test_what_is_left_is_restored_where_loss_is_accepted(paths, tmp_path):
    data, _, new = paths
    storage, _ = opened(data)
    fill(storage, 5)
    storage.close()
    storage, _ = opened(data)
    append(storage, 6, 9)
    crash = killed(data, tmp_path / "crash")
    storage.close()
    (crash / LOG).unlink()
    refused("restore", crash, "--data", new, says="dynhull restore --accept-loss", code=1)
    finished = done("restore", crash, "--data", new, "--accept-loss", says=f"{new}: 1 hull")
    assert "copied without what is lost" in finished.stderr
    assert served(new, 5).notes == []


KILLED = """
import os, signal, sys
from pathlib import Path
from dynhull_server.storage.sqlite import copies

left = int(sys.argv[4])

def strike(*_):
    global left
    left -= 1
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)

sync = os.fsync
if sys.argv[3] == "fsync":
    os.fsync = lambda descriptor: (strike(), sync(descriptor))
if sys.argv[3] == "examine":
    finish = copies._finish
    copies._finish = lambda *given, **named: (strike(), finish(*given, **named))[1]
copies.copy(Path(sys.argv[1]), Path(sys.argv[2]), strike if sys.argv[3] == "progress" else lambda *_: None)
"""


@slow
@pytest.mark.parametrize(
    ("where", "nth", "whole"),
    [
        ("progress", 1, False),
        pytest.param("progress", 3, False, marks=slow),
        ("examine", 1, False),
        ("fsync", 1, False),
        ("fsync", 2, True),
        pytest.param("fsync", 3, True, marks=slow),
    ],
)
def test_half_a_copy_is_never_taken_for_one(paths, where, nth, whole):
    data, copy, new = paths
    storage, _ = opened(data)
    fill(storage, 9)
    for number in range(2, 5):
        fill(storage, 1, f"hull {number}", number)
        for step in storage.snapshot(number, Kept(1, Contents(np.zeros((200_000, 2))))):
            storage.commit([step])
    storage.close()
    command = [sys.executable, "-c", KILLED, data, copy, where, str(nth)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    if whole:
        assert len(served(copy, 9).hulls) == 4
        return
    with pytest.raises(StorageError, match=UNFINISHED):
        opened(copy)
    for source, target in ((copy, new), (data, copy)):
        with pytest.raises(StorageError, match=UNFINISHED):
            copies.copy(source, target, no_progress)
    if where == "examine":
        # In a process of its own: a server answers for loops that other tests here have closed.
        serve = [COMMAND, "serve", "--port", "0", "--data", copy]
        finished = subprocess.run(serve, capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert finished.returncode == 2
        assert UNFINISHED in finished.stderr
        assert "Traceback" not in finished.stderr
        refused("restore", copy, "--data", new, says=UNFINISHED)
        refused("check", copy, says=UNFINISHED)
    assert not new.exists()


def test_a_copy_that_fails_leaves_nothing(paths):
    data, copy, _ = paths
    stopped(data, 300)
    limited = ["sh", "-c", 'ulimit -f 64; exec "$0" "$@"', COMMAND, "backup", copy, "--data", data]
    finished = subprocess.run(limited, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert finished.returncode == 2
    assert f"error: {data} cannot be copied to {copy}" in finished.stderr
    assert not copy.exists()


def test_a_server_starts_beside_a_backup_that_began_before_it(paths):
    data, copy, _ = paths
    storage, _ = opened(data)
    fill(storage, 9)

    def restart(*_):
        nonlocal storage
        if storage is not None:
            storage.close()
            storage = None
            again, contents = opened(data)
            assert contents.notes == []
            append(again, 10, 12)
            again.close()

    copies.copy(data, copy, restart)
    assert storage is None
    assert served(copy, 9).notes == []
    assert served(data, 12).notes == []


def test_a_server_waits_for_a_command_that_reads_a_stopped_folder(paths):
    data, copy, _ = paths
    stopped(data)
    refusals = []

    def start(*_):
        with pytest.raises(LockedError) as refusal:
            opened(data)
        refusals.append(str(refusal.value))

    copies.copy(data, copy, start)
    assert "another server or command uses" in refusals[0]


def test_check_beside_a_server(paths):
    data, *_ = paths
    storage, _ = opened(data)
    fill(storage, 5)
    done("check", data, says=f"{data}: 1 hull, all whole")
    append(storage, 6, 9)
    storage.close()
    assert served(data, 9).notes == []


def test_check_beside_a_server_says_of_the_log_what_the_next_start_would(paths, tmp_path):
    """A bit of each word of headers, and of pages, is another one for a moment: the server does not read them again."""
    data, *_ = paths
    with server_process("--data", str(data), "--log-level", "error", killed=True) as server:
        with HullClient(server.address) as client:
            client.create_hull("fleet")
            for x in range(3):
                client.apply("fleet", insert=[[x, 0]])
        log = data / LOG
        content = log.read_bytes()
        page_bytes = int.from_bytes(content[8:12])
        frames = range(LOG_HEADER_BYTES, len(content), FRAME_HEADER_BYTES + page_bytes)
        ends = [start for start in frames if int.from_bytes(content[start + 4 : start + 8])]
        places = [*range(0, LOG_HEADER_BYTES, 4)]
        for start in {frames[0], *ends[-2:], frames[-1]}:
            places += [*range(start, start + FRAME_HEADER_BYTES, 4), start + FRAME_HEADER_BYTES + page_bytes // 2]
        words = {}
        for place in places:
            with log.open("r+b") as file:
                file.seek(place)
                file.write(bytes([content[place] ^ 16]))
                file.flush()
                crash = killed(data, tmp_path / str(place))
                words[place] = verdict(checked, data), verdict(started, crash)
                file.seek(place)
                file.write(content[place : place + 1])
        assert verdict(checked, data) == ""
        server.process.kill()
    for beside, start in words.values():
        assert beside.replace(str(data), "") == (start and f"{NEXT_START}: {start}")
    assert sum("restore" in start for _, start in words.values()) > len(places) / 3


def verdict(examine, folder):
    """What is found wrong with a folder; empty for nothing."""
    try:
        return "; ".join(examine(folder))
    except StorageError as error:
        return str(error)


def checked(folder):
    """What a check complains about that is no reason against serving."""
    return copies.check(folder, no_progress).notes


def started(folder):
    """What a start on a folder complains about, without the path of the folder."""
    try:
        storage, contents = opened(folder)
    except StorageError as error:
        raise StorageError(str(error).replace(str(folder), "")) from error
    storage.close()
    return [note.replace(str(folder), "") for note in contents.notes]


def test_check_says_what_is_damaged(paths):
    data, *_ = paths
    storage, _ = opened(data)
    fill(storage, 10)
    fill(storage, 2, "whole", 2)
    fill(storage, 2, "gone", 3)
    for revision in (10, 20, 30):
        snapshot(storage, revision)
        append(storage, revision + 1, revision + 10)
    older = storage.read(1, 25).contents.points
    storage.commit([Delete(3)])
    storage.close()
    content = (data / DATABASE).read_bytes()
    flip(data / DATABASE, older.tobytes())
    finished = dynhull("check", data)
    assert finished.exit_code == 1
    assert finished.stdout.splitlines() == [
        "fleet: revision 40, 20 rows of batches, snapshots at 20, 30: DAMAGED",
        "whole: revision 2, 2 rows of batches: whole",
        f"{data}: damaged; it can be served without the parts named above",
    ]
    assert finished.stderr == "hull 'fleet': the snapshot at revision 20 is damaged, and was dropped\n"
    (data / DATABASE).write_bytes(content)
    flip(data / DATABASE, record(35).rows.inserts.tobytes())
    finished = dynhull("check", data)
    assert finished.exit_code == 1
    assert finished.stdout.splitlines()[-1] == f"{data}: damaged; it cannot be served: restore a backup"
    assert "hull 'fleet': revisions 35 to 35 are damaged, and later ones exist" in finished.stderr
    (data / DATABASE).write_bytes(content)
    done("check", data, says=f"{data}: 2 hulls, all whole")
    assert (data / DATABASE).read_bytes() == content


def test_every_command_warns_of_a_commit_that_was_under_way(paths, tmp_path):
    data, copy, _ = paths
    file = tmp_path / "points.csv"
    warning = "incomplete or damaged and was dropped, with at most 1 of the newest commits"
    storage, _ = opened(data)
    fill(storage, 9)
    crash = killed(data, tmp_path / "crash")
    storage.close()
    log = (crash / LOG).read_bytes()
    (crash / LOG).write_bytes(log[: log.rindex(record(9).rows.inserts.tobytes()) + 10])
    exported = done("export", "fleet", file, "--data", crash, says=f"{file}: 24 points of fleet at revision 8")
    copied = done("backup", copy, "--data", crash, says=f"{copy}: 1 hull")
    assert all(warning in finished.stderr for finished in (exported, copied))
    checked = dynhull("check", crash)
    assert checked.exit_code == 1
    assert warning in checked.stderr
    with server_process("--data", str(crash), complaints=warning) as server, HullClient(server.address) as client:
        assert client.get_hull("fleet").revision == 8
    done("check", crash, says=f"{crash}: 1 hull, all whole")
    refused("export", "boats", file, "--data", copy, says=f"there is no hull 'boats' in {copy}")


@pytest.mark.parametrize("suffix", ["csv", "parquet", "geojson"])
def test_export_and_import(tmp_path, suffix):
    data, file = tmp_path / "data", tmp_path / f"points.{suffix}"
    given = np.concatenate(
        [np.random.default_rng(4).normal(size=(20_000, 2)), [[1e308, -5e-324], [0.1, 0.2], [0.1, 0.2]]]
    )
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("from")
        client.apply("from", insert=given)
        done("export", "from", file, "--data", data, says=f"{file}: 20,003 points of from at revision 1")
        words = "to: 20,003 points loaded, 20,003 in the hull"
        done("import", "to", file, "--address", server.address, says=words)
        dynhull("export", "to", tmp_path / "again.csv", "--data", data)
    again = np.loadtxt(tmp_path / "again.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(sorted_rows(again), sorted_rows(given))


@pytest.fixture
def large(tmp_path):
    """A folder with a hull of 20,000 points."""
    storage, _ = opened(tmp_path / "data")
    storage.commit([Create(HullRow(1, "fleet", "0123", 12.5))])
    storage.commit([Append(1, [record(1, 20_000)])])
    storage.close()
    return tmp_path / "data"


@contextmanager
def full_beyond(size):
    """No file can be written beyond a size, as on a disk that is full then."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "geojson"])
def test_an_export_that_fails_leaves_what_was_there(tmp_path, large, suffix):
    folder = tmp_path / "exported"
    folder.mkdir()
    file, link = folder / f"fleet.{suffix}", folder / f"link.{suffix}"
    file.write_text("of yesterday")
    link.symlink_to(file)
    with full_beyond(2**16):
        refused("export", "fleet", link, "--data", large, says="File too large")
    assert link.read_text() == "of yesterday"
    assert sorted(folder.iterdir()) == [file, link]
    done("export", "fleet", link, "--data", large, says=f"{link}: 20,000 points of fleet at revision 1")
    assert link.is_symlink()
    assert file.stat().st_size > 2**16


def sorted_rows(points):
    return points[np.lexsort((points[:, 1], points[:, 0]))]


def test_a_database_of_something_else(tmp_path):
    with closing(sqlite3.connect(tmp_path / DATABASE)) as connection:
        connection.executescript("CREATE TABLE a (b); DROP TABLE a")
    refused("check", tmp_path, says=f"{tmp_path} is no data folder: its {DATABASE} is empty")
    (tmp_path / DATABASE).write_bytes(b"no database" * 400)
    refused("check", tmp_path, says="cannot be read (file is not a database): restore a backup", code=1)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["backup", "copy", "--data", "nowhere"], "nowhere is no data folder: it has no dynhull.db"),
        (["check", "nowhere"], "nowhere is no data folder: it has no dynhull.db"),
        (["export", "h", "points.csv", "--data", "nowhere"], "nowhere is no data folder: it has no dynhull.db"),
        (["export", "h", "points.xls"], "the name must end in .csv, .parquet, .geojson"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(tmp_path, monkeypatch, command, message):
    monkeypatch.chdir(tmp_path)
    refused(*command, says=message)


# Hulls over shards


def divided_folder(data, last=6):
    """A root and its shard, both at revision `last` with a snapshot at 3 and at 5; the shard has one step more."""
    storage, _ = opened(data)
    root = HullRow(1, "fleet", "uid", 0.0, HullSettings(shards=1))
    shard = HullRow(2, "fleet#uid.0", "uid", 0.0, HullSettings(shards=1, shard=0))
    storage.commit([Create(root), Create(shard)])
    for step in range(1, last + 2):
        storage.commit([Append(2, [replace(record(step), producer="steps", sequence=step)])])
        if step <= last:
            storage.commit([Append(1, [replace(record(step), shares=Shares({0: Tally(step, 3 * step, 3 * step)}))])])
        if step in (3, 5):
            of_shard = Kept(step, Contents(record(1).rows.inserts), {"steps": step})
            of_root = Kept(step, Contents(record(1).rows.inserts), tallies={0: Tally(step)})
            for number, kept in ((2, of_shard), (1, of_root)):
                for each in storage.snapshot(number, kept):
                    storage.commit([each])
    storage.close()


@pytest.mark.parametrize(("before", "kept"), [(0, None), (2, None), (3, 3), (4, 4), (6, 6), (9, 6)])
def test_roots_and_shards_are_led_back_to_the_revision_before(paths, monkeypatch, before, kept):
    data, copy, _ = paths
    divided_folder(data)
    monkeypatch.setattr(copies.divided, "revisions", lambda _: {"uid": before})
    if kept is None:
        refused("backup", copy, "--data", data, says="the folder changes faster than it can be read")
        assert not copy.exists()
        return
    done("backup", copy, "--data", data, says=f"{copy}: 1 hull, 1 shard")
    storage, contents = opened(copy)
    assert contents.notes == []
    assert [storage.read(number).last_revision for number in (1, 2)] == [kept, kept]
    storage.close()


@pytest.mark.parametrize("lost", ["steps", "the shard"])
def test_a_root_whose_shard_has_lost_what_was_decided_is_not_copied(paths, lost):
    data, copy, _ = paths
    divided_folder(data)
    storage, _ = opened(data)
    if lost == "steps":
        storage.commit([storage.cut(2, 5)])
    else:
        storage.commit([Delete(2)])
    storage.close()
    says = "is at step 5, not 6" if lost == "steps" else "is missing"
    refused("backup", copy, "--data", data, says=f"shard 0 of hull 'fleet' {says}", code=1)
    refused("check", data, says=f"shard 0 of hull 'fleet' {says}", code=1)
    refused("export", "fleet", copy.with_suffix(".csv"), "--data", data, says=says, code=1)
