"""Keys are erased from the past of hulls of every kind: of what others did nothing changes, and no file has a trace."""

from contextlib import closing
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow.parquet as pq
import pytest
from cases import slow
from command_line import dynhull
from patience import wait_until
from server_process import server_process

from dynhull_client import Batch, HullClient, HullUnsuitableError, Quarantine

OTHERS = [f"other {i}" for i in range(40)]
GONE = "who is gone"
NUMBER = 7_234_567_891_234_567_891  # the same for keys that are integers: no other bytes are like it by chance
BEGIN = datetime(2026, 1, 1, tzinfo=UTC)


def places(count, seed):
    return np.round(np.random.default_rng(seed).random((count, 2)) * 10, 6)


def put(client, name, keys, batches):
    for seed in range(batches):
        client.put(name, keys, places(len(keys), seed))


def integers(client, name):
    client.create_hull(name, keyed="int", history=True)
    put(client, name, [*range(20), NUMBER], 12)
    client.remove(name, [NUMBER])


def recentred(client, name):
    client.create_hull(name, keyed="str", geographic=True, history=True)
    for center in ((4, 5), None):
        put(client, name, [*OTHERS, GONE], 8)
        client.recenter(name, center)
    client.remove(name, [GONE])


def held(client, name):
    client.create_hull(name, keyed="str", history=True, quarantine=Quarantine(max_growth=1.5, confirmations=3))
    put(client, name, [*OTHERS, GONE], 6)
    for x in (1000, 2000, 3000):
        client.put(name, [GONE, OTHERS[0]], [(x, 900), (1, 1)])
    client.put(name, OTHERS[1:2], [(5000, 5000)])
    client.remove(name, [GONE])
    assert [each.key for each in client.list_held(name)] == OTHERS[1:2]


def aged(client, name):
    client.create_hull(name, keyed="str", max_age=2, history=True)
    put(client, name, [*OTHERS, GONE], 8)
    wait_until(lambda: not client.get_hull(name).info.points)


def by_data(client, name):
    client.create_hull(name, keyed="str", max_age=100, clock="data", history=True)
    for batch in range(12):
        keys = [*OTHERS, *([GONE] if batch < 6 else [])]
        client.put(name, keys, places(len(keys), batch), times=[BEGIN + timedelta(seconds=30 * batch)] * len(keys))


def transferred(client, name):
    client.create_hull(name, keyed="str", history=True)
    client.create_hull(f"{name}/other", keyed="str", history=True)
    client.put(f"{name}/other", [GONE], [(1, 1)])
    for batch in range(8):
        there, gone = (name, f"{name}/other")[:: -1 if batch % 2 else 1]
        some = places(20, batch)
        arrives, leaves = (
            Batch(keys=[GONE, *OTHERS[:19]], points=some),
            Batch(remove=[GONE], keys=OTHERS[:20], points=some),
        )
        client.transfer({there: arrives, gone: leaves})
    for each in (name, f"{name}/other"):
        client.remove(each, [GONE])


KINDS = integers, recentred, held, aged, by_data, transferred


def batches(client, name, gone):
    """The batches of a hull but for a key, and whether it is in any."""
    last = client.get_hull(name).info.revision
    found, there = [], False
    with closing(client.feed(name, after=0)) as feed:
        while not found or found[-1][0] < last:
            each = next(feed)
            stay = [row for row, key in enumerate(each.keys) if key != gone]
            there |= len(stay) < len(each.keys) or gone in list(each.removed)
            columns = each.points, each.times, each.expire_times, each.accuracies
            rows = [None if column is None else column[stay].tobytes() for column in columns]
            keys = [each.keys[row] for row in stay], [key for key in each.removed if key != gone]
            found.append((each.revision, each.commit, each.time, each.cause, each.clock, each.center, keys, rows))
    return found, there


def seen(client, name, gone):
    """What can be read of a hull at some revisions, but for a key."""
    history = client.history(name)
    others = OTHERS if gone is GONE else [*range(20)]
    found = []
    for revision in range(history.first_revision, history.last_revision + 1, 3):
        past = client.at(name, revision)
        now = past.positions(others)
        held = sorted((each.key, each.position) for each in past.list_held() if each.key != gone)
        found.append((now.present.tobytes(), now.positions.tobytes(), held))
        assert past.verify().equal
    return found


@slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda each: each.__name__)
def test_what_others_did_is_as_it_was(tmp_path, kind):
    gone, name = NUMBER if kind is integers else GONE, f"{kind.__name__}/hull"
    trace = [gone.encode()] if kind is not integers else [gone.to_bytes(8, order) for order in ("little", "big")]
    with (
        server_process("--data", str(tmp_path), "--snapshot-points", "200") as server,
        HullClient(server.address) as client,
    ):
        kind(client, name)
        names = [each.name for each in client.list_hulls()]
        if kind is not aged:
            with pytest.raises(HullUnsuitableError, match="has the key"):
                client.erase_history(name, [gone, next(iter(client.entities(name).keys))])
        for each in names:
            before, there = batches(client, each, gone)
            looked = seen(client, each, gone)
            assert there
            assert client.erase_history(each, [gone]).keys == 1
            assert batches(client, each, gone) == (before, False)
            assert seen(client, each, gone) == looked
            assert not client.at(each, client.history(each).first_revision + 1).positions([gone]).present.any()
            assert client.erase_history(each, [gone]) is None
    for file in filter(lambda file: file.is_file(), tmp_path.rglob("*")):
        assert not any(each in file.read_bytes() for each in trace)
        assert file.suffix != ".parquet" or gone not in pq.read_table(file).column("key").to_pylist()
    assert dynhull("check", str(tmp_path)).exit_code == 0
