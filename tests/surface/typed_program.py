"""A user's program, which two type checkers read in `make check`: every call, its answer, and wrong arguments.

Each line that a checker must refuse says so, and it is an error if it does not. Nothing runs it.
"""

from collections.abc import AsyncIterator, Iterator
from datetime import timedelta
from typing import assert_type

import dynhull_client as sdk


def hulls(client: sdk.HullClient) -> None:
    assert_type(
        client.create_hull("a", keyed="str", max_age=60, clock="data", ahead="clamp", exist_ok=True), sdk.HullInfo
    )
    assert_type(client.create_hull("b", geographic=True, center=(9, 53), ordering="arrival", shards=2), sdk.HullInfo)
    assert_type(client.recenter("b", (9, 54)), sdk.HullInfo)
    assert_type(client.reshard("b", 4), sdk.HullInfo)
    assert_type(client.set_history("a", "30d", 10**9), sdk.HullInfo)
    assert_type(client.history("a"), sdk.History)
    assert_type(client.erase_history("a", ["k"]), sdk.Erasure | None)
    assert_type(client.wait_for_hull("a", min_revision=1, timeout=2.5), sdk.HullInfo)
    assert_type(client.list_hulls("a"), Iterator[sdk.HullInfo])
    assert_type(client.set_quarantine("a", sdk.Quarantine(max_speed=300)), sdk.HullInfo)
    assert_type(client.list_held("a"), Iterator[sdk.HeldPosition])
    assert_type(client.last_sequence("a", "p"), int)
    client.delete_hull("a")
    client.create_hull("a", keyed="float")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    client.create_hull("a", clock="sun")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    client.create_hull("a", maxage=3)  # type: ignore[call-arg]  # pyright: ignore[reportCallIssue]


def writes(client: sdk.HullClient) -> None:
    assert_type(client.apply("a", insert=[(0, 0)], missing="count"), sdk.Applied)
    assert_type(client.put("a", ["k"], [(0, 0)], only="absent", ttl=timedelta(hours=1)), sdk.Applied)
    assert_type(client.remove("a", ["k"], missing="raise"), sdk.Applied)
    assert_type(client.release("a", ["k"], drop=["l"]), sdk.Applied)
    assert_type(client.drop("a", ["k"], producer="p", sequence=1), sdk.Applied)
    assert_type(client.transfer({"a": sdk.Batch(remove=["k"])}), dict[str, sdk.Applied])
    assert_type(client.writer("a", coalesce="last"), sdk.Writer)
    assert_type(client.ingest("a"), sdk.Ingest)
    client.put("a", ["k"], [(0, 0)], only="new")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    client.apply("a", [(0, 0)])  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]


def reads(client: sdk.HullClient) -> None:
    assert_type(client.get_hull("a", layer=2), sdk.Hull)
    assert_type(client.get_measures("a"), sdk.Measured)
    assert_type(client.series("a", 600), sdk.Series)
    assert_type(client.locate("a", [(0, 0)], min_revision=3), sdk.Located)
    assert_type(client.distance("a", keys=["k"], keys_of="b"), sdk.Distances)
    assert_type(client.count("a", [(0, 0)]), sdk.Counted)
    assert_type(client.positions("a", ["k"]), sdk.Positions)
    assert_type(client.entities("a"), sdk.Entities)
    assert_type(client.read_points("a"), Iterator[sdk.Stored])
    assert_type(client.support("a", [(1, 0)], keys=True), sdk.Supported)
    assert_type(client.tangents("a", [(9, 9)]), sdk.Tangents)
    assert_type(client.intersect_lines("a", [(0, 0)], [(1, 1)]), sdk.Crossings)
    assert_type(client.sample_points("a", 10), sdk.Sampled)
    assert_type(client.layers("a", 2), sdk.Layers)
    assert_type(client.influence("a"), sdk.Influence)
    assert_type(client.separate("a", "b"), sdk.Separation)
    past = client.at("fleet", "2026-11-24T16:00Z")
    print(past.revision, past.time, past.get_measures().area)
    assert_type(client.phase_diagram("a"), sdk.Phases)
    assert_type(client.frontier("a", rates=[0.01]), sdk.Efficient)
    assert_type(client.verify("a"), sdk.Verification)
    assert_type(client.pipeline(batch_reads=2), sdk.Pipeline)
    assert_type(client.watch("a", copy=sdk.HullCopy()), sdk.Watch)
    assert_type(client.track("a", ["x"], every=60), dict[str | int, sdk.Track])
    assert_type(client.replay("a", 1, "2026-11-24T16:00Z", speed=60, copy=sdk.HullCopy()), sdk.Replay)
    assert_type(client.watch_many("a/", contents="outline", max_rate=2), sdk.ManyWatch)
    assert_type(sdk.HullCopies()["a"], sdk.HullCopy)
    client.get_hull("a", layer="2")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]


