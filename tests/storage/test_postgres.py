"""The storage on PostgreSQL: damage, other servers, lost connections, and databases that it cannot use."""

import asyncio
import re
import shutil
import threading
import time
from contextlib import closing

import folders
import pytest
from folders import OLD_FOLDERS, append, fill, fill_fence, no_progress, record, same
from patience import wait_until
from postgresql import query
from proxy import Proxy

from dynhull_cluster.machines.board import Board, join
from dynhull_cluster.postgres import ownership
from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.state.records import Append, Contents, Kept
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.port import (
    DamagedError,
    FormatError,
    LockedError,
    NotCommittedError,
    StorageError,
    TakenOverError,
)
from dynhull_server.storage.rows.tables import FORMAT

WRITERS = "FROM pg_stat_activity WHERE application_name LIKE 'dynhull writer%%' AND datname = current_database()"
# Another server has owned the partition, and has ended; or does not renew its lease, whatever clocks say.
TAKEN_AND_LEFT = "UPDATE owners SET epoch = epoch + 1, until = '-infinity', process = ''"
TAKEN_AND_SILENT = "UPDATE owners SET epoch = epoch + 1, until = %s, process = ''"
LAST = 6  # revision of the hull
NOW = 1_800_000_000_000_000


def on(url, lost=None, **more):
    return PostgresStorage(Database(url), lost or pytest.fail, **more)


def opened(url, lost=None, **more):
    storage = on(url, lost, **more)
    return storage, storage.open(no_progress)


def name_in(url):
    return url.split("?")[0].rpartition("/")[2]


@pytest.fixture(scope="module")
def template(postgres):
    """The name of a database with a hull that has a snapshot and batches, and a fence."""
    url = postgres.new_database()
    storage, _ = opened(url)
    fill(storage, 3)
    for step in storage.snapshot(1, Kept(3, Contents(record(1).rows.inserts))):
        storage.commit([step])
    append(storage, 4, LAST)
    fill_fence(storage, 3)
    storage.close()
    return name_in(url)


@pytest.fixture
def url(postgres, template):
    """A copy of it."""
    return postgres.new_database(template)


