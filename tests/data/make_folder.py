"""Write a data folder with the installed version: a fixture for the versions after it, which must open it.

    python tests/data/make_folder.py tests/data/format9

By hand, with the last version that writes a format. `stopped` is the folder of a server that was stopped. `killed` is
the folder of a second server on the same data, which was killed with batches in its log. The CSV files are the points
of each hull, as that version exports them, with keys and times; the JSON files have the events of fences, and who is
inside, positions in quarantine, and hulls over shards.
"""

import json
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path

import grpc
import numpy as np

from dynhull_client import Circle, HullClient, PointMissingError, Prefix, Quarantine
from dynhull_proto.v1 import hull_pb2, hull_service_pb2, hull_service_pb2_grpc

COMMAND = str(Path(sys.executable).with_name("dynhull"))
FILES = "dynhull.db", "dynhull.db-wal"
ZONES_CONFIG = hull_pb2.HullConfig(max_points=500)
SNAPSHOT_POINTS = 40
HULLS = {"fleet": "fleet", "zones": "zones/a", "vans": "vans", "track": "tracks"}
MOMENT = datetime(2026, 11, 1, tzinfo=UTC)
SECOND, YEARS = timedelta(seconds=1), timedelta(days=36_500)


@contextmanager
def served(data):
    """A server with snapshots after few points, and its client."""
    options = ["--data", str(data), "--port", "0", "--snapshot-points", str(SNAPSHOT_POINTS)]
    with subprocess.Popen([COMMAND, "serve", *options], stdout=subprocess.PIPE, text=True) as process:
        try:
            address = process.stdout.readline().split()[-1]
            with HullClient(address) as client:
                yield process, address, client
        finally:
            process.terminate()


def ran(*command):
    return subprocess.run([COMMAND, *map(str, command)], capture_output=True, text=True, check=True).stdout


def insert_and_delete(client, producer, first, last):
    """Numbered batches; each deletes two points of the one before."""
    before = np.empty((0, 2))
    for sequence in range(first, last + 1):
        points = np.random.default_rng([sequence, *producer.encode()]).normal(size=(5, 2))
        client.apply("fleet", insert=points, delete=before[:2], producer=producer, sequence=sequence)
        before = points


def snapshots(data, hull="fleet"):
    """The number of snapshots of hulls with such a name."""
    with closing(sqlite3.connect(f"file:{data / FILES[0]}?mode=ro", uri=True)) as database:
        found = "SELECT count(*) FROM snapshots JOIN hulls ON hull = hulls.id WHERE name LIKE ?"
        return database.execute(found, [hull]).fetchone()[0]


def fill(data, address, client):
    client.create_hull("fleet")
    client.create_hull("empty")
    client.create_hull("gone")
    with grpc.insecure_channel(address) as channel:
        request = hull_service_pb2.CreateHullRequest(name="zones/a", config=ZONES_CONFIG)
        hull_service_pb2_grpc.HullServiceStub(channel).CreateHull(request)
    client.apply("zones/a", insert=[(0, 0), (4, 0), (4, 3), (0, 0)], producer="truck", sequence=1)
    client.apply("zones/a", delete=[(0, 0), (9, 9)], insert=[(-0.0, 5e-324)], missing="count")
    client.apply("zones/a", move=([(4, 0)], [(1e308, -1e308)]))
    client.apply("gone", insert=[(1, 1)])
    client.delete_hull("gone")
    for producer, written in (("plane", 1), ("ship", 2)):
        insert_and_delete(client, producer, 1, 12)
        while snapshots(data) < written:
            continue
    insert_and_delete(client, "train", 1, 12)
    insert_and_delete(client, "bus", 1, 4)
    fill_keyed(client)


