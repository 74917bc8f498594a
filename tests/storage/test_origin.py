"""A start tells a copy of a folder from the folder itself."""

import os
import shutil

import pytest
from faulty_disk import FaultyDisk, failure
from folders import fill, fill_fence, no_progress, opened

from dynhull_server.state.fences.model.records import EventType
from dynhull_server.storage import worker_folders
from dynhull_server.storage.port import StorageError
from dynhull_server.storage.sqlite.origin import NOTE
from dynhull_server.storage.sqlite.storage import SQLiteStorage


def started(folder, disk=None):
    """What a start finds, and the events of its fence and what the consumer of these has lost."""
    storage = SQLiteStorage(folder, disk=disk)
    try:
        found = storage.open(no_progress)
        numbers = [row.number for row in found.fences]
        events = [(event.type, event.sequence) for each in numbers for event in storage.read_events(each, 0, 9)]
        lost = [each.consumers["mail"].lost for each in storage.read_fences(numbers)]
    finally:
        storage.close()
    return found, events, lost


def uids(folder):
    found, *_ = started(folder)
    return [row.uid for row in (*found.hulls, *found.fences)]


@pytest.fixture
def folder(tmp_path):
    storage, _ = opened(tmp_path / "data")
    fill(storage, 3)
    fill_fence(storage, 3)
    storage.close()
    return tmp_path / "data"


def test_a_folder_that_is_moved_is_the_same(folder, tmp_path):
    before = uids(folder)
    moved = folder.rename(tmp_path / "moved")
    for file in moved.iterdir():
        file.chmod(0o600)
        os.utime(file, (0, 0))
    assert uids(moved) == before == uids(moved)


def test_a_copy_is_another_incarnation_once(folder, tmp_path):
    before, copy = uids(folder), tmp_path / "copy"
    shutil.copytree(folder, copy)
    found, events, lost = started(copy)
    assert [note for note in found.notes if "is a copy" in note]
    after = [row.uid for row in (*found.hulls, *found.fences)]
    assert [uid.partition(".")[0] for uid in after] == before
    assert all(uid != earlier for uid, earlier in zip(after, before, strict=True))
    assert (events, lost) == ([(EventType.SNAPSHOT, 5)], [3])
    assert uids(copy) == after
    assert uids(folder) == before


def test_who_replaces_a_folder_with_a_copy_of_it(folder, tmp_path):
    """The file may even get the number that the one before had."""
    before, copy = uids(folder), tmp_path / "copy"
    shutil.copytree(folder, copy)
    shutil.rmtree(folder)
    shutil.copytree(copy, folder)
    assert all(uid != earlier for uid, earlier in zip(uids(folder), before, strict=True))


def test_what_a_start_has_half_done_is_done_again(folder, tmp_path):
    before, copy, disk = uids(folder), tmp_path / "copy", FaultyDisk()
    shutil.copytree(folder, copy)
    disk.fail("DELETE FROM totals", failure(13))
    with pytest.raises(StorageError):
        started(copy, disk)
    found, events, lost = started(copy)
    assert found.hulls[0].uid != before[0]
    assert (events, lost) == ([(EventType.SNAPSHOT, 5)], [3])


def test_a_folder_without_a_note_is_taken_as_it_is(folder, tmp_path):
    """As one that an earlier version has served, or whose file system does not say when files were made."""
    before, copy = uids(folder), tmp_path / "copy"
    (folder / NOTE).unlink()
    shutil.copytree(folder, copy)
    assert uids(copy) == before
    shutil.copytree(copy, tmp_path / "another")
    assert uids(tmp_path / "another") != before


def test_an_empty_database_in_place_of_another_one_is_no_copy(folder):
    for file in folder.glob("dynhull.db*"):
        file.unlink()
    found, *_ = started(folder)
    assert not found.notes


def test_workers_are_one_incarnation(tmp_path):
    """The copy of one of their databases is one of what all of them have."""
    data = tmp_path / "workers"
    for number in range(2):
        storage, _ = opened(worker_folders.worker_folder(data, number))
        fill(storage, 1)
        storage.close()
    assert worker_folders.begin_anew_if_copied(data, 2) == []
    one = worker_folders.worker_folder(data, 1)
    shutil.copytree(one, tmp_path / "one")
    shutil.rmtree(one)
    shutil.copytree(tmp_path / "one", one)
    assert len(worker_folders.begin_anew_if_copied(data, 2)) == 2
    (first,), (second,) = (uids(worker_folders.worker_folder(data, number)) for number in range(2))
    assert first == second != "0123"
