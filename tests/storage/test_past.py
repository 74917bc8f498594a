"""Every storage reads hulls as they were: at a revision, or at a time."""

import shutil

import pytest
from folders import OLD_FOLDERS, no_progress, same, state
from test_contract import Opened, make, points, record, records, row  # noqa: F401  (make is a fixture)

from dynhull_server.state.records import Append, CommitStamp, Create
from dynhull_server.storage.past import Moment
from dynhull_server.storage.port import NEWEST, DamagedError
from dynhull_server.storage.sqlite.storage import SQLiteStorage

NOW = 1_000_000_000
SECOND = 1_000_000


@pytest.fixture
def opened(make):  # noqa: F811
    opened = Opened(make)
    yield opened
    opened.storage.close()


def recorded(opened, commits=12):
    """A hull with two batches a second; returns the stamps of its revisions."""
    stamps = [opened.storage.commit([Create(row(1))], NOW)]
    for second in range(1, commits + 1):
        first = 2 * second - 1
        stamp = opened.storage.commit([Append(1, records(first, first + 1))], NOW + second * SECOND)
        stamps += [stamp, stamp]
        opened.storage.commit([Create(row(1 + second))], NOW + second * SECOND)  # other commits come between
    return stamps


def all_batches(storage, after, until, number=1):
    found = []
    while after < until:
        some = storage.batches(number, after, until)
        assert some
        found += some
        after = some[-1].revision
    return found


def test_a_moment_is_the_last_revision_committed_until_then(opened):
    stamps = recorded(opened)
    for _ in range(2):
        for second in range(1, 13):
            for time, revision in ((NOW + second * SECOND, 2 * second), (NOW + second * SECOND - 1, 2 * second - 2)):
                found = opened.storage.moment(1, time)
                assert found.revision == revision
                assert revision == 0 or found.committed == stamps[revision]
        assert opened.storage.moment(1, NEWEST) == Moment(24, stamps[24])
        created = Moment(0, CommitStamp(0, round(row(1).created * SECOND)))
        assert opened.storage.oldest_moment(1) == created == opened.storage.oldest_moment(1, timed=True)
        assert opened.storage.moment(1, created.committed.time - 1) is None
        opened.reopen()


def test_a_state_and_the_batches_after_it_are_every_revision_that_is_kept(opened):
    stamps = recorded(opened)
    for revision in (5, 14):
        opened.snapshot(1, revision, points(9, revision))
    for _ in range(2):
        oldest = opened.storage.oldest_moment(1)
        assert oldest == Moment(5, stamps[5])
        assert opened.storage.moment(1, NOW + 2 * SECOND + 1) is None  # revision 4
        assert opened.storage.moment(1, NOW + 3 * SECOND) == Moment(6, stamps[6])
        for until in range(5, 25):
            kept = state(opened.storage, 1, until)
            assert (kept.revision, kept.records) == (14 if until >= 14 else 5, [])
            assert opened.storage.state_revision(1, until) == kept.revision
            assert kept.committed == stamps[kept.revision]
            same(kept.contents.points, points(9, kept.revision))
            same(all_batches(opened.storage, kept.revision, until), records(kept.revision + 1, until))
        for read in (opened.storage.state_revision, opened.storage.state):
            with pytest.raises(DamagedError, match="no longer kept"):
                read(1, 4)
        with pytest.raises(DamagedError, match="no longer kept"):
            opened.storage.batches(1, 4, 6)
        opened.reopen()


def test_a_snapshot_alone_knows_its_time(opened):
    stamps = recorded(opened, 2)
    for revision in (4, 4):
        opened.snapshot(1, revision, points(3))
    assert opened.storage.moment(1, NOW + 3 * SECOND) == Moment(4, stamps[4]) == opened.storage.oldest_moment(1)
    assert opened.storage.moment(1, NOW + 2 * SECOND - 1) is None


def test_batches_come_in_steps(opened):
    opened.create(1)
    opened.commit(Append(1, [record(1, 9000), record(2, 9000), record(3)]))
    opened.commit(*(Append(1, [record(revision, 1)]) for revision in range(4, 2000)))
    lengths, after = [], 0
    while after < 1999:
        some = opened.storage.batches(1, after, 1999)
        assert [each.revision for each in some] == list(range(after + 1, after + 1 + len(some)))
        lengths.append(len(some))
        after = some[-1].revision
    assert len(lengths) > 1
    assert opened.storage.batches(1, 1999, NEWEST) == []


def test_what_earlier_formats_have_written_has_no_time(tmp_path):
    shutil.copytree(OLD_FOLDERS / "format10" / "stopped", tmp_path / "data")
    storage = SQLiteStorage(tmp_path / "data")
    contents = storage.open(no_progress)
    written = {hull.number: storage.read(hull.number).last_revision for hull in contents.hulls}
    number, last = max(written.items(), key=lambda item: item[1])
    assert last > 0
    assert storage.moment(number, NEWEST) is None
    assert storage.oldest_moment(number, timed=True).committed is None
    stamp = storage.commit([Append(number, [record(last + 1), record(last + 2)])], contents.committed + NOW)
    assert storage.moment(number, stamp.time) == Moment(last + 2, stamp)
    assert storage.moment(number, stamp.time - 1) is None
    assert storage.oldest_moment(number, timed=True) == Moment(last + 1, stamp)
    assert all_batches(storage, last, last + 2, number)[0].committed == stamp
    storage.close()


def test_a_hull_that_is_gone_has_no_past(opened):
    opened.create(1)
    for read in (
        lambda: opened.storage.moment(2, NOW),
        lambda: opened.storage.oldest_moment(2),
        lambda: opened.storage.state(2, 0),
        lambda: opened.storage.batches(2, 0, 1),
    ):
        with pytest.raises(KeyError):
            read()
