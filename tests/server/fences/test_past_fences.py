"""Fences after the fact make the events of those that were there, in the same order, and field by field."""

import asyncio
import hashlib
import json
import random
import re
from dataclasses import replace

import numpy as np
import pytest
from application_call import called
from patience import PATIENCE, wait_until
from server_process import run, server_process

from dynhull_client import (
    AsyncHullClient,
    Batch,
    Circle,
    HullClient,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidRequestError,
    LimitExceededError,
    PermissionDeniedError,
    Polygon,
    Prefix,
    Quarantine,
    RevisionForgottenError,
    UnauthenticatedError,
)
from dynhull_gateway.app import application
from dynhull_gateway.settings import Settings

TRIANGLE = [[0, 0], [8, 0], [8, 7]]
KEYS = [f"k{number}" for number in range(30)]
FENCES = {
    "polygon": {"area": TRIANGLE, "subjects": "all/a"},
    "holes": {"area": Polygon(TRIANGLE, [[[6, 1], [7, 1], [7, 2]]]), "subjects": "all/a", "boundary": "open"},
    "circle": {"area": Circle(0, 0, 5), "subjects": "all/a", "crosses": True, "initial": "events"},
    "own": {"area": "all/a", "subjects": "all/a", "without_self": True, "margin": 1.0},
    "layer": {"area": "all/a", "subjects": "all/a", "layer": 2, "initial": "none"},
    "other": {"area": "all/b", "subjects": "all/a", "margin": 0.5},
    "pair": {"area": "all/b", "other_hull": "all/c", "near": 1.0},
    "confirmed": {"area": TRIANGLE, "subjects": "all/a", "confirmations": 2},
    "accurate": {"area": "all/b", "subjects": "all/accurate", "by_accuracy": True, "margin": 0.5},
    "globe-accurate": {"area": Circle(13.4, 52.4, 60_000), "subjects": "all/globe", "by_accuracy": True},
    "globe": {"area": [[13, 52], [13.8, 52], [13.8, 52.7]], "subjects": "all/globe"},
    "metres": {"area": [[13, 52], [13.8, 52], [13.8, 52.7]], "subjects": "all/globe", "margin": 20_000},
    "globes": {"area": "all/globe", "subjects": "all/globe", "boundary": "open"},
    "held": {"area": TRIANGLE, "subjects": "all/held", "initial": "events"},
    "leaving": {"area": Circle(0, 0, 8), "subjects": "all/leaving", "confirmations": 2},
    "window": {"area": "all/a", "subjects": "all/b", "boundary": "open"},
}
NAMES = "all", "now", "half", "gone"
pytestmark = pytest.mark.usefixtures("written")
PAST = {"all": [""], "half": ["all/a"], "gone": [""]}


def tokens(names):
    return "".join(
        f'[[token]]\nsha256 = "{hashlib.sha256(name.encode()).hexdigest()}"\nread = [""]\nwrite = [""]\n'
        f"past = {PAST.get(name, [])}\n"
        for name in names
    )


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server, and the file of its tokens."""
    folder = tmp_path_factory.mktemp("past-fences")
    file = folder / "tokens.toml"
    file.write_text(tokens(NAMES))
    options = "--data", str(folder / "data"), "--tokens", str(file), "--max-past-reads-per-caller", "2"
    with server_process(*options, complaints=None) as server:
        yield server.address, file


@pytest.fixture(scope="module")
def client(served):
    with HullClient(served[0], token="all") as client:
        yield client


def plain(event):
    """What an event says, without what belongs to a fence that is there, and the server's times."""
    return replace(event, fence="", uid="", after=None, time=None, first_time=None)


def live_events(client, fence):
    last = client.get_fence(fence).last_sequence
    found = []
    with client.watch_fence(fence, after=0, timeout=PATIENCE) as watch:
        while len(found) < last:
            found.append(next(watch))
    return found


def write(client, rng):
    """One random batch to one of two hulls, or to both."""
    keys = rng.sample(KEYS, rng.randint(1, 5))
    points = [(rng.randint(-10, 10), rng.randint(-10, 10)) for _ in keys]
    kind, hull = rng.random(), rng.choice(["all/a", "all/a", "all/b"])
    if kind < 0.1:
        client.put("all/c", ["c"], [(rng.choice([0, 10.5, 30]), 0)])
    elif kind < 0.75:
        client.put(hull, keys, points)
    elif kind < 0.85:
        client.remove(hull, keys, missing="count")
    else:
        puts, removes = Batch(keys=keys, points=points), Batch(remove=keys, missing="count")
        client.transfer({"all/a": puts, "all/b": removes} if kind < 0.93 else {"all/b": puts, "all/a": removes})