DAMAGE = {
    "a batch": "UPDATE batches SET payload = set_byte(payload, 30, get_byte(payload, 30) # 1) WHERE first = 4",
    "a missing batch": "DELETE FROM batches WHERE first = 5",
    "a later commit": "UPDATE batches SET commit_number = commit_number + 1 WHERE first = 5",
    "another time": "UPDATE batches SET committed = committed + 1 WHERE first = 5",
    "no commit": "UPDATE batches SET commit_number = NULL, committed = NULL WHERE first = 5",
    "no time": "UPDATE batches SET committed = NULL WHERE first = 5",
    "an exchanged batch": "UPDATE batches SET first = 11 - first, last = 11 - last WHERE first > 4",
    "the hull": "UPDATE hulls SET name = 'fleeu'",
    "the missing hull": "DELETE FROM hulls",
    "the fence": "UPDATE fences SET config = replace(config, '0.5', '0.6')",
    "an event": "UPDATE events SET payload = set_byte(payload, 3, get_byte(payload, 3) # 1) WHERE rowid = 2",
    "a missing event": "DELETE FROM events WHERE rowid = 2",
    "who is inside": "UPDATE insides SET payload = set_byte(payload, 0, get_byte(payload, 0) # 1)",
    "a consumer": "UPDATE consumers SET acknowledged = acknowledged + 1",
    "a delay": "UPDATE delays SET checksum = checksum # 4",
    "both totals": "UPDATE totals SET batches = batches + 1",
    "the time of the last commit": "UPDATE totals SET committed = committed + 1",
    "the missing totals": "DELETE FROM totals",
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_damage_is_refused(url, damage):
    query(url, damage)
    with pytest.raises(DamagedError, match="restore a backup"):
        on(url).open(no_progress)


NOTED = {
    "one of the totals": ("UPDATE totals SET commits = 0 WHERE copy = 1", "one of the two copies of the totals"),
    "the snapshot": ("UPDATE chunks SET points = set_byte(points, 9, 7)", "the snapshot at revision 3 is damaged"),
    "the last batch": ("UPDATE batches SET checksum = 7 WHERE first = 6", None),  # a fence depends on it
}


@pytest.mark.parametrize(("damage", "note"), NOTED.values(), ids=NOTED)
def test_damage_that_can_be_repaired_is_noted_and_repaired(url, damage, note):
    query(url, damage)
    if note is None:
        with pytest.raises(DamagedError, match="depends on hull"):
            on(url).open(no_progress)
        return
    storage, contents = opened(url)
    with closing(storage):
        assert any(note in each for each in contents.notes), contents.notes
        assert [each.revision for each in storage.read(1).records][-1] == LAST
    storage, contents = opened(url)
    storage.close()
    assert contents.notes == []


def test_a_second_server_has_nothing_beside_the_first_one(url):
    first, _ = opened(url)
    with pytest.raises(LockedError, match="is served by process"):
        on(url).open(no_progress)
    assert first.entitled()
    first.close()
    assert not first.entitled()
    second, _ = opened(url)
    second.close()


def test_who_is_replaced_commits_nothing_and_hears_of_it(url):
    heard = []
    first, _ = opened(url, heard.append)
    query(url, TAKEN_AND_LEFT)
    second, _ = opened(url)
    with pytest.raises(TakenOverError, match="taken over partition 0"):
        append(first, LAST + 1, LAST + 1)
    wait_until(lambda: heard)
    assert "taken over partition 0" in heard[0]
    assert not first.entitled()
    first.close()
    append(second, LAST + 1, LAST + 1)
    assert second.entitled()
    second.close()


def test_a_server_whose_database_is_a_copy_now_that_another_one_serves_in_the_same_epoch_is_replaced(url):
    heard = []
    first, _ = opened(url, heard.append, worker="north-1/0")
    query(url, "UPDATE owners SET worker = 'south-1/0', process = ''")
    with pytest.raises(TakenOverError, match="taken over partition 0"):
        append(first, LAST + 1, LAST + 1)
    wait_until(lambda: heard)
    assert not first.entitled()
    first.close()


@pytest.mark.parametrize("until", ["1970-01-01", "2970-01-01"])
def test_clocks_of_the_database_do_not_end_a_lease(url, until, monkeypatch):
    monkeypatch.setattr(ownership, "LEASE", 1.0)
    query(url, TAKEN_AND_SILENT, until)
    storage = on(url, leases=ownership.Leases())
    begun = time.monotonic()

    def has_ended() -> bool:
        try:
            storage.open(no_progress)
        except LockedError:
            return False
        return True

    wait_until(has_ended)
    assert time.monotonic() - begun > 1.0
    storage.close()


def test_a_successor_ends_the_transaction_of_a_server_that_was_stopped(url):
    heard = []
    first, _ = opened(url, heard.append)
    (epoch,) = query(url, "SELECT epoch FROM owners")[0]
    stopped = Database(url).connect(f"dynhull writer 0/{epoch}")
    stopped.execute("BEGIN")
    stopped.execute("SELECT epoch FROM owners FOR KEY SHARE")
    query(url, TAKEN_AND_LEFT)
    second, _ = opened(url)
    append(second, LAST + 1, LAST + 1)
    with closing(stopped), pytest.raises(Exception, match="terminat"):
        stopped.execute("COMMIT")
    wait_until(lambda: heard)
    first.close()
    second.close()


@pytest.mark.parametrize("durability", Durability)
def test_a_database_that_has_lost_commits_is_not_written_to(url, durability):
    storage, _ = opened(url, durability=durability)
    before = query(url, "SELECT * FROM totals")
    append(storage, LAST + 1, LAST + 1)
    query(url, "DELETE FROM totals; DELETE FROM batches WHERE first > 6")
    for row in before:
        query(url, f"INSERT INTO totals VALUES ({', '.join(['%s'] * len(row))})", *row)
    with pytest.raises(TakenOverError, match="lost commits"):
        append(storage, LAST + 2, LAST + 2)
    storage.close()


def test_a_lost_connection_refuses_no_commit(url):
    storage, _ = opened(url)
    with closing(storage):
        for revision in (LAST + 1, LAST + 2):
            query(url, f"SELECT pg_terminate_backend(pid, 10000) {WRITERS}")
            append(storage, revision, revision)
        query(
            url, "SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity WHERE application_name LIKE 'dynhull%%'"
        )
        assert len(storage.read(1).records) == LAST + 2 - 3


AT_COMMIT = """
CREATE FUNCTION pause() RETURNS trigger LANGUAGE plpgsql AS 'BEGIN PERFORM pg_sleep(1000); RETURN NULL; END';
CREATE CONSTRAINT TRIGGER pause AFTER INSERT ON batches DEFERRABLE INITIALLY DEFERRED
FOR EACH ROW EXECUTE FUNCTION pause()
"""


def test_the_outcome_of_a_lost_commit_is_decided(url):
    storage, _ = opened(url)
    query(url, AT_COMMIT)

    def terminate():
        wait_until(lambda: query(url, f"SELECT pid {WRITERS} AND query = 'COMMIT' AND wait_event = 'PgSleep'"))
        query(url, f"SELECT pg_terminate_backend(pid) {WRITERS}")

    thread = threading.Thread(target=terminate)
    thread.start()
    with closing(storage):
        with pytest.raises(StorageError) as unknown:
            append(storage, LAST + 1, LAST + 1)
        thread.join()
        assert not isinstance(unknown.value, NotCommittedError)
        with pytest.raises(StorageError, match="not known yet"):
            storage.read(1)
        with pytest.raises(StorageError, match="not known yet"):
            append(storage, LAST + 1, LAST + 1)
        query(url, "DROP TRIGGER pause ON batches")
        storage.settle()
        assert storage.read(1).last_revision == LAST
        append(storage, LAST + 1, LAST + 1)


def test_a_commit_is_found_although_its_answer_was_lost(url):
    storage, _ = opened(url)
    with closing(storage):
        commit = storage._writer.execute

        def lost(sql, *more):
            done = commit(sql, *more)
            if sql == "COMMIT":
                raise storage_error
            return done

        storage_error = StorageError("the answer is lost")
        storage._writer.execute = lost
        with pytest.raises(StorageError, match="answer is lost"):
            append(storage, LAST + 1, LAST + 1)
        storage.settle()
        assert storage.read(1).last_revision == LAST + 1
        append(storage, LAST + 2, LAST + 2)


NO_ROOM = """
CREATE FUNCTION fail() RETURNS trigger LANGUAGE plpgsql AS
'BEGIN RAISE EXCEPTION ''no space left on device'' USING ERRCODE = ''53100''; END';
CREATE TRIGGER fail BEFORE INSERT ON batches FOR EACH ROW EXECUTE FUNCTION fail()
"""


def test_commits_go_on_when_there_is_room_again(url):
    storage, _ = opened(url)
    with closing(storage):
        for revision in range(LAST + 1, LAST + 10):  # the statements are prepared in one of these commits
            query(url, NO_ROOM)
            with pytest.raises(NotCommittedError, match="the disk of PostgreSQL is full") as refused:
                append(storage, revision, revision)
            assert refused.value.full
            query(url, "DROP FUNCTION fail CASCADE")
            append(storage, revision, revision)


def test_values_that_postgresql_refuses_change_nothing(url):
    storage, _ = opened(url)
    with closing(storage):
        with pytest.raises(NotCommittedError):
            storage.commit([Append(1, [record(LAST + 1)]), Append(2, [record(1)])])
        append(storage, LAST + 1, LAST + 1)


def test_partitions_are_apart_and_their_number_does_not_change(postgres):
    url = postgres.new_database()
    both = [opened(url, partition=partition, partitions=2)[0] for partition in (0, 1)]
    for partition, storage in enumerate(both):
        fill(storage, 2 + partition, f"hull {partition}")
        storage.close()
    for partition in (0, 1):
        storage, contents = opened(url, partition=partition, partitions=2)
        assert [(row.name, storage.read(row.number).last_revision) for row in contents.hulls] == [
            (f"hull {partition}", 2 + partition)
        ]
        storage.close()
    with pytest.raises(StorageError, match="divided among 2 workers: start the server with --workers 2"):
        on(url).open(no_progress)


def test_databases_that_cannot_be_used_are_named(postgres, tmp_path):
    nowhere = f"postgresql:///test?host={tmp_path}"
    with pytest.raises(StorageError, match=rf"cannot connect to the database test on {tmp_path}"):
        on(nowhere).open(no_progress)
    with pytest.raises(StorageError, match='database "missing" does not exist'):
        on(postgres.url("missing")).open(no_progress)
    with pytest.raises(StorageError, match='role "stranger" does not exist') as refused:
        on(postgres.url("postgres").replace("user=tester", "user=stranger&password=secret")).open(no_progress)
    assert "secret" not in str(refused.value)
    with pytest.raises(ValueError, match="no address of a PostgreSQL database"):
        on("postgresql://?what=1")
    url = postgres.new_database()
    query(url, "CREATE SCHEMA dynhull; CREATE TABLE dynhull.other (a integer)")
    with pytest.raises(FormatError, match="of another program"):
        on(url).open(no_progress)


@pytest.mark.parametrize("version", [8, 10])
def test_a_database_of_an_older_format_has_everything_and_goes_on(postgres, tmp_path, version):
    """The folder beside it, and a batch of a server. New batches know their commits; the others stay as they are."""
    url, folder = postgres.new_database(), OLD_FOLDERS / f"format{version}"
    query(url, (folder / "database.sql").read_text())
    assert query(url, "SELECT format FROM dynhull.format") == [(version,)]
    expected, there = folders.opened(shutil.copytree(folder / "stopped", tmp_path / "folder"))
    for life in range(2):
        storage, contents = opened(url)
        with closing(storage):
            assert query(url, "SELECT format FROM format") == [(FORMAT,)]
            assert (contents.hulls, contents.fences, contents.notes) == (there.hulls, there.fences, [])
            for row in there.hulls:
                found, kept = storage.read(row.number), expected.read(row.number)
                added = found.records[len(kept.records) :]
                found.records = found.records[: len(kept.records)]
                same(found, kept)
                assert len(added) == (1 + life if row.name == "fleet" else 0)
                assert {each.committed for each in (*kept.records, *added[:1])} <= {None}
                assert [each.committed.time for each in added[1:]] == [NOW] * len(added[1:])
            for row in there.fences:
                assert storage.read_events(row.number, 0, 1000) == expected.read_events(row.number, 0, 1000)
            fleet = next(row for row in there.hulls if row.name == "fleet")
            last = storage.read(fleet.number).last_revision + 1
            storage.commit([Append(fleet.number, [record(last)])], NOW - life)
        assert (contents.committed, life) in [(0, 0), (NOW, 1)]
    expected.close()


def test_newer_formats_are_refused(url):
    query(url, "UPDATE format SET format = 99")
    with pytest.raises(FormatError, match="has format 99, this version reads formats 8 to"):
        on(url).open(no_progress)


def test_what_is_served_in_an_older_format_is_not_migrated(url, monkeypatch):
    monkeypatch.setattr(ownership, "LEASE", 3600)
    monkeypatch.setattr(ownership, "RENEWAL", 3600)
    storage, _ = opened(url)
    with closing(storage):
        query(url, "UPDATE format SET format = 9")
        with pytest.raises(LockedError, match=r"is served by process .* in format 9, .* stop all servers of older"):
            on(url).open(no_progress)
        append(storage, LAST + 1, LAST + 1)
        query(url, "UPDATE owners SET until = clock_timestamp()")  # it was not renewed in time
        # What format 9 did not have.
        query(url, "ALTER TABLE batches DROP COLUMN commit_number, DROP COLUMN committed")
        query(url, "ALTER TABLE totals DROP COLUMN committed")
        query(url, "DROP TABLE segments")
        join(Database(url), 1)
        assert query(url, "SELECT format FROM format") == [(FORMAT,)]
        with pytest.raises(TakenOverError):
            append(storage, LAST + 2, LAST + 2)


def test_the_tables_of_the_first_clusters_get_what_they_lack(url):
    join(Database(url), 1)
    query(url, "ALTER TABLE workers DROP COLUMN process; DROP TABLE heirs")

    async def present():
        looks = asyncio.Queue()
        board = Board(Database(url), looks.put_nowait, ownership.Leases(), "north/0")
        looking = asyncio.create_task(board.run())
        tables = await looks.get()
        looking.cancel()
        return list(tables.workers)

    join(Database(url), 1)
    assert asyncio.run(present()) == ["north/0"]


def test_encodings_other_than_utf_8_are_refused(postgres):
    postgres.query("CREATE DATABASE latin ENCODING LATIN1 TEMPLATE template0", database="postgres")
    with pytest.raises(FormatError, match="has the encoding LATIN1: create one with UTF8"):
        on(postgres.url("latin")).open(no_progress)


@pytest.mark.parametrize("setting", ["statement", "lock", "idle_in_transaction_session", "idle_session"])
def test_timeouts_of_the_database_do_not_end_the_sessions_of_a_server(url, postgres, setting):
    postgres.query(f"ALTER DATABASE {name_in(url)} SET {setting}_timeout = 1", database="postgres")
    storage, contents = opened(url)
    with closing(storage):
        assert contents.notes == []
        append(storage, LAST + 1, LAST + 20)
        assert storage.read(1).last_revision == LAST + 20


class Rewriting(Proxy):
    """Changes what a PostgreSQL says."""

    def __init__(self, url, pattern, words):
        self._pattern, self._words = re.compile(pattern, re.DOTALL), words
        self.changes = 0
        home = re.search(r"host=([^&]*)", url).group(1)
        super().__init__(f"{home}/.s.PGSQL.5432")
        host, port = self.address.split(":")
        self.url = url.replace(f"host={home}", f"host={host}&port={port}")

    def passed(self, data):
        changed, count = self._pattern.subn(self._words, data)
        self.changes += count
        return changed


def test_sessions_of_newer_versions_have_no_timeout_for_transactions_either(url, postgres):
    [(version,)] = postgres.query("SHOW server_version_num", database="postgres")
    if int(version) >= 170_000:
        pytest.skip("an older one says what it was asked")
    with (
        closing(Rewriting(url, rb"(?<=server_version\0)\d+", b"17")) as newer,
        pytest.raises(StorageError, match='unrecognized configuration parameter "transaction_timeout"'),
    ):
        on(newer.url).open(no_progress)


def test_tables_are_created_in_few_turns(postgres):
    """Other workers wait for them, though not for long, and the database may be far away."""
    with closing(Rewriting(postgres.new_database(), b"Z\0\0\0\5", b"Z\0\0\0\5")) as proxy:  # it is ready for a query
        join(Database(proxy.url), 16)
        assert 0 < proxy.changes < 25


def test_poolers_are_refused(url):
    # The number of a process that it gives is not that of the process of PostgreSQL.
    with (
        closing(Rewriting(url, rb"(?<=K\0\0\0\x0c)....", b"\0\0\0\1")) as pooler,
        pytest.raises(FormatError, match="is behind a pooler: connect to PostgreSQL itself"),
    ):
        on(pooler.url).open(no_progress)


def test_standbys_and_read_only_databases_are_refused(url, postgres):
    postgres.query(f"ALTER DATABASE {name_in(url)} SET default_transaction_read_only = on", database="postgres")
    with pytest.raises(StorageError, match="cannot connect"):
        on(url).open(no_progress)
