"""What a folder says of each revision: in which commit it was, when that was, and what made it."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from patience import wait_until
from server_process import server_process
from set_time import SetTime

from dynhull_client import Batch, HullClient, Quarantine
from dynhull_server.state.records import Record
from dynhull_server.storage.sqlite.storage import SQLiteStorage

MINUTE = 60


@contextmanager
def served(data: Path, clock: SetTime) -> Iterator[HullClient]:
    with (
        server_process("--data", str(data), wrap=clock.wrap) as server,
        HullClient(server.address) as client,
    ):
        yield client


def written(data: Path) -> dict[str, list[Record]]:
    """The revisions of each hull, and of each shard."""
    storage = SQLiteStorage(data)
    contents = storage.open(lambda *_: None)
    found = {row.name: storage.read(row.number).records for row in contents.hulls}
    storage.close()
    return found


def test_each_revision_says_when_it_was_committed_and_what_made_it(tmp_path: Path) -> None:
    clock = SetTime(tmp_path)
    data = tmp_path / "data"
    begun = clock.now()
    with served(data, clock) as client:
        for name in ("north", "south"):
            client.create_hull(name, keyed="str")
        client.transfer({name: Batch(keys=["van"], points=[[1, 2]]) for name in ("north", "south")})
        client.create_hull("window", keyed="str", max_age=MINUTE)
        client.put("window", ["van"], [[1, 2]])
        clock.passes(2 * MINUTE)
        wait_until(lambda: client.get_hull("window").revision == 2)
        client.put("window", ["van"], [[1, 2]])
        client.create_hull("held", keyed="str")
        client.set_quarantine("held", Quarantine(max_growth=2))
        client.put("held", ["a", "b", "c"], [[0, 0], [1, 0], [0, 1]])
        client.put("held", ["far"], [[100, 100]])
        client.release("held", ["far"])
        client.create_hull("globe", geographic=True)
        client.apply("globe", insert=[[1, 1], [2, 2]])
        client.recenter("globe", (1, 2))
        client.create_hull("many", shards=2)
        client.apply("many", insert=[[0, 0], [1, 0], [0, 1]])
        client.reshard("many", 3)
        client.apply("many", insert=[[1, 1]])
    ended = clock.now()
    found = written(data)
    assert {name: [each.cause for each in records] for name, records in found.items() if "#" not in name} == {
        "north": ["batch"],
        "south": ["batch"],
        "window": ["batch", "expiry", "batch"],
        "held": ["quarantine", "batch", "batch", "quarantine"],
        "globe": ["batch", "recenter"],
        "many": ["batch", "division", "batch"],
    }
    assert {each.cause for name, records in found.items() if "#" in name for each in records} == {"epoch", "batch"}
    assert found["north"][0].committed == found["south"][0].committed
    in_order = sorted(each.committed for records in found.values() for each in records)
    times = [each.time for each in in_order]
    assert begun <= times[0] <= begun + MINUTE * 10**6
    assert times == sorted(times)
    assert begun + 2 * MINUTE * 10**6 <= times[-1] <= ended
    first, expiry, second = (each.committed for each in found["window"])
    assert (first.number < expiry.number < second.number, expiry.time - first.time >= MINUTE * 10**6) == (True, True)
    with closing(sqlite3.connect(data / "dynhull.db")) as database:
        columns = database.execute("SELECT DISTINCT commit_number, committed FROM batches ORDER BY 1").fetchall()
    assert columns == sorted(set(in_order))

    clock.passes(-60 * MINUTE)  # the clock of the next process is behind
    with served(data, clock) as client:
        client.put("north", ["van"], [[3, 4]])
    assert written(data)["north"][1].committed > in_order[-1]
    assert written(data)["north"][1].committed.time > times[-1]