@pytest.fixture(scope="module")
def written(client):
    """Fences that were there, beside hulls that have changed since."""
    rng, other = random.Random(5), random.Random(6)
    client.create_hull("all/a", keyed="str")
    client.create_hull("all/b", keyed="str", max_points=20)
    client.create_hull("all/c", keyed="str")
    for hull in ("all/a", "all/b"):
        client.put(hull, KEYS[:10], [(rng.randint(-10, 10), rng.randint(-10, 10)) for _ in range(10)])
    client.create_hull("all/globe", keyed="str", geographic=True, center=(13.4, 52.4))
    client.create_hull("all/held", keyed="str", quarantine=Quarantine(max_growth=1.5))
    client.create_hull("all/leaving", keyed="str")
    client.create_hull("all/accurate", keyed="str")
    for name, settings in FENCES.items():
        client.create_fence(name, **settings)
    for _ in range(80):
        write(client, rng)
        keys = other.sample(KEYS, 2)
        errors = None if other.random() < 0.2 else [other.choice([0, 1, 5, 9]) for _ in keys]
        client.put(
            "all/accurate", keys, [(other.randint(-10, 10), other.randint(-10, 10)) for _ in keys], accuracies=errors
        )
    for _ in range(12):
        keys = rng.sample(KEYS, 6)
        xy = np.array([(rng.randint(-10, 10), rng.randint(-10, 10)) for _ in keys]) * rng.choice([1, 1, 3])
        metres = [other.choice([0, 5_000, 20_000, 60_000]) for _ in keys]
        client.put("all/globe", keys, xy / 10 + [13.4, 52.4], accuracies=metres)
        client.put("all/held", keys, xy)
        client.put("all/leaving", keys, xy, ttl=rng.choice([0.001, 100]))


@pytest.mark.parametrize("name", FENCES)
def test_the_events_are_those_of_a_fence_that_was_there(client, name):
    least = client.get_fence(name).last_sequence
    start = client.get_fence(name).created
    past = list(client.fence_events_between(**FENCES[name], start=start, timeout=PATIENCE))
    live = live_events(client, name)[: len(past)]  # keys may have left since
    assert [plain(event) for event in past] == [plain(event) for event in live]
    assert len(past) >= max(least, 2)
    for event, then in zip(past[1:], live[1:], strict=True):
        assert event.time >= then.time, "the commit comes after the arrival"


def test_it_begins_and_ends_where_it_is_told(client):
    revision = client.get_hull("all/a").info.revision - 40
    fence = {"area": Circle(0, 0, 9), "subjects": "all/a", "initial": "events"}
    events = list(client.fence_events_between(**fence, start=revision, end=revision + 20))
    assert {event.revision for event in events if event.cause == {"fence_created"}} == {revision}
    assert max(event.revision for event in events) <= revision + 20
    assert [event.sequence for event in events] == list(range(1, len(events) + 1))
    times = [client.at("all/a", each).time for each in (revision, revision + 20)]
    by_time = list(client.fence_events_between(**fence, start=times[0], end=times[1].isoformat()))
    assert [plain(event) for event in by_time] == [plain(event) for event in events]
    whole = list(client.fence_events_between(TRIANGLE, "all/a"))
    assert (whole[0].type, whole[0].inside) == ("snapshot", ())
    assert whole[-1].revision > revision
    of_two = list(client.fence_events_between("all/b", "all/a", start=revision))
    assert {event.revision for event in of_two if event.type == "snapshot"} == {0}
    assert all(event.revision >= revision for event in of_two[1:])


def test_what_cannot_be_is_refused_by_name(client):
    def asked(*given, **settings):
        return list(client.fence_events_between(*given, **settings))

    with pytest.raises(HullNotFoundError):
        asked(TRIANGLE, "nobody")
    with pytest.raises(HullUnsuitableError, match="revisions of their own: give a time"):
        asked(TRIANGLE, Prefix("all/"), start=1)
    with pytest.raises(HullUnsuitableError, match="is a prefix of no keyed hull"):
        asked(TRIANGLE, Prefix("nobody/"))
    with pytest.raises(HullUnsuitableError, match="geographic"):
        asked(TRIANGLE, Prefix("all/"))
    with pytest.raises(RevisionForgottenError, match="the newest"):
        asked(TRIANGLE, "all/a", start=10**6)
    with pytest.raises(RevisionForgottenError, match="is before the oldest revision with a time") as refused:
        asked(TRIANGLE, "all/a", start="2026-01-01T00:00Z")
    assert refused.value.metadata["field"] == "start_time"
    with pytest.raises(InvalidRequestError, match="end is 1: is before the start"):
        asked(TRIANGLE, "all/a", start=2, end=1)
    with pytest.raises(HullUnsuitableError, match="before the start"):
        asked(TRIANGLE, "all/a", start=client.at("all/a", 5).time, end=1)
    with pytest.raises(InvalidRequestError, match="edges 0 and 2 cross"):
        asked([[0, 0], [1, 1], [1, 0], [0, 1]], "all/a")


