"""Reads as of an earlier revision or time answer exactly what the hull answered then, and a replay shows it."""

import asyncio
import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

import grpc
import numpy as np
import pytest
from application_call import called
from cases import slow
from command_line import dynhull
from proxy import proxy
from server_process import run, server_process

from dynhull_client import (
    AsyncHullClient,
    HullClient,
    HullCopy,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    InvalidRequestError,
    LimitExceededError,
    PermissionDeniedError,
    Progress,
    Quarantine,
    RevisionForgottenError,
    Sketch,
    UnauthenticatedError,
    UnavailableError,
)
from dynhull_gateway.app import application
from dynhull_gateway.settings import Settings
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

BATCHES = 9
KINDS = {
    "plain": {},
    "keyed": {"keyed": "str"},
    "numbered": {"keyed": "int"},
    "globe": {"geographic": True},
    "globe-keyed": {"geographic": True, "keyed": "str"},
    "newest": {"max_points": 25},
    "recent": {"max_age": 20.0, "clock": "data"},
    "recent-keyed": {"max_age": 20.0, "clock": "data", "keyed": "str"},
    "quarantine": {"keyed": "str", "quarantine": Quarantine(max_growth=1.5)},
}
# Hulls whose positions have accuracies.
INEXACT = {"keyed", "globe-keyed", "recent-keyed", "quarantine"}
START = datetime(2026, 1, 1, tzinfo=UTC)
XY = np.random.default_rng(7).normal(size=(12, 2))


def write(client, name, rng, second):
    """One random batch."""
    n = int(rng.integers(1, 8))
    xy = np.round(rng.normal(size=(n, 2)) * (1 + 3 * (rng.random() < 0.2)), 3)
    times = [START + timedelta(seconds=second)] * n if name.startswith("recent") else None
    if "keyed" in KINDS[name]:
        keys = rng.permutation(15)[:n].tolist()
        keys = [f"k{key}" for key in keys] if KINDS[name]["keyed"] == "str" else keys
        client.put(name, keys, xy, times, accuracies=np.arange(n) % 3 if name in INEXACT else None)
        if rng.random() < 0.2:
            client.remove(name, keys[:1], missing="count")
    elif times is not None:
        client.apply(name, insert=xy, times=times)
    else:
        client.apply(name, insert=xy)
        if name != "newest" and rng.random() < 0.3:
            client.apply(name, delete=xy[:1])
    if KINDS[name].get("geographic") and rng.random() < 0.1:
        client.recenter(name)


def answers(hull, keyed):
    """What a hull says to every kind of question, with its revision, as values that compare bit for bit."""
    found = [
        hull.get_hull(),
        hull.locate(XY),
        hull.support(XY),
        hull.distance(XY),
        hull.tangents(XY),
        hull.get_measures(),
        hull.count(XY),
        hull.layers(2),
        hull.influence(),
        hull.sample_points(1000),
    ]
    if keyed:
        found += [hull.entities(), hull.locate(keys=hull.entities().keys), hull.positions(hull.entities().keys)]
    return [repr(each) for each in found]


def plain(key):
    return key if isinstance(key, str) else int(key)