def fill_keyed(client):
    """Keys with event times and deadlines, and a window whose clock is that of the data."""
    client.create_hull("vans", keyed="str", ordering="event_time")
    client.create_hull("tracks", keyed="int", max_age=60, clock="data")
    keys, points = [f"van é{i}" for i in range(9)], np.arange(18.0).reshape(9, 2)
    client.put("vans", keys, points, times=[MOMENT] * 9, expire_times=[MOMENT + YEARS] * 9, producer="gate", sequence=1)
    client.put("vans", keys[:2], -points[:2], times=[MOMENT - SECOND, MOMENT + SECOND], remove=keys[8:])
    for second in range(0, 90, 10):
        client.put("tracks", [second, 2**64 - 1], [[second, 0], [0, second]], times=[MOMENT + second * SECOND] * 2)


def fill_held(data, client):
    """Positions in quarantine by both rules, in a snapshot, and one that was confirmed."""
    client.create_hull("held", keyed="str", ordering="event_time", quarantine=Quarantine(10, 3, 2))
    keys, corners = [f"flight é{i}" for i in range(50)], np.arange(100.0).reshape(50, 2) % 37
    client.put("held", keys, corners, times=[MOMENT] * 50)
    while snapshots(data, "held") < 1:
        continue
    client.put("held", keys[:48], corners[:48] + 999, times=[MOMENT + SECOND] * 48, expire_times=[MOMENT + YEARS] * 48)
    client.put("held", keys[:9], corners[:9] + 999, times=[MOMENT + 2 * SECOND] * 9)
    client.put("held", ["new"], [[500, 500]], times=[MOMENT])
    while snapshots(data, "held") < 2:
        continue


def change_held(client):
    """Positions released, dropped, confirmed and held, and other rules."""
    client.release("held", ["flight é20"], drop=["flight é21", "flight é22"], producer="desk", sequence=1)
    client.set_quarantine("held", Quarantine(max_speed=20))
    client.put("held", ["flight é0", "flight é49"], [[1000, 999], [-999, 0]], times=[MOMENT + 3 * SECOND] * 2)


DIVIDED = {"many": {"shards": 3}, "herd": {"shards": 2, "keyed": "str", "max_age": 60, "clock": "data"}}