OVER_MANY = {
    "polygon": {"area": TRIANGLE, "crosses": True, "initial": "events"},
    "one-of-them": {"area": "over/a", "margin": 1.0},
    "another": {"area": "all/a", "boundary": "open"},
    "confirmed": {"area": Circle(0, 0, 7), "confirmations": 2, "initial": "none"},
}


def test_a_prefix_has_the_events_of_its_hulls_and_of_those_that_came_later(client):
    """Keys go from hull to hull in batches over both, and some hulls are there before the fences, some after."""
    rng = random.Random(7)
    client.create_hull("over/plain")
    hulls = ["over/a", "over/b"]
    for name in hulls:
        client.create_hull(name, keyed="str")
        client.put(name, KEYS[:8], [(rng.randint(-10, 10), rng.randint(-10, 10)) for _ in range(8)])
    for name, settings in OVER_MANY.items():
        client.create_fence(f"over/{name}", subjects=Prefix("over/"), **settings)
    for number in range(90):
        if number in (30, 60):
            hulls.append(f"over/later-{number}")
            client.create_hull(hulls[-1], keyed="str")
        keys = rng.sample(KEYS, rng.randint(1, 4))
        points = [(rng.randint(-10, 10), rng.randint(-10, 10)) for _ in keys]
        first, second = rng.sample(hulls, 2)
        if rng.random() < 0.4:
            client.transfer({first: Batch(keys=keys, points=points), second: Batch(remove=keys, missing="count")})
        else:
            client.put(rng.choice([first, "all/a"]), keys, points)
    newest = max(client.at(name, client.get_hull(name).info.revision).time for name in [*hulls, "all/a"])
    found: set[str] = set()
    for name, settings in OVER_MANY.items():
        fence = client.get_fence(f"over/{name}")
        given = settings | {"subjects": Prefix("over/"), "start": fence.created, "end": newest}
        past = list(client.fence_events_between(**given, timeout=PATIENCE))
        assert [plain(each) for each in past] == [plain(each) for each in live_events(client, fence.name)], name
        assert len(past) > 5
        found |= {each.hull for each in past}
        client.delete_fence(fence.name)
    assert found >= set(hulls)
    oldest = list(client.fence_events_between(TRIANGLE, Prefix("over/"), initial="none"))
    assert len(oldest) > 20
    for name in [*hulls, "over/plain"]:
        client.delete_hull(name)


@pytest.mark.parametrize("subjects", ["auto/hull", Prefix("auto/hull")], ids=["hull", "prefix"])
def test_a_hull_on_the_globe_gets_its_centre_after_the_start(client, subjects):
    """Its events are those of a fence at a hull that had this centre from the beginning."""
    rng = random.Random(9)
    client.create_hull("auto/hull", keyed="str", geographic=True)
    client.remove("auto/hull", ["nobody"], missing="count")
    batches = [(rng.sample(KEYS, 4), [(rng.uniform(12, 15), rng.uniform(51, 54)) for _ in range(4)]) for _ in range(20)]
    for keys, points in batches:
        client.put("auto/hull", keys, points)
    client.create_hull("auto/twin", keyed="str", geographic=True, center=client.get_hull("auto/hull").info.center)
    fence = {"area": [[13, 52], [13.8, 52], [13.8, 53]], "margin": 20_000, "crosses": True}
    client.create_fence("auto/fence", subjects="auto/twin", **fence)
    client.remove("auto/twin", ["nobody"], missing="count")
    for keys, points in batches:
        client.put("auto/twin", keys, points)
    past = [plain(each) for each in client.fence_events_between(subjects=subjects, **fence, timeout=PATIENCE)]
    live = [replace(plain(each), hull=each.hull and "auto/hull") for each in live_events(client, "auto/fence")]
    assert past == live
    assert len(past) > 10
    client.delete_fence("auto/fence")
    for name in ("auto/hull", "auto/twin"):
        client.delete_hull(name)


