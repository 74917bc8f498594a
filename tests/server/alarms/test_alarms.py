"""Alarms through the client: when they are raised and cleared, and what is refused."""

import asyncio
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path

import pytest
from command_line import dynhull
from patience import wait_until
from server_process import server_process
from set_time import SetTime

from dynhull_client import (
    AlarmEvent,
    AlarmExistsError,
    AlarmNotFoundError,
    AlarmNotRaisedError,
    AlarmReplacedError,
    AsyncHullClient,
    ConsumerNotFoundError,
    HullClient,
    HullFencedError,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidRequestError,
    LimitExceededError,
    SequenceAheadError,
)

# Longer than any test takes: it passes when a test says so.
HOUR = 3600


@pytest.fixture(scope="module", params=["memory", "durable"])
def timed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, SetTime]]:
    """The address of a server, and its time."""
    folder = tmp_path_factory.mktemp("alarms")
    clock = SetTime(folder)
    options = [] if request.param == "memory" else ["--data", str(folder / "data")]
    with server_process(*options, "--max-alarm-hulls", "500", "--create-on-write", wrap=clock.wrap) as process:
        yield process.address, clock


@pytest.fixture
def address(timed: tuple[str, SetTime]) -> str:
    return timed[0]


@pytest.fixture
def clock(timed: tuple[str, SetTime]) -> SetTime:
    return timed[1]


def seen(client: HullClient, alarm: str, after: int = 0) -> list[AlarmEvent]:
    """The events of an alarm after a sequence."""
    last = client.get_alarm(alarm).last_sequence
    with client.watch_alarm(alarm, after=after) as stream:
        return list(islice(stream, last - after))


def told(events: list[AlarmEvent]) -> list[tuple[object, ...]]:
    return [(event.type, event.hull.rpartition("/")[2], event.revision, event.value) for event in events]


def square(client: HullClient, hull: str, side: float) -> None:
    """Move the keys of a hull to the corners of a square."""
    client.put(hull, ["a", "b", "c", "d"], [(0, 0), (side, 0), (side, side), (0, side)])


