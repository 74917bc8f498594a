"""The feed of a hull: every batch, each once and in order, whatever happens between."""

import asyncio
import hashlib
import json
import threading
from datetime import UTC, datetime, timedelta
from itertools import islice

import numpy as np
import pytest
from gateway_process import Events, gateway_process
from patience import wait_until
from proxy import proxy
from server_process import run, server_process

from dynhull_client import (
    AsyncHullClient,
    Batch,
    HullClient,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    InvalidRequestError,
    LimitExceededError,
    PermissionDeniedError,
    Quarantine,
    RevisionForgottenError,
    UnavailableError,
)

KINDS = {
    "plain": {},
    "keyed": {"keyed": "str"},
    "numbered": {"keyed": "int"},
    "globe": {"geographic": True, "keyed": "str"},
    "quarantine": {"keyed": "str", "quarantine": Quarantine(max_growth=1.5, confirmations=0)},
    "recent": {"max_age": 20.0, "clock": "data"},
    "recent-keyed": {"max_age": 20.0, "clock": "data", "keyed": "str"},
}
START = datetime(2026, 1, 1, tzinfo=UTC)
PAST = 'past = [""]'


def token_file(path, **tokens):
    """A file of tokens that may read and write everything, and what else it says of each."""
    path.write_text(
        "".join(
            f'[[token]]\nsha256 = "{hashlib.sha256(name.encode()).hexdigest()}"\nread = [""]\nwrite = [""]\n{more}\n'
            for name, more in tokens.items()
        )
    )
    return path


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server that drops batches from its journal soon, and the file of its tokens."""
    folder = tmp_path_factory.mktemp("feed")
    tokens = token_file(folder / "tokens.toml", all=PAST, now="", brief=PAST)
    options = "--data", str(folder / "data"), "--tokens", str(tokens), "--snapshot-points", "200"
    with server_process(*options, "--max-feeds-per-caller", "3", complaints=None) as server:
        yield server, tokens


@pytest.fixture(scope="module")
def client(served):
    server, _ = served
    with HullClient(server.address, token="all") as client:
        yield client


def write(client, name, rng, second):
    """One random batch."""
    n = int(rng.integers(1, 6))
    xy = np.round(rng.normal(size=(n, 2)) * (1 + 3 * (rng.random() < 0.2)), 3)
    times = [START + timedelta(seconds=5 * second)] * n if name.startswith("recent") else None
    settings = KINDS[name]
    if "keyed" in settings:
        keys = rng.permutation(12)[:n].tolist()
        keys = [f"k{key}" for key in keys] if settings["keyed"] == "str" else keys
        ttl = 30 if name == "recent-keyed" and second % 3 == 0 else None
        client.put(name, keys, xy, times, only="absent" if second % 4 == 3 else None, ttl=ttl)
        if rng.random() < 0.3:
            client.remove(name, keys[:1], missing="count")
    else:
        client.apply(name, insert=xy, times=times)
        if times is None and rng.random() < 0.5:
            client.apply(name, delete=xy[:1])


class Copy:
    """The points of a hull, of its batches alone."""

    def __init__(self):
        self.points, self.rows, self.held = {}, [], {}

    def take(self, batch):
        assert batch.type == "batch"
        if batch.expired:
            self._expire(batch)
        for key in batch.removed:
            self.points.pop(key, None)
        times = [None] * len(batch.keys) if batch.expire_times is None else batch.expire_times.tolist()
        stamps = [None] * len(batch.points) if batch.times is None else batch.times.tolist()[: len(batch.points)]
        for key, point, time, stamp in zip(batch.keys, batch.points.tolist(), times, stamps, strict=True):
            if batch.only is None or (key in self.points) == (batch.only == "present"):
                self.points[key] = tuple(point), stamp, time
        stamps = [None] * len(batch.inserts) if batch.times is None else batch.times.tolist()
        self.rows += zip(map(tuple, batch.inserts.tolist()), stamps, strict=False)
        for point in map(tuple, batch.deletes.tolist()):
            self.rows.remove((point, None))
        if batch.held is not None:
            for key in batch.held.dropped:
                self.held.pop(key, None)
            self.held.update(zip(batch.held.keys, map(tuple, batch.held.points.tolist()), strict=True))

    def _expire(self, batch):
        until = None if batch.expired_until is None else batch.expired_until.replace(tzinfo=None)
        clock = batch.clock.replace(tzinfo=None)
        before = len(self.points) + len(self.rows)
        self.points = {
            key: (point, stamp, ends)
            for key, (point, stamp, ends) in self.points.items()
            if not (ends is not None and ends <= clock) and (until is None or stamp > until)
        }
        self.rows = [(point, stamp) for point, stamp in self.rows if until is None or stamp > until]
        assert before - len(self.points) - len(self.rows) == batch.expired


@pytest.mark.parametrize("kind", KINDS)
def test_a_copy_of_the_batches_alone_is_the_hull(client, kind):
    client.create_hull(kind, **KINDS[kind])
    rng = np.random.default_rng(11)
    for second in range(16):
        write(client, kind, rng, second)
    info = client.get_hull(kind).info
    copy, seen = Copy(), []
    with client.feed(kind, after=0) as feed:
        for batch in feed:
            copy.take(batch)
            seen.append(batch)
            if batch.revision == info.revision:
                break
    assert [each.revision for each in seen] == list(range(1, info.revision + 1))
    assert {(each.hull, each.uid) for each in seen} == {(kind, info.uid)}
    assert [each.commit for each in seen] == sorted(each.commit for each in seen)
    assert [client.at(kind, each.revision).time for each in seen[:3]] == [each.time for each in seen[:3]]
    if "keyed" in KINDS[kind]:
        stored = client.entities(kind)
        assert {key: point for key, (point, _, _) in copy.points.items()} == dict(
            zip(stored.keys, map(tuple, stored.points.tolist()), strict=True)
        )
        assert {each.key: each.position for each in client.list_held(kind)} == copy.held
    else:
        parts = list(client.read_points(kind))
        points = [tuple(point) for part in parts for point in part.points.tolist()]
        assert sorted(points) == sorted(point for point, _ in copy.rows)
    causes = {each.cause for each in seen}
    assert causes == ({"batch", "expiry"} if kind.startswith("recent") else {"batch"})


def test_lost_connections_lose_and_repeat_nothing(served, client):
    server, _ = served
    client.create_hull("cut", keyed="int")
    done = threading.Event()

    def writes():
        for number in range(60):
            client.put("cut", [number], [(number, 1)])
        done.set()

    with proxy(server.address) as between, HullClient(between.address, token="all") as reader:
        writer = threading.Thread(target=writes)
        writer.start()
        with reader.feed("cut", after=0) as feed:
            seen = []
            for batch in feed:
                seen.append(batch)
                if batch.revision % 20 == 0:
                    between.cut()
                if len(seen) == 60:
                    break
        writer.join()
    assert done.is_set()
    assert [(each.revision, each.keys) for each in seen] == [(n + 1, (n,)) for n in range(60)]


def test_it_goes_on_after_the_server_is_killed(tmp_path):
    options = "--data", str(tmp_path / "data")
    seen = []
    with server_process(*options, killed=True) as server:
        between = proxy(server.address)
        with between as through, HullClient(through.address) as reader:
            with HullClient(server.address) as client:
                client.create_hull("fleet", keyed="str")
                for number in range(5):
                    client.put("fleet", [f"k{number}"], [(number, 1)])
                feed = reader.feed("fleet", after=1)
                seen += [next(feed) for _ in range(2)]
                many = reader.feed(prefix="", after=0)
                assert [next(many).revision for _ in range(2)] == [1, 2]
                server.process.kill()
                server.process.wait()
            with server_process(*options, torn=True) as again, HullClient(again.address) as client:
                through.server = again.address
                through.cut()
                client.put("fleet", ["k5"], [(5, 1)])
                seen += [next(feed) for _ in range(3)]
                feed.close()
                batches = (each for each in many if each.type == "batch")
                assert [next(batches).revision for _ in range(4)] == [3, 4, 5, 6]
                many.close()
    assert [(each.revision, each.keys) for each in seen] == [(n + 1, (f"k{n}",)) for n in range(1, 6)]


def test_what_is_kept_no_more_is_named_and_the_rest_follows(client):
    """Beside it one with a history: its batches come from segments, the journal, and as they are made."""
    keys = [f"k{i}" for i in range(100)]
    client.create_hull("short", keyed="str")
    client.create_hull("long", keyed="str", history=True)
    feed = client.feed("long", after=0, progress_interval=0.1)
    early = next(feed)
    assert (early.type, early.revision) == ("progress", 0)

    def dropped():
        for name in ("short", "long"):
            client.put(name, keys, np.random.default_rng(1).random((100, 2)))
        return client.history("short").first_revision > 0 and client.history("long").batches > 2

    wait_until(dropped)
    oldest, newest = client.history("short").first_revision, client.history("short").last_revision
    with client.feed("short", after=0) as short:
        lost = next(short)
        oldest = lost.revision
        assert (lost.type, lost.first, lost.last, lost.hull) == ("lost", 1, oldest, "short")
        (gap,) = [each for each in [next(client.feed(prefix="short", after=0))] if each.type == "lost"]
        assert (gap.hull, gap.uid, gap.first, gap.last) == ("short", lost.uid, 1, oldest)
        assert [next(short).revision for _ in range(newest - oldest)] == list(range(oldest + 1, newest + 1))
    with feed:
        batches = (each for each in feed if each.type != "progress")
        seen = [next(batches) for _ in range(newest)]
        client.put("long", keys[:1], [(0.5, 0.5)])
        seen.append(next(batches))
    assert [(each.type, each.revision) for each in seen] == [("batch", n) for n in range(1, newest + 2)]
    assert seen[0].keys == tuple(keys)
    assert seen[-1].keys == ("k0",)


def following(client, count, **options):
    """So many batches of a feed."""
    with client.feed(**options) as feed:
        return list(islice((each for each in feed if each.type == "batch"), count))


def test_a_prefix_has_all_batches_in_the_order_of_their_commits(client):
    names = [f"many/{letter}" for letter in "abc"]
    for name in (*names, "other"):
        client.create_hull(name, keyed="str")
    for number in range(12):
        client.put(names[number % 3], [f"k{number}"], [(number, 1)])
        client.put("other", ["x"], [(number, 1)])
    client.transfer({names[0]: Batch(remove=["k0"]), names[1]: Batch(keys=["k0"], points=[(0, 1)])})
    client.put(names[2], ["last"], [(9, 9)])
    seen = following(client, 15, prefix="many/", after=0)
    assert [each.commit for each in seen] == sorted(each.commit for each in seen)
    assert [each.keys[0] for each in seen[:12]] == [f"k{number}" for number in range(12)]
    for name in names:
        assert [each.revision for each in seen if each.hull == name] == [1, 2, 3, 4, 5]
    assert {each.uid for each in seen} == {client.get_hull(name).info.uid for name in names}
    assert seen[12].commit == seen[13].commit
    assert [each.more for each in seen] == [row == 12 for row in range(15)]
    assert seen[13].keys == ("k0",)
    live = [("many/new", ["n"]), (names[0], ["live"])]
    feed = client.feed(prefix="many/", after=seen[-1].after)
    hulls = next(feed)
    assert (hulls.type, set(hulls.hulls)) == ("hulls", set(names))
    places = [hulls.after]
    for name, keys in live:
        client.create_hull(name, keyed="str", exist_ok=True)
        client.put(name, keys, [(5, 5)])
        batch = next(feed)
        seen.append(batch)
        places.append(batch.after)
        assert (batch.hull, batch.keys) == (name, tuple(keys))
    for row, place in enumerate(places[:-1]):
        again = following(client, 1, prefix="many/", after=place)[0]
        assert (again.hull, again.revision, again.uid) == (
            seen[15 + row].hull,
            seen[15 + row].revision,
            seen[15 + row].uid,
        )
    client.delete_hull("many/new")
    gone = next(feed)
    assert (gone.type, gone.hull, gone.uid) == ("deleted", "many/new", seen[15].uid)
    client.create_hull("many/new", keyed="str")
    client.put("many/new", ["again"], [(5, 5)])
    again = next(feed)
    assert (again.hull, again.revision, again.keys) == ("many/new", 1, ("again",))
    assert again.uid != gone.uid
    feed.close()


def test_a_prefix_loses_and_repeats_nothing_over_lost_connections(served, client):
    """Each batch once and in order, for a reader that keeps what it has up to a position."""
    server, _ = served
    names = [f"cuts/{letter}" for letter in "abcd"]
    for name in names:
        client.create_hull(name, keyed="int")

    def writes(name):
        for number in range(25):
            client.put(name, [number], [(number, 1)])

    with proxy(server.address) as between, HullClient(between.address, token="all") as reader:
        writers = [threading.Thread(target=writes, args=(name,)) for name in names]
        for each in writers:
            each.start()
        kept, after, received = [], 0, 0
        while len(kept) < 100:
            since = []  # what has no position is received again
            with reader.feed(prefix="cuts/", after=after) as feed:
                for batch in (each for each in feed if each.type == "batch"):
                    since.append(batch)
                    received += 1
                    if received % 7 == 0:
                        between.cut()
                    if batch.after is not None:
                        kept, since, after = kept + since, [], batch.after
                        if len(kept) == 100 or len(kept) % 3 == 0:
                            break
        for each in writers:
            each.join()
    for name in names:
        assert [each.keys[0] for each in kept if each.hull == name] == list(range(25))
    assert [each.commit for each in kept] == sorted(each.commit for each in kept)


def test_a_position_is_of_the_data_that_it_was_given_for(client):
    for position, error in ((b"odd", InvalidRequestError), (b"\1" * 20, RevisionForgottenError)):
        with pytest.raises(error), client.feed(prefix="many/", after=position) as feed:
            next(feed)
    with pytest.raises(ValueError, match="either name or prefix"):
        client.feed("a", prefix="b")
    with pytest.raises(ValueError, match="the attribute `after`"):
        client.feed(prefix="b", after=7)


def test_another_hull_of_the_name_is_another_feed(client):
    client.create_hull("again")
    client.apply("again", insert=[(0, 0)])
    feed = client.feed("again", after=0)
    first = next(feed)
    client.delete_hull("again")
    with pytest.raises(HullNotFoundError):
        next(feed)
    client.create_hull("again")
    client.apply("again", insert=[(1, 1)])
    with pytest.raises(HullReplacedError), client.feed("again", after=first.after, uid=first.uid) as feed:
        next(feed)
    with (
        pytest.raises(RevisionForgottenError, match="the newest 1"),
        client.feed("again", after=7) as feed,
    ):
        next(feed)
    with client.feed("again", after=0) as feed:
        assert next(feed).inserts.tolist() == [[1, 1]]


def test_it_needs_the_right_to_the_past_for_as_long_as_it_lasts(served, client):
    _, tokens = served
    client.create_hull("guarded")
    client.apply("guarded", insert=[(0, 0)])
    for token in ("now", "nobody"):
        with (
            pytest.raises(PermissionDeniedError if token == "now" else Exception),
            client.with_token(token).feed("guarded") as feed,
        ):
            next(feed)
    feed = client.with_token("brief").feed("guarded", after=0)
    assert next(feed).revision == 1
    token_file(tokens, all=PAST, now="", brief="")
    with pytest.raises(PermissionDeniedError, match="read the past of"):
        next(feed)


def test_there_is_a_limit_on_feeds_for_each_caller(client):
    client.create_hull("limited")
    client.apply("limited", insert=[(0, 0)])
    feeds = [client.feed("limited", after=0) for _ in range(3)]
    for feed in feeds:
        next(feed)
    with pytest.raises(LimitExceededError, match="max_feeds_per_caller is 3"), client.feed("limited") as feed:
        next(feed)
    for feed in feeds:
        feed.close()


def test_the_asyncio_client_and_the_command_line_follow_batches(served, client):
    server, _ = served
    client.create_hull("faces", keyed="str")
    client.put("faces", ["a", "b"], [(0, 0), (1, 2)], ttl=3600)
    client.remove("faces", ["a"])

    async def followed():
        async with AsyncHullClient(server.address, token="all") as client, client.feed("faces", after=0) as feed:
            return [await anext(feed) for _ in range(2)]

    first, second = asyncio.run(followed())
    assert (first.keys, second.removed) == (("a", "b"), ("a",))
    options = "--after", "0", "--batches", "2", "--address", server.address, "--token", "all"
    lines = [json.loads(line) for line in run("feed", "faces", "--json", *options).stdout.splitlines()]
    assert [line["revision"] for line in lines] == [1, 2]
    assert (lines[0]["keys"], lines[0]["points"], lines[1]["removed"]) == (["a", "b"], [[0, 0], [1, 2]], ["a"])
    assert datetime.fromisoformat(lines[0]["expire_times"][0]) - first.time > timedelta(minutes=59)
    lines = run("feed", "--prefix", "faces", "--json", *options).stdout.splitlines()
    assert [json.loads(line)["revision"] for line in lines] == [1, 2]
    place = json.loads(lines[1])["after"]
    client.put("faces", ["c"], [(5, 5)])
    more = run("feed", "--prefix", "faces", "--json", *options[2:], "--after", place).stdout.splitlines()
    assert [json.loads(line)["type"] for line in more] == ["hulls", "batch"]
    cells = run("feed", "faces", *options).stdout.splitlines()[0].split("\t")
    assert cells == ["faces", "1", first.time.isoformat(timespec="milliseconds"), "batch", "2", "0"]


def test_http_sends_batches_as_events_and_resumes(served, client):
    server, _ = served
    client.create_hull("http", keyed="str")
    for number in range(3):
        client.put("http", ["a"], [(number, 1)])
    past, bearer = {"Authorization": "Bearer all"}, {"Authorization": "Bearer now"}
    with gateway_process(server.address) as gateway:
        assert gateway.get("/hulls/http/feed", **bearer).status == 403
        assert gateway.get("/hulls/nobody/feed", **past).status == 404
        assert gateway.get("/hulls/http/feed?after=9", **past).json["reason"] == "REVISION_FORGOTTEN"
        events = Events(gateway, "/hulls/http/feed?after=1", **past)
        sent = [each for each in (next(iter(events)) for _ in range(3)) if "event" in each]
        events.close()
        assert [each["event"] for each in sent] == ["batch", "batch"]
        data = json.loads(sent[0]["data"])
        assert (data["revision"], data["keys"], data["points"]) == (2, ["a"], [[1, 1]])
        assert sent[0]["id"] == f"{data['uid']}:2"
        client.put("http", ["b"], [(3, 1)])
        events = Events(gateway, "/hulls/http/feed", **past, Last_Event_ID=sent[1]["id"])
        sent = [next(iter(events)) for _ in range(2)]
        assert json.loads(sent[-1]["data"])["keys"] == ["b"]
        client.delete_hull("http")
        client.create_hull("http")
        client.apply("http", insert=[(7, 7)])
        events.close()
        events = Events(gateway, "/hulls/http/feed", **past, Last_Event_ID=sent[1]["id"])
        kinds = [next(iter(events)) for _ in range(3)]
        assert [each.get("event") for each in kinds] == ["replaced", None, "batch"]
        assert json.loads(kinds[2]["data"])["inserts"] == [[7, 7]]
        events.close()
        assert gateway.get("/feed?prefix=http", **bearer).status == 403
        events = Events(gateway, "/feed?prefix=http&begin=true", **past)
        sent = [next(iter(events)) for _ in range(2)]
        assert (json.loads(sent[1]["data"])["hull"], sent[1]["event"]) == ("http", "batch")
        events.close()
        client.apply("http", insert=[(8, 8)])
        events = Events(gateway, "/feed?prefix=http", **past, Last_Event_ID=sent[1]["id"])
        kinds = [next(iter(events)) for _ in range(2)]
        assert [each.get("event") for each in kinds] == ["hulls", "batch"]
        assert list(json.loads(kinds[0]["data"])["hulls"]) == ["http"]
        assert json.loads(kinds[1]["data"])["revision"] == 2
        events.close()


def test_a_server_in_memory_has_no_feed(address, name):
    with HullClient(address) as client:
        client.create_hull(name)
        for options in ({"name": name}, {"prefix": name}):
            with pytest.raises(HullUnsuitableError, match="keeps no batches"), client.feed(**options) as feed:
                next(feed)


def test_without_reconnecting_it_ends(served, client):
    server, _ = served
    client.create_hull("once")
    client.apply("once", insert=[(0, 0)])
    with proxy(server.address) as between, HullClient(between.address, token="all") as reader:
        feed = reader.feed("once", after=0, reconnect=False)
        next(feed)
        between.cut()
        with pytest.raises(UnavailableError):
            next(feed)
