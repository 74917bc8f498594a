"""The past of hulls in an object store: as in a folder, and never in the way while the store fails or hangs."""

import os
import time

import pytest
from command_line import dynhull
from filed_fleet import KEYS, Fleet, read_back
from folders import no_progress, same
from object_store import BUCKET, CREDENTIALS, OBJECT, object_store, place
from patience import wait_until
from proxy import Proxy

from dynhull.keys import PackedKeys
from dynhull_server.state.records import Delete
from dynhull_server.storage.past import EraseRequest
from dynhull_server.storage.port import DamagedError, StorageError
from dynhull_server.storage.rows import storage
from dynhull_server.storage.segments import objects as store_calls
from dynhull_server.storage.segments.archive import ORPHAN_SECONDS
from dynhull_server.storage.segments.objects import ObjectArchive
from dynhull_server.storage.segments.owner import Claimant, OccupiedError
from dynhull_server.storage.sqlite import copies
from dynhull_server.storage.sqlite.owner import FolderMarks

DAY = 2 * ORPHAN_SECONDS
with_all_objects = pytest.mark.only_with("OBJECTS_CASES")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("store")
    with object_store(folder) as address, pytest.MonkeyPatch.context() as patch:
        for name, value in CREDENTIALS.items():
            patch.setenv(name, value)
        proxy = Proxy(address)
        yield folder / BUCKET, proxy, address
        proxy.close()


@pytest.fixture
def fleet(store, tmp_path):
    folder, proxy, address = store
    proxy.server = address
    proxy.flowing.set()
    fleet = Fleet(tmp_path, archive=ObjectArchive(place(proxy.address, tmp_path.name)))
    fleet.objects = folder / tmp_path.name
    fleet.proxy, fleet.address = proxy, address
    yield fleet
    fleet.storage.close()


def objects(fleet):
    return sorted(each for each in fleet.objects.rglob(f"*.parquet{OBJECT}"))


def test_the_past_is_in_objects_each_written_once(fleet):
    fleet.fill(4)
    for _ in range(2):
        same(read_back(fleet.storage, len(fleet.records)), fleet.records)
        fleet.storage.close()
        fleet.storage = fleet.make()
        assert fleet.storage.open(no_progress).notes == []
    before = objects(fleet)
    assert sum(each.stat().st_size for each in before) == fleet.storage.history(1).bytes > 0
    fleet.storage.close()
    copy = fleet.folder / "copy"
    list(copies.copy_all([(fleet.folder / "data", copy)], no_progress, history=place(fleet.address, fleet.folder.name)))
    assert copies.check(copy, no_progress).notes == []
    assert len(list(copy.rglob("*.parquet"))) == len(before)
    fleet.storage = fleet.make()
    fleet.storage.open(no_progress)
    steps = fleet.storage.erase(1, [EraseRequest(PackedKeys.pack(KEYS[:1]))], len(fleet.records), fleet.time)
    fleet.carry_out(steps)
    assert not set(before) <= set(objects(fleet))
    assert all(KEYS[0] not in each.rows.keys for each in read_back(fleet.storage, fleet.storage.oldest(1)))
    fleet.storage.commit([Delete(1)])
    fleet.file()
    assert objects(fleet) == []


def test_a_place_is_claimed_once_it_can_be_seen_that_nobody_else_has_it(fleet):
    fleet.archive.owner = Claimant("first", "the first one")
    fleet.proxy.server = ""
    fleet.proxy.cut()
    with pytest.raises(OSError, match=r"(?i)store|AWS|connect"):
        fleet.archive.claim()
    fleet.proxy.server = fleet.address
    fleet.fill(2)
    assert len(objects(fleet)) > 0
    other = ObjectArchive(place(fleet.address, fleet.folder.name))
    other.owner = Claimant("other", "the other one")
    before = objects(fleet)
    for change in (other.claim, lambda: other.remove("uid/name"), lambda: other.write("uid/name", b"content")):
        with pytest.raises(OccupiedError, match=r"another database, the first one: .* remove dynhull\.owners/first"):
            change()
    assert objects(fleet) == before


def test_a_store_that_keeps_something_else_than_a_claim_is_named_and_is_taken_for_no_other_database(fleet, monkeypatch):
    def claim(data):
        archive = ObjectArchive(place(fleet.address, fleet.folder.name))
        archive.owner = Claimant("same", "the data folder", FolderMarks(data))
        return archive.claim

    name = "AWS_REQUEST_CHECKSUM_CALCULATION"
    monkeypatch.delenv(name)
    for _ in range(2):
        wrong = claim(fleet.folder)
        for _ in range(2):
            with pytest.raises(OSError, match="does not keep what it is sent"):
                wrong()
    monkeypatch.setenv(name, CREDENTIALS[name])
    copy = fleet.folder / "copy"
    copy.mkdir()
    with pytest.raises(OccupiedError, match="a copy of this database"):
        claim(copy)()
    claim(fleet.folder)()
    with pytest.raises(OccupiedError, match="a copy of this database"):
        claim(copy)()