def test_an_alarm_is_raised_and_cleared_with_hysteresis(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    alarm = client.create_alarm(name, hull=name, when="area>=9", clear="area < 4")
    assert (alarm.when, alarm.clear, alarm.hull, alarm.hulls, alarm.raised) == ("area >= 9", "area < 4", name, 1, 0)
    for side in (2, 3, 2.5, 2, 4, 1, 3):
        square(client, name, side)
    events = seen(client, name)
    assert [(event.type, event.revision, event.value) for event in events] == [
        ("raised", 2, 9.0),
        ("cleared", 6, 1.0),
        ("raised", 7, 9.0),
    ]
    assert {event.hull for event in events} == {name}
    assert [(event.bound, event.previous) for event in events] == [(9.0, 4.0), (4.0, 16.0), (9.0, 1.0)]
    assert [event.sequence for event in events] == [1, 2, 3]
    assert all(event.cause == {"batch"} and event.cause_revision == event.revision for event in events)
    (status,) = client.get_alarm(name).statuses
    assert (status.hull, status.raised, status.value, status.since) == (name, True, 9.0, events[-1].cause_time)


def test_an_alarm_over_a_prefix_is_one_for_each_hull(client: HullClient, name: str) -> None:
    client.create_hull(f"{name}/a", keyed="str")
    square(client, f"{name}/a", 1)
    client.create_alarm(name, prefix=f"{name}/", when="count > 3")
    client.create_alarm(f"{name}/few", prefix=f"{name}/", when="vertices < 3")
    client.apply(f"{name}/b", insert=[(0, 0)] * 3)
    client.apply(f"{name}/b", insert=[(0, 0)])
    client.create_hull(f"{name}/empty")
    client.delete_hull(f"{name}/a")
    events = seen(client, name)
    assert told(events) == [("raised", "a", 1, 4.0), ("raised", "b", 2, 4.0), ("cleared", "a", 1, None)]
    assert [event.cause for event in events] == [{"alarm_created"}, {"batch"}, {"hull_deleted"}]
    assert [event.previous for event in events] == [None, 3.0, None]
    assert told(seen(client, f"{name}/few")) == [("raised", "b", 1, 1.0), ("raised", "empty", 0, 0.0)]
    assert client.get_alarm(name).raised == 1


def test_a_condition_has_to_hold_for_a_time(client: HullClient, clock: SetTime, name: str) -> None:
    client.create_hull(name, keyed="str")
    client.create_alarm(name, hull=name, when="diameter > 1", for_="1h")
    square(client, name, 1)
    square(client, name, 0.5)  # before the time has passed
    square(client, name, 2)
    square(client, name, 3)
    (status,) = client.get_alarm(name).statuses
    assert (status.raised, status.since is not None) == (False, True)
    clock.passes(HOUR)
    wait_until(lambda: client.get_alarm(name).raised)
    square(client, name, 0.25)
    raised, cleared = seen(client, name)
    assert (raised.type, raised.revision, raised.cause_revision) == ("raised", 4, 3)
    assert raised.cause == {"batch", "time_passed"}
    assert raised.previous == pytest.approx(0.5**0.5)
    assert raised.time - raised.cause_time == timedelta(seconds=HOUR)
    assert (cleared.type, cleared.revision) == ("cleared", 5)


def test_a_hull_falls_silent(client: HullClient, clock: SetTime, name: str) -> None:
    client.create_hull(f"{name}/a", keyed="str")
    client.create_alarm(name, prefix=f"{name}/", when="silent 1h")
    clock.passes(HOUR / 2)
    square(client, f"{name}/a", 1)
    clock.passes(HOUR / 2 + 60)
    client.create_hull(f"{name}/b")
    assert client.get_alarm(name).raised == 0
    clock.passes(HOUR / 2)
    wait_until(lambda: client.get_alarm(name).raised == 1)
    clock.passes(HOUR / 2)
    wait_until(lambda: client.get_alarm(name).raised == 2)
    square(client, f"{name}/a", 1)
    first, second, cleared = seen(client, name)
    assert [(each.type, each.hull[-1]) for each in (first, second, cleared)] == [
        ("raised", "a"),
        ("raised", "b"),
        ("cleared", "a"),
    ]
    assert first.value == first.bound == HOUR
    assert first.cause == {"time_passed"}


def test_an_alarm_on_the_globe_has_units(client: HullClient, name: str) -> None:
    client.create_hull(name, geographic=True)
    client.create_alarm(name, hull=name, when="area > 1000 km2")
    client.apply(name, insert=[(0, 0), (1, 0), (0, 1)])
    (event,) = seen(client, name)
    assert event.bound == 1e9
    assert event.value == client.get_measures(name).area


def test_somebody_takes_care_of_it(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    client.create_alarm(name, hull=name, when="count > 1")
    with pytest.raises(AlarmNotRaisedError, match="is not raised"):
        client.acknowledge_alarm(name, name)
    square(client, name, 1)
    assert client.acknowledge_alarm(name, name).acknowledged is not None
    until = datetime(2100, 1, 1, tzinfo=UTC)
    assert client.mute_alarm(name, name, until).muted_until == until
    client.remove(name, ["a", "b", "c"])
    (status,) = client.get_alarm(name).statuses
    assert (status.raised, status.acknowledged, status.muted_until) == (False, None, until)
    assert client.mute_alarm(name, name, None).muted_until is None
    assert client.get_alarm(name).statuses == ()
    client.create_hull(f"{name}/other")
    for other in (f"{name}/other", f"{name}/none"):
        with pytest.raises(HullUnsuitableError, match="is not one that the alarm"):
            client.mute_alarm(name, other, None)
        with pytest.raises(AlarmNotRaisedError):
            client.acknowledge_alarm(name, other)


def test_consumers_have_their_places(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str")
    alarm = client.create_alarm(name, hull=name, when="area > 1")
    for side in (2, 1, 2, 1):
        square(client, name, side)
    with client.watch_alarm(name, consumer="pager") as stream:
        assert [next(stream).sequence for _ in range(2)] == [1, 2]
    assert client.ack_alarm(name, "pager", 2, uid=alarm.uid).backlog == 2
    with client.watch_alarm(name, consumer="pager") as stream:
        assert next(stream).sequence == 3
    with pytest.raises(SequenceAheadError):
        client.ack_alarm(name, "pager", 5)
    with pytest.raises(AlarmReplacedError):
        client.ack_alarm(name, "pager", 3, uid="another")
    client.delete_alarm_consumer(name, "pager")
    with pytest.raises(ConsumerNotFoundError, match=f"the alarm '{name}' has no consumer"):
        client.delete_alarm_consumer(name, "pager")


def test_a_watch_ends_with_the_alarm(client: HullClient, address: str, name: str) -> None:
    client.create_hull(name, keyed="str")
    client.create_alarm(name, hull=name, when="count >= 4")

    async def watched() -> list[AlarmEvent]:
        async with AsyncHullClient(address) as other, other.watch_alarm(name, after=0) as stream:
            await asyncio.to_thread(square, client, name, 1)
            first = await anext(stream)
            assert [each.name async for each in other.list_alarms(name)] == [name]
            await other.delete_alarm(name)
            return [first, *[event async for event in stream]]

    first, closed = asyncio.run(watched())
    assert (first.type, closed.type, closed.raised) == ("raised", "closed", (name,))
    with pytest.raises(AlarmNotFoundError):
        client.get_alarm(name)
    client.delete_hull(name)


def test_a_hull_that_an_alarm_names_stays(client: HullClient, name: str) -> None:
    client.create_hull(name)
    client.create_alarm(name, hull=name, when="area > 1")
    with pytest.raises(HullFencedError, match="delete the alarm first") as refused:
        client.delete_hull(name)
    assert (refused.value.alarm, refused.value.fence) == (name, None)
    with pytest.raises(AlarmExistsError):
        client.create_alarm(name, hull=name, when="area > 1")
    client.create_hull(f"{name}/keyed", keyed="str")
    client.create_fence(name, f"{name}/keyed", f"{name}/keyed")  # which has a name of its own
    assert [each.name for each in client.list_fences(name)] == [name]
    assert [each.name for each in client.list_alarms(name)] == [name]


@pytest.mark.parametrize(
    ("settings", "field", "problem"),
    [
        ({"when": "area > x"}, "rule.when", "at position 8: expected a number"),
        ({"when": "size > 3"}, "rule.when", "at position 1: expected a measure"),
        ({"when": "area => 3"}, "rule.when", "at position 6: expected >, >=, < or <="),
        ({"when": "count > 3 m"}, "rule.when", "at position 11: expected nothing more"),
        ({"when": "silent 5 parsecs"}, "rule.when", "at position 10: expected a unit of time"),
        ({"when": "area > 5", "clear": "area < 6"}, "rule.clear", "must be weaker than 'area > 5'"),
        ({"when": "area >= 5", "clear": "area <= 5"}, "rule.clear", "must be weaker"),
        ({"when": "area < 5", "clear": "area < 4"}, "rule.clear", "must be weaker"),
        ({"when": "area < 5", "clear": "width > 6"}, "rule.clear", "the same measure"),
        ({"when": "silent 5m", "clear": "count > 1"}, "rule.clear", "a change of the hull clears"),
        ({"when": "silent 5m", "for_": 3}, "rule.hold", "has a time of its own"),
    ],
)
def test_rules_that_make_no_sense_are_refused(
    client: HullClient, name: str, settings: dict[str, object], field: str, problem: str
) -> None:
    client.create_hull(name)
    with pytest.raises(InvalidRequestError) as refused:
        client.create_alarm(name, hull=name, **settings)
    assert refused.value.field == field
    assert problem in str(refused.value)
    assert list(client.list_alarms(name)) == []


def test_hulls_that_an_alarm_does_not_suit_are_refused(client: HullClient, name: str) -> None:
    client.create_hull(name)
    client.create_hull(f"{name}/globe", geographic=True)
    for hull, when in ((name, "area > 1 km2"), (f"{name}/globe", "width > 1")):
        with pytest.raises(HullUnsuitableError, match="does not suit"):
            client.create_alarm(name, hull=hull, when=when)
    with pytest.raises(HullNotFoundError):
        client.create_alarm(name, hull=f"{name}/nobody", when="area > 1")
    assert client.create_alarm(name, prefix=f"{name}/", when="area > 1 km2").hulls == 1


def test_alarms_watch_a_limited_number_of_hulls(client: HullClient, name: str) -> None:
    for number in range(260):
        client.create_hull(f"{name}/{number}")
    client.create_alarm(name, prefix=f"{name}/", when="count > 9")
    with pytest.raises(LimitExceededError, match="500"):
        client.create_alarm(f"{name}/more", prefix=f"{name}/", when="count > 8")
    client.delete_alarm(name)
    client.create_alarm(f"{name}/more", prefix=f"{name}/", when="count > 8")
    client.delete_alarm(f"{name}/more")


def test_exactly_one_raise_between_two_clears(tmp_path: Path) -> None:
    """Over kills, a deadline that passes meanwhile, a clock that is set back, and a restore."""
    clock, data = SetTime(tmp_path), str(tmp_path / "data")
    with server_process("--data", data, wrap=clock.wrap, killed=True) as process, HullClient(process.address) as client:
        client.create_hull("fleet", keyed="str")
        client.create_hull("still", keyed="str")
        client.create_alarm("size", hull="fleet", when="area > 3", for_="1h")
        client.create_alarm("quiet", hull="still", when="silent 1h")
        client.create_alarm("many", hull="fleet", when="count > 3")
        square(client, "fleet", 2)
        uid = client.get_alarm("many").uid
        process.process.kill()
    clock.passes(HOUR)
    with server_process("--data", data, wrap=clock.wrap, killed=True) as process, HullClient(process.address) as client:
        for alarm in ("size", "quiet"):
            wait_until(lambda alarm=alarm: client.get_alarm(alarm).raised)
        client.acknowledge_alarm("size", "fleet")
        process.process.kill()
    clock.passes(-HOUR)
    assert dynhull("backup", str(tmp_path / "backup"), "--data", data).exit_code == 0
    assert dynhull("check", data).exit_code == 0
    with server_process("--data", data, wrap=clock.wrap) as process, HullClient(process.address) as client:
        (status,) = client.get_alarm("size").statuses
        assert status.raised
        assert status.acknowledged is not None
        square(client, "fleet", 3)
        square(client, "fleet", 1)
        client.put("still", ["a"], [(0, 0)])
        for alarm in ("size", "quiet"):
            events = seen(client, alarm)
            assert [event.type for event in events] == ["raised", "cleared"]
            assert events[0].time <= events[1].time
            assert events[0].time - events[0].cause_time == timedelta(seconds=HOUR)  # whenever the server looked
        assert [event.type for event in seen(client, "many")] == ["raised"]
        assert client.verify("fleet").equal
    assert dynhull("restore", str(tmp_path / "backup"), "--data", str(tmp_path / "again")).exit_code == 0
    with server_process("--data", str(tmp_path / "again")) as process, HullClient(process.address) as client:
        assert client.get_alarm("many").uid != uid
        with pytest.raises(AlarmReplacedError), client.watch_alarm("many", after=1, uid=uid) as stream:
            next(stream)
        with client.watch_alarm("size", after=1) as stream:
            lost, snapshot = next(stream), next(stream)
        assert (lost.type, lost.first, lost.last) == ("lost", 2, 2)
        assert (snapshot.type, snapshot.sequence, snapshot.raised) == ("snapshot", 3, ("fleet",))
        square(client, "fleet", 1)
        (cleared,) = seen(client, "size", after=3)
        assert (cleared.type, cleared.sequence) == ("cleared", 4)


def test_hulls_that_come_later_count_too() -> None:
    """One that would not be watched is refused, until there is room."""
    with (
        server_process("--max-alarm-hulls", "3", "--create-on-write") as process,
        HullClient(process.address) as client,
    ):
        client.create_alarm("many", prefix="f/", when="count > 1")
        for hull in ("f/a", "f/b", "f/c", "other"):
            client.create_hull(hull)
        with pytest.raises(LimitExceededError, match="max_alarm_hulls"):
            client.create_hull("f/d")
        with pytest.raises(LimitExceededError, match="max_alarm_hulls"):
            client.apply("f/d", insert=[(0, 0)])
        with pytest.raises(LimitExceededError, match="max_alarm_hulls"):
            client.create_alarm("more", hull="other", when="count > 1")
        client.delete_hull("f/a")
        client.apply("f/d", insert=[(0, 0), (1, 1)])
        assert (client.get_alarm("many").hulls, client.get_alarm("many").raised) == (3, 1)
        assert [each.name for each in client.list_hulls("f/")] == ["f/b", "f/c", "f/d"]
        client.delete_alarm("many")
        client.create_hull("f/e")
