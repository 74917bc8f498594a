"""Keys that should be inside of a fence by a time of day or within an age, and those that are not."""

import asyncio
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from live_engine import LIMITS
from mortal_server import MortalServer
from patience import PATIENCE, wait_until
from server_process import server_process

from dynhull.keys import PackedKeys
from dynhull_client import Circle, HullClient, InvalidRequestError
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock, Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.expected import daily
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.memory import MemoryStorage

SECOND = 1_000_000
MINUTE, HOUR = 60 * SECOND, 3600 * SECOND
AREA = CircleArea(0.0, 0.0, 5.0)


def at(text, zone="UTC"):
    """A local time in microseconds since 1970."""
    return int(datetime.fromisoformat(text).replace(tzinfo=ZoneInfo(zone)).timestamp()) * SECOND


def shown(moment):
    return datetime.fromtimestamp(moment // SECOND, UTC).isoformat(timespec="minutes").removesuffix("+00:00")


@pytest.mark.parametrize(
    ("text", "after", "expected"),
    [
        ("18:00 UTC", "2026-11-24T17:59", "2026-11-24T18:00"),
        ("18:00 UTC", "2026-11-24T18:00", "2026-11-25T18:00"),
        ("18:00:30 UTC", "2026-11-24T18:00", "2026-11-24T18:00"),
        ("06:00 UTC mon-fri", "2026-11-27T06:00", "2026-11-30T06:00"),  # after a Friday
        ("06:00 UTC sun", "2026-11-24T00:00", "2026-11-29T06:00"),
        ("06:00 UTC fri-mon", "2026-11-24T00:00", "2026-11-27T06:00"),
        ("06:00 UTC mon,wed", "2026-11-24T00:00", "2026-11-25T06:00"),
        ("00:30 Asia/Tokyo tue", "2026-11-23T00:00", "2026-11-23T15:30"),  # a Monday in UTC
        ("02:30 Europe/Berlin", "2026-03-28T02:00", "2026-03-29T01:30"),  # skipped: 03:30 CEST
        ("03:30 Europe/Berlin", "2026-03-28T03:00", "2026-03-29T01:30"),  # the same moment
        ("02:30 Europe/Berlin", "2026-03-29T01:30", "2026-03-30T00:30"),
        ("02:30 Europe/Berlin", "2026-10-24T01:00", "2026-10-25T00:30"),  # twice: the first, in summer time
        ("02:30 Europe/Berlin", "2026-10-25T00:30", "2026-10-26T01:30"),  # and not the second
        ("02:15 Australia/Lord_Howe", "2026-10-03T00:00", "2026-10-03T15:45"),  # half an hour is skipped: 02:45
        ("12:00 Pacific/Apia", "2011-12-29T22:00", "2011-12-30T22:00"),  # a day is skipped
    ],
)
def test_times_of_day(text, after, expected):
    found = daily(text).after(at(after))
    assert shown(found) == expected
    if ":30 UTC" in text:
        assert found % MINUTE == 30 * SECOND


def test_a_time_of_day_comes_each_day_of_a_year():
    for zone in ("Europe/Berlin", "America/St_Johns", "Australia/Lord_Howe", "UTC"):
        rule, moment, days = daily(f"02:30 {zone}"), at("2026-01-01T00:00", zone), []
        while len(days) < 365:
            moment = rule.after(moment)
            days.append(datetime.fromtimestamp(moment // SECOND, ZoneInfo(zone)).date())
        assert len(set(days)) == 365
        assert (days[-1] - days[0]).days == 364


@pytest.mark.parametrize(
    "text",
    ["18:00", "18 UTC", "24:00 UTC", "18:60 UTC", "18:00 Mars/Base", "18:00 UTC someday", "18:00 UTC mon fri", ""],
)
def test_what_is_no_time_of_day(text):
    with pytest.raises(ValueError, match="HH:MM"):
        daily(text)


class SetClock(Clock):
    """It stands still until a test moves it."""

    def __init__(self):
        self.seconds = 1_800_000_000.0

    def wall(self):
        return self.seconds

    def monotonic(self):
        return self.seconds


@asynccontextmanager
async def served(hulls=("fleet",)):
    machine = Machine(SetClock())
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(LIMITS, MemoryStorage(), supervisor, machine)
    await engine.start(lambda *_: None)
    for name in hulls:
        await engine.hulls.create(name, HullSettings("str"))
    yield engine, machine.clock
    await supervisor.stop()
    await engine.close()


async def put(engine, name, positions, removes=()):
    keys, points = PackedKeys.pack(list(positions)), np.array(list(positions.values()), float).reshape(-1, 2)
    batch = KeyedBatch("str", keys, points, PackedKeys.pack(removes))
    await engine.hulls.apply(Write(name, batch, engine.driver.time()), create=False)


def told(events, begun):
    return [(e.type.name, e.key, (e.time - begun) // SECOND, e.position) for e in events]


def test_an_age():
    """Each key is missing once, when it was due, whoever looks when; and arrives once."""

    async def life():
        async with served() as (engine, clock):
            await put(engine, "fleet", {"in": (1, 0), "out": (9, 0)})
            config = FenceConfig(
                AREA, "hull", "fleet", initial="none", expected=("in", "never", "out"), expected_within=60 * SECOND
            )
            await engine.fences.create("fence", config)
            begun = engine.driver.time()
            for seconds, positions in [
                (50, {"out": (2, 0)}),  # it comes in time
                (30, {"in": (9, 0)}),  # "never" is missing since 60
                (70, {"never": (0, 0)}),  # "in" was missing at 140, before this batch at 150
                (1, {"in": (3, 0), "out": (9, 0)}),
                (5, {"out": (1, 1)}),
            ]:
                clock.seconds += seconds
                await put(engine, "fleet", positions)
            return begun, await engine.fences.get("fence").events(0, 100)

    begun, events = asyncio.run(life())
    assert told(events, begun) == [
        ("ENTER", "out", 50, (2.0, 0.0)),
        ("MISSING", "never", 60, None),
        ("EXIT", "in", 80, (9.0, 0.0)),
        ("MISSING", "in", 140, (9.0, 0.0)),
        ("ENTER", "never", 150, (0.0, 0.0)),
        ("ARRIVED", "never", 150, (0.0, 0.0)),
        ("ENTER", "in", 151, (3.0, 0.0)),
        ("EXIT", "out", 151, (9.0, 0.0)),
        ("ARRIVED", "in", 151, (3.0, 0.0)),
        ("ENTER", "out", 156, (1.0, 1.0)),
    ]
    assert [(e.first_time - begun) // SECOND for e in events if e.type.name == "MISSING"] == [0, 80]
    assert [(e.first_time - begun) // SECOND for e in events if e.type.name == "ARRIVED"] == [60, 140]
    assert events[3].distance == 4


def test_a_time_of_day_over_several_hulls():
    """At each deadline everybody who is not inside is missing, once more; and arrives once."""

    async def life():
        async with served(("all/a", "all/b")) as (engine, clock):
            clock.seconds = at("2026-11-27T08:00") / SECOND  # a Friday
            await put(engine, "all/a", {"x": (1, 0), "y": (9, 0)})
            config = FenceConfig(
                AREA, "prefix", "all/", initial="events", expected=("x", "y", "z"), expected_by="09:00 UTC mon-fri"
            )
            await engine.fences.create("fence", config)
            begun = engine.driver.time()
            clock.seconds += 2 * 3600
            await put(engine, "all/b", {"y": (1, 1)})
            clock.seconds += 3 * 24 * 3600
            await put(engine, "all/b", {"z": (2, 0)}, ["y"])
            return begun, await engine.fences.get("fence").events(0, 100)

    begun, events = asyncio.run(life())
    monday = 3 * 24 * 3600
    assert [(e.type.name, e.key, (e.time - begun) // SECOND, e.hull) for e in events] == [
        ("ENTER", "x", 0, "all/a"),
        ("MISSING", "y", 3600, "all/a"),
        ("MISSING", "z", 3600, ""),
        ("ENTER", "y", 7200, "all/b"),
        ("ARRIVED", "y", 7200, "all/b"),
        ("MISSING", "z", monday + 3600, ""),
        ("EXIT", "y", monday + 7200, "all/b"),
        ("ENTER", "z", monday + 7200, "all/b"),
        ("ARRIVED", "z", monday + 7200, "all/b"),
    ]


# From outside


def events_of(client, fence, last):
    found = []
    with client.watch_fence(fence, after=0, timeout=PATIENCE) as watch:
        while len(found) < last:
            found.append(next(watch))
    return found


def test_nothing_is_lost_or_said_twice_over_kills(tmp_path):
    server = MortalServer(tmp_path)
    with HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str")
        settings = {"area": Circle(0, 0, 5), "subjects": "fleet", "expected": ["a", "b", "c"], "expected_within": 2}
        fence = client.create_fence("fence", **settings)
        assert (fence.expected, fence.expected_within) == (("a", "b", "c"), timedelta(seconds=2))
        assert client.create_fence("fence", **settings, exist_ok=True).uid == fence.uid
        client.put("fleet", ["a"], [[1, 0]])
        for last in (4, 6, 7):
            server.kill()
            server.start()
            if last == 6:
                client.put("fleet", ["b"], [[1, 1]])
            if last == 7:
                client.remove("fleet", ["a"])
            wait_until(lambda last=last: client.get_fence("fence").last_sequence >= last)
        wait_until(lambda: client.get_fence("fence").last_sequence >= 8)
        server.kill()
        server.start()
        found = events_of(client, "fence", 8)
        assert [(e.type, e.key) for e in found] == [
            ("snapshot", None),
            ("enter", "a"),
            ("missing", "b"),
            ("missing", "c"),
            ("enter", "b"),
            ("arrived", "b"),
            ("exit", "a"),
            ("missing", "a"),
        ]
        missing = [each for each in found if each.type == "missing"]
        assert {each.time - each.first_time for each in missing} == {timedelta(seconds=2)}
        assert missing[2].first_time == found[6].time
        assert found[5].first_time == missing[0].time
        client.replace_fence("fence", **settings | {"expected": ["c"], "expected_within": 3600})
        assert client.get_fence("fence").expected == ("c",)
        assert client.get_fence("fence").last_sequence == 8
        past = list(client.fence_events_between(**settings, start=fence.created))
        assert [(e.type, e.key) for e in past] == [(e.type, e.key) for e in found]
    server.kill()


def test_what_is_refused():
    with server_process("--in-memory") as process, HullClient(process.address) as client:
        client.create_hull("fleet", keyed="str")
        for settings, field in [
            ({"expected": ["a"]}, "config.expected"),
            ({"expected": ["a", "b", "a"], "expected_within": 1}, "config.expected"),
            ({"expected": [], "expected_within": 1}, "config.expected"),
            ({"expected": [7], "expected_within": 1}, "config.expected[0]"),
            ({"expected": range(10_001), "expected_within": 1}, "config.expected"),
            ({"expected_by": "18:00 UTC"}, "config.expected_by"),
            ({"expected": ["a"], "expected_by": "18:00"}, "config.expected_by"),
            ({"expected": ["a"], "expected_by": "18:00 Nowhere/Else"}, "config.expected_by"),
        ]:
            with pytest.raises(InvalidRequestError) as refused:
                client.create_fence("fence", Circle(0, 0, 5), "fleet", **settings)
            assert refused.value.metadata["field"] == field, settings
            if "expected_by" in settings:
                assert refused.value.metadata["value"] in (settings["expected_by"], "given")
        client.create_hull("other", keyed="str")
        with pytest.raises(InvalidRequestError, match="expected"):
            client.create_fence("fence", "fleet", other_hull="other", expected=["a"], expected_within=1)