@pytest.mark.parametrize("fault", ["silent", "refusing", pytest.param("away", marks=with_all_objects)])
def test_while_the_store_fails_the_journal_keeps_what_is_due_and_takes_more(fleet, fault, monkeypatch):
    fleet.fill(2)
    before = fleet.storage.history(1).batches
    fleet.put(4)
    fleet.snapshot()
    if fault == "refusing":
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "hush")
        fleet.archive._made = None
    elif fault == "away":
        fleet.proxy.server = ""
        fleet.proxy.cut()
    else:
        fleet.proxy.silence()
        fleet.proxy.flowing.clear()
        monkeypatch.setattr(fleet.archive, "_seconds", 0.5)
    for _ in range(2):
        with pytest.raises(OSError, match=r"(?i)store|AWS|uploading|timed out") as raised:
            fleet.file()
        assert "hush" not in str(raised.value)
        begun = time.monotonic()
        fleet.put(4)
        assert time.monotonic() - begun < 1.0
        fleet.snapshot()
    if fault == "silent":
        with pytest.raises(StorageError, match="cannot be read"):
            fleet.make_reader().batches(1, 0, 1)
    assert fleet.storage.history(1).batches == before
    fleet.proxy.flowing.set()
    fleet.proxy.server = fleet.address
    monkeypatch.undo()
    if fault == "refusing":
        fleet.archive._made = None
    fleet.file()
    assert fleet.storage.history(1).batches > before
    same(read_back(fleet.storage, len(fleet.records)), fleet.records)
    assert len(objects(fleet)) == sum(
        1 + (each.facts.state_bytes > 0) for each in fleet.storage._ledger.hulls[1].segments
    )


def test_who_reads_while_the_store_hangs_hears_in_time_for_what_it_waits(fleet, monkeypatch):
    """And others do not wait one behind the other."""
    fleet.fill(3)
    monkeypatch.setattr(store_calls, "READ_SECONDS", 0.5)
    fleet.archive.rest = 3.0
    fleet.proxy.silence()
    fleet.proxy.flowing.clear()
    reader, begun = fleet.make_reader(), time.monotonic()
    for _ in range(20):
        with pytest.raises(StorageError, match="revisions 1 to 7 cannot be read") as refused:
            reader.batches(1, 0, 1)
        assert refused.value.for_callers.endswith(
            "cannot be read at present: the object store has not answered for 1 s"
        )
    assert time.monotonic() - begun < 3.0
    fleet.proxy.flowing.set()

    def read():
        try:
            return reader.batches(1, 0, 1)
        except StorageError:
            return []

    wait_until(read)
    same(read_back(reader, len(fleet.records)), fleet.records)


def test_without_threads_for_calls_the_store_is_asked_again_later(fleet, monkeypatch):
    fleet.fill(3)
    reader = fleet.make_reader()

    def refuse(_):
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(store_calls.Thread, "start", refuse)
        for _ in range(store_calls.CALLS + 1):  # none of them keeps the place of a call
            with pytest.raises(StorageError, match="can't start new thread"):
                reader.batches(1, 0, 1)
    same(read_back(reader, len(fleet.records)), fleet.records)


def test_an_object_that_was_cut_exchanged_or_lost_is_refused_by_its_name(fleet):
    fleet.fill(3)
    first, *_ = objects(fleet)
    content = first.read_bytes()
    for other, problem in ((content[:-1], "cut"), (b"x" * len(content), "changed"), (None, "missing")):
        if other is None:
            first.unlink()
        else:
            first.write_bytes(other)
        with pytest.raises(DamagedError, match=f"{first.name.removesuffix(OBJECT)}.*{problem}"):
            read_back(fleet.make_reader(), 3)


def test_what_an_owner_sends_later_is_removed_after_a_day(fleet, monkeypatch):
    elapsed = 0.0
    monkeypatch.setattr(storage, "monotonic", lambda: elapsed)
    fleet.fill(2)
    uid = "0123"
    late = [fleet.archive.name(uid, 1, 8, epoch) for epoch in (1, 1, 7)]
    for file in late:
        fleet.archive.write(file + ".batches.parquet", b"late")
    old = time.time() - DAY
    for each in (late[0], late[2]):
        os.utime(fleet.objects / f"{each}.batches.parquet{OBJECT}", (old, old))
    for each in objects(fleet):  # a hull has these
        if each.name.split(".")[0] not in {file.split("/")[1] for file in late}:
            os.utime(each, (old, old))
    before = len(objects(fleet))
    fleet.storage.epoch = 7
    fleet.time -= 365 * 86_400 * 10**6  # the clock is set back
    fleet.file()
    assert len(objects(fleet)) == before
    elapsed += storage.LOOK
    fleet.file()
    assert len(objects(fleet)) == before - 1
    assert not (fleet.objects / f"{late[0]}.batches.parquet{OBJECT}").exists()
    same(read_back(fleet.storage, len(fleet.records)), fleet.records)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ("s3://AKIA1:hush@bucket/prefix", "credentials"),
        ("s3://AKIA1:hu/sh@bucket/prefix", "credentials"),
        ("s3://AKIA1%3Ahush%40bucket/prefix", "credentials"),
        ("s3://AKIA1%253Ahush%2540bucket/prefix", "credentials"),
        ("s3://bucket/AKIA1:hush%40prefix", "credentials"),
        ("s3://bucket/prefix?access_key=AKIA1&secret_key=hush", "more than"),
        ("s3://bucket?endpoint_override=http://AKIA1:hush@localhost", "credentials"),
        ("gs://hush/AKIA1", "neither"),
        ("s3:///hush-AKIA1", "neither"),
    ],
)
def test_secrets_in_the_address_are_refused_and_not_repeated(given, problem, monkeypatch):
    for command in ("config", "check"):
        result = dynhull(command, "--history-dir", given)
        assert result.exit_code
        assert problem in " ".join(result.stderr.split())
        assert "hush" not in result.output + result.stderr
        assert "AKIA1" not in result.output + result.stderr
    monkeypatch.setenv("DYNHULL_HISTORY_DIR", given)
    assert "hush" not in dynhull("config").stderr
