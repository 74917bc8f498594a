"""A start on PostgreSQL tells a database that was led back to a moment from one whose owner goes on."""

from collections.abc import Iterator

import pytest
from cases import slow
from folders import append, fill, no_progress
from patience import wait_until
from postgresql import PostgreSQL, postgresql, query

from dynhull_cluster.postgres.database import Database
from dynhull_cluster.postgres.storage import PostgresStorage
from dynhull_server.storage.port import StorageError

CONNECTED = "SELECT pid FROM pg_locks WHERE locktype = 'advisory' AND objsubid = 2"


@pytest.fixture
def server() -> Iterator[PostgreSQL]:
    """A PostgreSQL server of this test's own: it is killed."""
    with postgresql() as server:
        yield server


def promoted(server: PostgreSQL) -> None:
    """Have it go on on another timeline, as a standby, or after a recovery to a moment."""
    server.kill()
    with server.recovering():
        pass

    def answers() -> bool:
        try:
            Database(server.url("postgres")).connect("test").close()
        except StorageError:
            return False
        return True

    wait_until(answers)


def uids(storage: PostgresStorage) -> list[str]:
    return [row.uid for row in storage.open(no_progress).hulls]


@slow
def test_another_timeline(server: PostgreSQL) -> None:
    url = server.new_database()

    def on() -> PostgresStorage:
        return PostgresStorage(Database(url), pytest.fail)

    owner = on()
    assert uids(owner) == []
    fill(owner, 3)
    promoted(server)
    wait_until(lambda: query(url, CONNECTED))
    heir = on()  # which starts while the owner lives, and has not committed yet
    assert [row.uid for row in heir.follow(no_progress).hulls] == ["0123"]
    heir.close()
    append(owner, 4, 4)
    owner.close()
    following = on()
    assert uids(following) == ["0123"]
    following.close()
    promoted(server)
    led_back = on()
    (uid,) = uids(led_back)
    assert uid.startswith("0123.")
    append(led_back, 5, 5)
    led_back.close()
    again = on()
    assert uids(again) == [uid]
    again.close()