def fences(client: sdk.HullClient) -> None:
    fence = client.create_fence(
        "f", sdk.Circle(0, 0, 1), "a", boundary="open", dwell=timedelta(minutes=1), initial="none"
    )
    assert_type(fence, sdk.Fence)
    assert_type(fence.subjects, str | sdk.Prefix | None)
    assert_type(fence.dwell, timedelta | None)
    assert_type(client.replace_fence("f", "b", sdk.Prefix("a"), margin=0.5, min_dwell=2, layer=2), sdk.Fence)
    assert_type(client.get_fence("f"), sdk.Fence)
    assert_type(client.list_fences(), Iterator[sdk.Fence])
    assert_type(client.fence_inside("f"), sdk.Inside)
    assert_type(client.watch_fence("f", "mail", conflate=False), sdk.FenceWatch)
    assert_type(client.fence_events_between("b", "a", 7, "2026-01-01T00:00Z", dwell=2), sdk.FenceEvents)
    assert_type(client.feed("h", after=0), sdk.Feed)
    assert_type(client.ack_feed("h", consumer="c", after=7), sdk.FeedConsumer)
    assert_type(client.list_feed_consumers(), Iterator[sdk.FeedConsumer])
    client.delete_feed_consumer(prefix="h/", consumer="c")
    assert_type(client.ack_fence("f", "mail", 7), sdk.FenceConsumer)
    client.delete_consumer("f", "mail")
    client.delete_fence("f")
    alarm = client.create_alarm("f", hull="a", when="area > 3", clear="area < 2", for_="30s")
    assert_type(alarm, sdk.Alarm)
    assert_type(alarm.for_, timedelta | None)
    assert_type(client.get_alarm("f").statuses, tuple[sdk.AlarmStatus, ...])
    assert_type(client.list_alarms(), Iterator[sdk.Alarm])
    assert_type(client.watch_alarm("f", "mail"), sdk.AlarmWatch)
    assert_type(client.ack_alarm("f", "mail", 7), sdk.FenceConsumer)
    assert_type(client.acknowledge_alarm("f", "a"), sdk.AlarmStatus)
    assert_type(client.mute_alarm("f", "a", None), sdk.AlarmStatus)
    client.delete_alarm_consumer("f", "mail")
    client.delete_alarm("f")
    client.create_fence("f", "b", "a", boundary="half")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    client.replace_fence("f", "b", "a", initial="none")  # type: ignore[call-arg]  # pyright: ignore[reportCallIssue]
    client.create_fence("f", "b", "a", margin="wide")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]


async def asynchronous(client: sdk.AsyncHullClient) -> None:
    assert_type(await client.create_hull("a", keyed="int", ordering="event_time"), sdk.HullInfo)
    assert_type(await client.create_fence("f", "b", "a", initial="events"), sdk.Fence)
    assert_type(await client.put("a", [1], [(0, 0)]), sdk.Applied)
    assert_type(await client.locate("a", [(0, 0)]), sdk.Located)
    assert_type(client.list_fences(), AsyncIterator[sdk.Fence])
    assert_type(client.read_points("a"), AsyncIterator[sdk.Stored])
    assert_type(client.presence(), AsyncIterator[bool])
    assert_type(client.watch("a"), sdk.AsyncWatch)
    assert_type(client.replay("a", every=1), sdk.AsyncReplay)
    assert_type(client.watch_many("a"), sdk.AsyncManyWatch)
    assert_type(client.writer("a"), sdk.AsyncWriter)
    await client.create_hull("a", keyed="float")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    await client.create_fence("f", "b", "a", initial="all")  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