def fill_divided(data, client):
    """Hulls over shards: one of points, some of which are deleted, with snapshots of root and shards; one of keys."""
    for name, settings in DIVIDED.items():
        client.create_hull(name, **settings)
    for sequence in range(1, 40):
        points = np.random.default_rng(sequence).normal(size=(8, 2))
        client.apply("many", insert=points, delete=points[:3], producer="ship", sequence=sequence)
        if sequence == 30:
            while not snapshots(data, "many#%.1"):
                client.count("many", [[0, 0]])  # a shard takes its snapshot when the root says that all is decided
    for second in range(0, 90, 10):
        keys = [f"cow é{i}" for i in range(second // 10, 20)]
        client.put(
            "herd", keys, np.arange(2.0 * len(keys)).reshape(-1, 2) % 7, times=[MOMENT + second * SECOND] * len(keys)
        )


def change_divided(client):
    """Batches after the last snapshots, one of them refused."""
    client.apply("many", insert=[[7, 7], [-7, 7]], producer="ship", sequence=40)
    try:
        client.apply("many", insert=[[1, 1], [2, 2], [3, 3]], delete=[[99, 99]], producer="ship", sequence=41)
    except PointMissingError:
        client.apply("many", delete=[[-7, 7]], producer="ship", sequence=41)
    client.put("herd", ["cow é0", "calf"], [[9, 9], [8, -8]], times=[MOMENT + 100 * SECOND] * 2)


def export_divided(client, target):
    found = {}
    for name in DIVIDED:
        info = client.get_hull(name).info
        entities = client.entities(name) if info.keyed else None
        found[name] = {
            "revision": info.revision,
            "clock": info.clock and info.clock.isoformat(),
            "points": client.sample_points(name, 10_000).points.tolist(),
            "vertices": client.get_hull(name).vertices.tolist(),
            "keys": entities and list(entities.keys),
            "sequence": client.last_sequence(name, "ship"),
        }
    target.with_name(f"{target.name}-divided.json").write_text(json.dumps(found, indent=1, ensure_ascii=False))


def export_held(client, target):
    info = client.get_hull("held").info
    found = {
        "rules": [info.quarantine.max_speed, info.quarantine.max_growth, info.quarantine.confirmations],
        "revision": info.revision,
        "points": info.points,
        "held": [
            [each.key, each.position, each.time.isoformat(), each.speed, each.growth, each.revision, each.confirmations]
            for each in client.list_held("held")
        ],
    }
    target.with_name(f"{target.name}-held.json").write_text(json.dumps(found, indent=1, ensure_ascii=False))


def fill_fences(client):
    """A fence around each kind of area, with events, and a consumer that has acknowledged some of them."""
    client.create_fence("gate", area=[(0, 0), (9, 0), (9, 9), (0, 9)], subjects="vans", margin=1, dwell=0.001)
    client.create_fence("yard", area=Circle(0, 5, 6), subjects="tracks", initial="events", crosses=True)
    client.create_fence("pack", area="zones/a", subjects=Prefix("va"), initial="none")
    client.put("vans", ["van é1", "van é3"], [[9.5, 4], [-9, -9]], times=[MOMENT + SECOND] * 2)
    client.put("vans", ["van é1", "van é5"], [[10.5, 4], [1, 1]], times=[MOMENT + 2 * SECOND] * 2)
    client.ack_fence("gate", "relay", 2)
    # A subject that waits for its event, and a fence that has dropped some.
    client.create_fence("late", area=Circle(0, 0, 1), subjects="vans", confirmations=3)
    client.put("vans", ["van é7"], [[0, 0.5]], times=[MOMENT + 3 * SECOND])
    client.create_fence("short", area=Circle(50, 50, 1), subjects="vans", max_events=2)
    for second in range(4, 11):
        client.put("vans", ["van é6"], [[50 * (second % 2), 50]], times=[MOMENT + second * SECOND])
    while client.get_fence("short").first_sequence == 1:
        continue


def events(client, fence):
    """The events that are kept, from a durable consumer's view."""
    with client.watch_fence(fence.name, after=0) as watch:
        return [
            [event.sequence, event.type, event.hull, event.key and str(event.key), event.position, event.distance]
            for event in islice(watch, fence.last_sequence - fence.first_sequence + 1)
        ]


def export_fences(client, target):
    found = {
        fence.name: {
            "inside": {each.hull: list(map(str, each.keys)) for each in client.fence_inside(fence.name).subjects},
            "first": fence.first_sequence,
            "last": fence.last_sequence,
            "events": events(client, fence),
            "consumers": {each.name: each.acknowledged for each in fence.consumers},
        }
        for fence in client.list_fences()
    }
    target.with_name(f"{target.name}-fences.json").write_text(json.dumps(found, indent=1, ensure_ascii=False))


def take(data, target):
    target.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        if (data / name).exists():
            shutil.copyfile(data / name, target / name)


def export(data, target):
    for short, name in HULLS.items():
        ran("export", name, target.with_name(f"{target.name}-{short}.csv"), "--data", data)


def main():
    target = Path(sys.argv[1])
    data = target / "work"
    target.mkdir(parents=True, exist_ok=True)
    with served(data) as (_, address, client):
        fill(data, address, client)
        fill_fences(client)
        fill_held(data, client)
        fill_divided(data, client)
        export_held(client, target / "stopped")
        export_divided(client, target / "stopped")
        export_fences(client, target / "stopped")
    take(data, target / "stopped")
    export(data, target / "stopped")
    with served(data) as (process, _, client):
        insert_and_delete(client, "bus", 5, 7)
        client.apply("zones/a", insert=[(7, 7)], producer="truck", sequence=2)
        client.put("vans", ["van é0"], [[5, 5]], times=[MOMENT + 2 * SECOND], producer="gate", sequence=2)
        client.put("vans", ["van é0"], [[-5, 5]], times=[MOMENT + 3 * SECOND])
        change_held(client)
        change_divided(client)
        export_held(client, target / "killed")
        export_divided(client, target / "killed")
        export(data, target / "killed")
        export_fences(client, target / "killed")
        process.kill()
        process.wait()
        take(data, target / "killed")
    shutil.rmtree(data)


if __name__ == "__main__":
    main()