@pytest.fixture(scope="module")
def many(client):
    """A hull with more events than a connection holds."""
    keys = [f"many{number}" for number in range(2000)]
    client.create_hull("many", keyed="str")
    for x in (1.0, 20.0) * 30:
        client.put("many", keys, [(x, 0.5)] * len(keys))


@pytest.mark.usefixtures("many")
def test_it_needs_the_past_of_both_hulls_and_ends_with_the_token(served, client):
    _, file = served
    fence = {"area": "all/b", "subjects": "all/a"}
    for token, hull in (("now", "all/a"), ("half", "all/b")):
        with pytest.raises(PermissionDeniedError, match=f"read the past of '{hull}'"):
            list(client.with_token(token).fence_events_between(**fence))
    reader = client.with_token("gone")
    with reader.fence_events_between(TRIANGLE, "many") as unread, reader.fence_events_between(TRIANGLE, "many") as more:
        assert (next(unread).type, next(more).type) == ("snapshot", "snapshot")
        with pytest.raises(LimitExceededError, match="max_past_reads_per_caller"):
            list(reader.fence_events_between(TRIANGLE, "many"))
        file.write_text(tokens([name for name in NAMES if name != "gone"]))
        wait_until(lambda: refused(reader))
        with pytest.raises(UnauthenticatedError):
            list(unread)


def refused(reader):
    try:
        reader.get_hull("many")
    except UnauthenticatedError:
        return True
    return False


@pytest.mark.usefixtures("many")
def test_a_hull_that_is_deleted_meanwhile_ends_it(client):
    with client.fence_events_between(TRIANGLE, "many") as events:
        next(events)
        client.delete_hull("many")
        with pytest.raises(HullNotFoundError):
            for _ in events:
                pass


def test_its_hulls_have_no_more_points_together_than_a_reader_may_have(tmp_path):
    options = "--data", str(tmp_path), "--max-past-rows", "30"
    with server_process(*options, complaints=None) as server, HullClient(server.address) as client:
        for name, points in (("yard", 10), ("fleet", 10)):
            client.create_hull(name, keyed="str")
            client.put(name, [f"k{i}" for i in range(points)], [(i, i * i) for i in range(points)])
        client.put("fleet", [f"more {i}" for i in range(12)], [(i, -i * i) for i in range(12)])
        assert list(client.fence_events_between("yard", "fleet", start=1, end=1))
        assert list(client.fence_events_between(TRIANGLE, "fleet", start=1))
        with pytest.raises(
            LimitExceededError, match="max_past_rows is 30: 32 points of 'fleet' at revision 2 and 'yard'"
        ):
            list(client.fence_events_between("yard", "fleet", start=1))


def test_the_asyncio_client_and_the_command_line(served, client, monkeypatch):
    expected = [plain(event) for event in client.fence_events_between(TRIANGLE, "all/a", start=3, end=30)]

    async def asked():
        async with AsyncHullClient(served[0], token="all") as client:
            return [plain(event) async for event in client.fence_events_between(TRIANGLE, "all/a", start=3, end=30)]

    assert asyncio.run(asked()) == expected
    monkeypatch.setenv("DYNHULL_TOKEN", "all")
    words = "--polygon", "POLYGON ((0 0, 8 0, 8 7, 0 0))", "--subjects", "all/a", "--from", "3", "--to", "30"
    lines = run("fences", "between", *words, "--address", served[0]).stdout.splitlines()
    assert [line.split("\t")[:5:2] for line in lines[1:]] == [
        [str(event.sequence), event.type, event.key] for event in expected[1:]
    ]


def test_over_http(served, client):
    fence = {"area": {"exterior": TRIANGLE}, "subjects": "all/a", "start": "3", "end": "30"}
    requests = fence, fence | {"subjects": "nobody"}, fence | {"end": "2"}, fence | {"start": "yesterday"}

    async def asked():
        async with AsyncHullClient(served[0]) as client:
            app = application(client, Settings())
            return [await called(app, "/fences/between", each, authorization="Bearer all") for each in requests]

    (status, answered), *refused = asyncio.run(asked())
    assert status == 200
    *events, last = re.findall("event: (.*)\ndata: (.*)\n", answered)
    expected = list(client.fence_events_between(TRIANGLE, "all/a", start=3, end=30))
    assert [(kind, json.loads(data)["sequence"]) for kind, data in events] == [
        (event.type, event.sequence) for event in expected
    ]
    assert last == ("complete", f'{{"events":{len(expected)}}}')
    assert [(status, json.loads(body)["reason"]) for status, body in refused] == [
        (404, "HULL_NOT_FOUND"),
        (400, "INVALID_FIELD"),
        (400, "INVALID_FIELD"),
    ]