class Live:
    """The reading methods of a client for one hull."""

    def __init__(self, client, name):
        self._client, self._name = client, name

    def __getattr__(self, method):
        return lambda *arguments, **options: getattr(self._client, method)(self._name, *arguments, **options)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A folder that a killed server has left, and what its hulls answered at each revision, and when."""
    folder = str(tmp_path_factory.mktemp("past") / "data")
    seen = {name: {} for name in KINDS}
    rng = np.random.default_rng(3)
    with server_process("--data", folder, killed=True) as server, HullClient(server.address) as client:
        for name, settings in KINDS.items():
            client.create_hull(name, **settings)
            first = {"times": [START]} if name.startswith("recent") else {}
            if "keyed" in settings:
                client.put(name, ["first" if settings["keyed"] == "str" else 99], [(0.5, 0.5)], **first)
            else:
                client.apply(name, insert=[(0.5, 0.5)], **first)
        for second in range(BATCHES):
            for name in KINDS:
                write(client, name, rng, second)
                hull = client.get_hull(name)
                found = answers(Live(client, name), "keyed" in KINDS[name])
                seen[name][hull.info.revision] = found, hull.info.changed, hull
        server.process.kill()
    return folder, seen


@pytest.fixture(scope="module")
def served(recorded):
    folder, seen = recorded
    with server_process("--data", folder, torn=True) as server:
        yield server.address, seen


@pytest.mark.parametrize("name", [pytest.param(name, marks=slow) if name == "globe" else name for name in KINDS])
def test_every_revision_answers_as_it_did(served, name):
    address, seen = served
    order = list(seen[name])
    np.random.default_rng(1).shuffle(order)  # forward from kept ones, and back
    with HullClient(address) as client:
        for revision in order[:6]:
            expected, changed, _ = seen[name][revision]
            past = client.at(name, revision)
            assert (past.revision, past.time) == (revision, changed)
            assert answers(past, "keyed" in KINDS[name]) == expected
            assert client.at(name, changed).revision == revision
            assert client.at(name, changed.isoformat()).revision == revision
            assert past.verify().equal


@pytest.mark.parametrize("name", KINDS)
def test_a_copy_that_follows_a_replay_is_the_hull_of_each_revision(served, name):
    address, seen = served
    keys = "keyed" in KINDS[name]
    last = max(seen[name])
    with HullClient(address) as client:
        copy, revisions = HullCopy(), []
        for event in client.replay(name, end=last, copy=copy, keys=keys, measures=True):
            revisions.append(event.revision)
            if event.revision not in seen[name]:
                continue
            _, changed, hull = seen[name][event.revision]
            assert (event.changed, event.clock) == (changed, hull.info.clock)
            assert (copy.uid, copy.points, copy.center) == (hull.info.uid, hull.info.points, hull.info.center)
            assert np.array_equal(copy.vertices, hull.vertices)
            assert copy.vertex_keys == hull.vertex_keys
            assert isinstance(event, Progress) or repr(event.measures) == repr(hull.measures)
        assert revisions == list(range(last + 1))
        first = sorted(seen[name])[2]
        begin, end = seen[name][first][1], seen[name][last][1]
        for event in client.replay(name, begin, end.isoformat(), layer=2, copy=copy, every=3600.0):
            assert event.revision in (first, last)
        assert np.array_equal(copy.vertices, client.at(name, last).layers(2).layers[1])
        sketches = [each for each in client.replay(name, last - 1, last, max_vertices=3) if isinstance(each, Sketch)]
        of_now = next(client.watch(name, max_vertices=3))
        assert name == "keyed" or (sketches[-1].error, sketches[-1].vertices.tolist()) == (
            of_now.error,
            of_now.vertices.tolist(),
        )


def test_a_replay_goes_on_where_it_was_after_a_lost_connection(served):
    address, seen = served
    last = max(seen["keyed"])
    with proxy(address) as way, HullClient(way.address) as client:
        for options in ({}, {"layer": 2}, {"max_vertices": 3}):
            revisions, copy = [], HullCopy()
            for event in client.replay("keyed", 1, last, keys=True, copy=copy, max_rate=400.0, **options):
                if event.revision % 7 == 0:
                    way.cut()
                revisions.append(event.revision)
            assert revisions == list(range(1, last + 1))
            if not options:
                assert copy.vertex_keys == seen["keyed"][last][2].vertex_keys
        with client.replay("keyed", 1, last, reconnect=False, max_rate=20.0) as played:
            next(played)
            way.cut()
            with pytest.raises(UnavailableError):
                list(played)


def test_a_replay_is_refused_by_name(served):
    address, seen = served
    last = max(seen["plain"])
    with HullClient(address) as client:
        with pytest.raises(InvalidRequestError, match="is before the start, which is revision 3"):
            list(client.replay("plain", 3, 2))
        with pytest.raises(RevisionForgottenError, match=f"the newest {last}") as refused:
            list(client.replay("plain", end=last + 9))
        assert refused.value.field == "end_revision"
        with pytest.raises(RevisionForgottenError, match="is not over by the server's clock") as refused:
            list(client.replay("plain", end=datetime.now(UTC) + timedelta(days=1)))
        assert refused.value.field == "end_time"
        for options, field in (({"speed": -1.0}, "speed"), ({"speed": float("nan")}, "speed"), ({"every": 0}, "every")):
            with pytest.raises(InvalidRequestError, match=field):
                list(client.replay("plain", **options))
        with pytest.raises(HullUnsuitableError, match="keys"):
            list(client.replay("plain", keys=True))
        with pytest.raises(HullNotFoundError):
            list(client.replay("nobody"))


def test_the_past_is_read_while_writers_go_on(served):
    address, seen = served
    revisions = [revision for revision in seen["keyed"] if revision % 3 == 0]
    with HullClient(address) as client, ThreadPoolExecutor() as threads:

        def read(revision):
            return answers(client.at("keyed", revision), True) == seen["keyed"][revision][0]

        reads = [threads.submit(read, revision) for revision in revisions for _ in range(2)]
        for number in range(20):
            client.put("keyed", ["late"], [(float(number), 1.0)])
        assert all(each.result() for each in reads)


def test_what_is_not_there_is_refused_by_name(served):
    address, _ = served
    with HullClient(address) as client:
        newest = client.get_hull("plain").info.revision
        with pytest.raises(RevisionForgottenError, match=f"the newest {newest}"):
            client.at("plain", newest + 1)
        with pytest.raises(RevisionForgottenError, match="is not over by the server's clock"):
            client.at("plain", datetime.now(UTC) + timedelta(days=1))
        with pytest.raises(RevisionForgottenError, match="is before the oldest revision with a time, 0 of 20"):
            client.at("plain", time=1)
        with pytest.raises(InvalidRequestError, match="keys_of"):
            client.at("keyed", newest - 1).locate(keys=["k1"], keys_of="quarantine")
        with pytest.raises(ValueError, match="no time zone"):
            client.at("plain", "2026-01-01T00:00")
        assert len(client.at("plain", 0).get_hull().vertices) == 0


def test_points_and_what_is_held_are_read_as_they_were(served):
    address, _ = served
    seen = []
    with grpc.insecure_channel(address) as channel, HullClient(address) as client:
        stub = HullServiceStub(channel)

        def listed(**moment):
            points = list(stub.ReadPoints(pb.ReadPointsRequest(name="held", **moment)))
            held = stub.ListHeld(pb.ListHeldRequest(name="held", **moment))
            return [each.SerializeToString(deterministic=True) for each in (*points, held)]

        client.create_hull("held", keyed="str", quarantine=Quarantine(max_growth=1.5, confirmations=0))
        client.put("held", ["a", "b", "c"], [(0, 0), (1, 0), (0, 1)])
        seen.append((client.get_hull("held").info.revision, listed()))
        client.put("held", ["d"], [(50, 50)])
        seen.append((client.get_hull("held").info.revision, listed()))
        assert [each.key for each in client.list_held("held")] == ["d"]
        client.release("held", ["d"])
        seen.append((client.get_hull("held").info.revision, listed()))
        for revision, expected in reversed(seen):
            assert listed(at_revision=revision) == expected
        held, released = client.at("held", seen[1][0]), client.at("held", seen[2][0])
        assert [[each.key for each in past.list_held()] for past in (held, released)] == [["d"], []]
        points = [[tuple(part.keys) for part in past.read_points()] for past in (held, released)]
        assert points == [[("a", "b", "c")], [("a", "b", "c", "d")]]

    async def listed_then():
        async with AsyncHullClient(address) as client:
            past = await client.at("held", seen[1][0])
            return [each.key async for each in past.list_held()], [
                part.info.revision async for part in past.read_points()
            ]

    assert asyncio.run(listed_then()) == (["d"], [seen[1][0]])


def test_a_hull_that_is_made_again_has_nothing_of_the_one_before(served):
    address, _ = served
    with HullClient(address) as client:
        client.create_hull("again", keyed="str")
        client.put("again", ["old"], [(1, 1)])
        client.put("again", ["old"], [(2, 2)])
        before = client.at("again", 1)
        assert list(before.entities().keys) == ["old"]  # it is kept for further reads
        ended = before.time
        client.delete_hull("again")
        with pytest.raises(HullNotFoundError):
            before.entities()
        client.create_hull("again", keyed="str")
        client.put("again", ["new"], [(3, 3)])
        with pytest.raises(HullReplacedError):
            before.entities()
        assert list(client.at("again", 1).entities().keys) == ["new"]
        with pytest.raises(RevisionForgottenError, match="the newest 1"):
            client.at("again", 2)
        with pytest.raises(RevisionForgottenError, match="is before the oldest revision with a time, 0 of 20"):
            client.at("again", ended)


def test_the_asyncio_client_and_the_command_line_read_the_past(served):
    address, seen = served
    revision = sorted(seen["keyed"])[4]

    async def asked():
        async with AsyncHullClient(address) as client:
            past = await client.at("keyed", revision)
            return repr(await past.get_hull())

    assert asyncio.run(asked()) == seen["keyed"][revision][0][0]
    with HullClient(address) as client:
        area = client.at("keyed", revision).get_measures().area
    for when in (str(revision), seen["keyed"][revision][1].isoformat()):
        result = run("measure", "keyed", "--at", when, "--json", "--address", address)
        assert (json.loads(result.stdout)["area"], json.loads(result.stdout)["revision"]) == (area, revision)


NO_MOMENT = "must be a revision, all digits, or a time with a time zone, such as 2026-11-24T16:00Z"


def test_a_text_that_is_no_moment_is_refused_with_the_name_that_it_was_given_by(served):
    address, _ = served

    async def streamed(path):
        async with AsyncHullClient(address) as client:
            return await called(application(client, Settings()), path)

    for text in ("yesterday", "2026-11-24", "-1", ""):
        for command in (
            ("measure", "keyed", "--at"),
            ("track", "keyed", "a", "--from"),
            ("replay", "keyed", "--to"),
            ("fences", "between", "--area", "keyed", "--subjects", "keyed", "--from"),
        ):
            done = dynhull(*command, text, "--address", address)
            assert (done.exit_code, done.stderr) == (2, f"error: {command[-1]} is {text!r}: {NO_MOMENT}\n")
        for path, name in (("?at=", "at"), ("/tracks?key=a&to=", "to"), ("/replay?from=", "from")):
            status, body = asyncio.run(streamed(f"/hulls/keyed{path}{text}"))
            problem = json.loads(body)
            assert (status, problem["detail"]) == (400, f"{name}: {NO_MOMENT}")
            assert (problem["field"], problem["value"]) == (name, text)
    for text in (str(2**64), "9" * 5000):
        refused = "must be less than 2**64"
        done = dynhull("measure", "keyed", "--at", text, "--address", address)
        assert (done.exit_code, done.stderr) == (2, f"error: --at is {text[:60]!r}: {refused}\n")
        status, body = asyncio.run(streamed(f"/hulls/keyed?at={text}"))
        assert (status, json.loads(body)["detail"]) == (400, f"at: {refused}")


def test_faces_of_a_replay(served):
    address, seen = served
    last = max(seen["keyed"])
    first = sorted(seen["keyed"])[4]
    vertices = [hull.vertices.tolist() for revision, (_, _, hull) in sorted(seen["keyed"].items()) if revision >= first]

    async def played():
        async with AsyncHullClient(address) as client, client.replay("keyed", first, last) as events:
            return [event.revision async for event in events]

    async def streamed(path, **headers):
        async with AsyncHullClient(address) as client:
            return await called(application(client, Settings()), path, **headers)

    assert asyncio.run(played()) == list(range(first, last + 1))
    with HullClient(address) as client:
        expected = list(client.replay("keyed", first, last))
    shown = dynhull("replay", "keyed", "--from", first, "--to", last, "--json", "--keys", "--address", address)
    events = [json.loads(line) for line in shown.stdout.splitlines()]
    assert [event["revision"] for event in events] == list(range(first, last + 1))
    assert [event["changed"] for event in events] == [event.changed.isoformat() for event in expected]
    lines = dynhull("replay", "keyed", "--to", seen["keyed"][first][1].isoformat(), "--address", address).stdout
    assert [line.split("\t")[0] for line in lines.splitlines()] == list(map(str, range(first + 1)))
    assert lines.splitlines()[-1].split("\t")[1] == seen["keyed"][first][1].isoformat()

    path = f"/hulls/keyed/replay?from={first}&to={last}&f=vertices"
    status, body = asyncio.run(streamed(path))
    events = [dict(line.split(": ", 1) for line in each.splitlines()) for each in body.split("\n\n")[1:-1]]
    assert status == 200
    shapes = [json.loads(each["data"])["vertices"] for each in events if each["event"] == "snapshot"]
    assert shapes[0] == vertices[0]
    assert shapes[-1] == vertices[-1]
    assert json.loads(events[-1]["data"]) == {"revision": last}
    assert [each["event"] for each in events].count("end") == 1
    uid, over = events[-1]["id"].split(":")
    assert asyncio.run(streamed(path, last_event_id=f"{uid}:{over}")) == (204, "")
    status, body = asyncio.run(streamed(path, last_event_id=f"{uid}:{last - 1}"))
    assert next(line for line in body.splitlines() if line.startswith("id: ")) == f"id: {uid}:{last - 1}"
    assert asyncio.run(streamed(path, last_event_id=f"other:{last - 1}"))[0] == 409
    assert asyncio.run(streamed("/hulls/nobody/replay"))[0] == 404


def position_at(track, revision):
    """Where a key was at a revision, and how exactly, as its track has it."""
    row = int(np.searchsorted(track.revisions, revision, side="right")) - 1
    return [*track.points[row].tolist(), 0.0 if track.accuracies is None else float(track.accuracies[row])]


def positions_of(found):
    """The same of an answer."""
    accuracies = [0.0] * len(found.positions) if found.accuracies is None else found.accuracies
    return np.column_stack((found.positions, accuracies)).tolist()


@pytest.mark.parametrize("name", [name for name, settings in KINDS.items() if "keyed" in settings])
def test_a_track_is_where_a_key_was_at_each_revision(served, name):
    address, seen = served
    last = max(seen[name])
    with HullClient(address) as client:
        keys = list(map(plain, client.at(name, last).entities().keys))[:5]
        first = sorted(seen[name])[3]
        tracks = client.track(name, [*keys, *keys[:1]], first, last)
        assert list(tracks) == keys
        for revision in range(first, last + 1):
            found = positions_of(client.at(name, revision).positions(keys))
            for key, expected in zip(keys, found, strict=True):
                if tracks[key].revisions[0] <= revision:
                    assert repr(position_at(tracks[key], revision)) == repr(expected)
                else:
                    assert np.isnan(expected[:2]).all()
        begun = seen[name][first][1]
        for times, points in client.track(name, keys, begun, seen[name][last][1], every=1000).values():
            assert len(times) == len(points) <= 2
        whole = client.track(name, keys)
        assert [repr(position_at(whole[key], last)) for key in keys] == [
            repr(position_at(tracks[key], last)) for key in keys
        ]
        assert any(track.event_times is not None for track in whole.values()) == name.startswith("recent")
        assert any(track.accuracies is not None for track in whole.values()) == (name in INEXACT)


def test_faces_of_a_track(served):
    address, seen = served
    last = max(seen["keyed"])

    async def streamed(path, **headers):
        async with AsyncHullClient(address) as client:
            return await called(application(client, Settings()), path, **headers)

    async def tracked():
        async with AsyncHullClient(address) as client:
            return await client.track("keyed", ["k1", "k2", "nobody"], 0, last)

    tracks = asyncio.run(tracked())
    assert len(tracks["nobody"]) == 0
    options = "--from", 0, "--to", last, "--address", address
    lines = dynhull("track", "keyed", "k1", "k2", *options).stdout.splitlines()
    assert [line.split("\t")[0] for line in lines] == ["k1"] * len(tracks["k1"]) + ["k2"] * len(tracks["k2"])
    shown = [json.loads(line) for line in dynhull("track", "keyed", "k1", *options, "--json").stdout.splitlines()]
    assert [each["revision"] for each in shown] == tracks["k1"].revisions.tolist()
    times = [datetime.fromisoformat(each["time"]) for each in shown]
    assert [round(time.timestamp() * 1e6) for time in times] == tracks["k1"].times.tolist()
    heading, *rows = dynhull("track", "keyed", "k1", *options, "--csv").stdout.splitlines()
    assert (heading, len(rows)) == ("key,time,x,y,revision,event_time,accuracy", len(shown))
    accuracies = tracks["k1"].accuracies.tolist()
    assert [each.get("accuracy", 0) for each in shown] == [float(row.split(",")[-1] or 0) for row in rows] == accuracies
    (way,) = json.loads(dynhull("track", "keyed", "k1", *options, "--geojson").stdout)["features"]
    geometry = way["geometry"]
    lines = [geometry["coordinates"]] if geometry["type"] == "LineString" else geometry["coordinates"]
    assert sum(len(line) for line in lines) >= sum(each["position"] is not None for each in shown)
    said = way["properties"]["accuracies"]
    assert [*map(len, said if geometry["type"] == "MultiLineString" else [said])] == [*map(len, lines)]
    path = f"/hulls/keyed/tracks?key=k1&key=k2&from=0&to={last}"
    status, body = asyncio.run(streamed(path))
    (first, _) = json.loads(body)["tracks"]
    assert (status, first["revisions"]) == (200, tracks["k1"].revisions.tolist())
    assert first["accuracies"] == accuracies
    for asked in ({"accept": "application/geo+json"}, {}):
        found = asyncio.run(streamed(path + ("" if asked else "&f=geojson"), **asked))[1]
        assert json.loads(found)["features"][0] == way
    for wrong in ("k1", "9" * 5000):
        status, body = asyncio.run(streamed(f"/hulls/numbered/tracks?key={wrong}"))
        detail = f"key: {wrong[:60]!r} is not a key of 'numbered', which are integers"
        assert (status, json.loads(body)["detail"]) == (400, detail)
    assert json.loads(asyncio.run(streamed("/hulls/numbered/tracks?key=99"))[1])["tracks"][0]["key"] == 99
    assert asyncio.run(streamed("/hulls/plain/tracks?key=99"))[0] == 409
    assert dynhull("track", "plain", "a", "--csv", "--json", "--address", address).exit_code != 0


def test_the_past_needs_a_permission_of_its_own_and_has_limits(tmp_path):
    tokens = tmp_path / "tokens.toml"
    lines = [
        f'[[token]]\nsha256 = "{hashlib.sha256(name.encode()).hexdigest()}"\nread = [""]\nwrite = [""]\n{past}\n'
        for name, past in (("now", ""), ("then", 'past = ["a"]'))
    ]
    tokens.write_text("".join(lines))
    options = "--data", str(tmp_path / "data"), "--tokens", str(tokens), "--max-past-rows", "100", "--create-on-write"
    options += ("--max-replays-per-caller", "1")
    with server_process(*options, complaints=None) as server, HullClient(server.address, token="now") as client:
        for name in ("a", "b"):
            client.apply(name, insert=XY)
        client.apply("a", insert=np.random.default_rng(0).random((200, 2)))
        for name, token in (("a", "now"), ("b", "then")):
            with pytest.raises(PermissionDeniedError, match="read the past of"):
                client.with_token(token).at(name, 1)
            with pytest.raises(PermissionDeniedError, match="read the past of"):
                list(client.with_token(token).replay(name))
            with pytest.raises(PermissionDeniedError, match="read the past of"):
                client.with_token(token).track(name, ["k1"])
        assert client.with_token("then").at("a", 1).count(XY).counts.tolist() == [1] * len(XY)
        with pytest.raises(LimitExceededError, match="max_past_rows"):
            client.with_token("then").at("a", 2)
        then = client.with_token("then")
        with pytest.raises(LimitExceededError, match="max_past_rows"):
            list(then.replay("a", 1))
        with then.replay("a", 0, 1, speed=1e-6) as played:
            next(played)
            with pytest.raises(LimitExceededError, match="max_replays_per_caller"):
                list(then.replay("a", 0, 1))
            tokens.write_text(lines[0])
            with pytest.raises(UnauthenticatedError):
                next(played)


def test_a_server_in_memory_has_no_past(address, name):
    with HullClient(address) as client:
        client.create_hull(name, keyed="str")
        with pytest.raises(HullUnsuitableError, match="has no past"):
            client.at(name, 0)
        with pytest.raises(HullUnsuitableError, match="has no past"):
            next(client.fence_events_between(name, name))
