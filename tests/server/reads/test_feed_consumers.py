"""Consumers of feeds: readers whose place the server remembers, whatever happens between."""

import asyncio
import hashlib
import json
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice, pairwise

import numpy as np
import pytest
from command_line import dynhull
from gateway_process import Events, gateway_process
from mortal_server import MortalServer
from patience import wait_until
from server_process import run, server_process
from steady_writer import SteadyWriter

from dynhull_client import (
    AsyncHullClient,
    ConsumerNotFoundError,
    HullClient,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    InvalidRequestError,
    LimitExceededError,
    PermissionDeniedError,
    RevisionForgottenError,
)

PAST = 'past = [""]'


def token_file(path, **tokens):
    """A file of tokens that may read and write everything, and what else it says of each."""
    entries = [
        f'[[token]]\nsha256 = "{hashlib.sha256(name.encode()).hexdigest()}"\nread = [""]\nwrite = [""]\n{more}\n'
        for name, more in tokens.items()
    ]
    path.write_text("".join(entries))
    return path


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server that drops batches from its journal soon."""
    folder = tmp_path_factory.mktemp("consumers")
    tokens = token_file(folder / "tokens.toml", all=PAST, now="", some='past = ["mine/"]')
    options = "--data", str(folder / "data"), "--tokens", str(tokens), "--snapshot-points", "200"
    with server_process(*options, "--max-feed-consumers", "20", "--metrics-port", "0", complaints=None) as server:
        yield server


@pytest.fixture(scope="module")
def client(served):
    with HullClient(served.address, token="all") as client:
        yield client


@pytest.fixture
def fleet(client):
    """A hull with five batches. Consumers of all feeds are deleted at the end."""
    client.create_hull("mine/fleet", keyed="str")
    for number in range(5):
        client.put("mine/fleet", ["a"], [(number, 1)])
    yield "mine/fleet"
    client.delete_hull("mine/fleet")
    for each in client.list_feed_consumers():
        client.delete_feed_consumer(each.hull, prefix=each.prefix, consumer=each.name)


def taken(client, count, name=None, **options):
    """So many of the next of a feed."""
    with client.feed(name, **options) as feed:
        return list(islice(feed, count))


def revisions(batches):
    return [each.revision for each in batches]


def test_a_consumer_goes_on_after_what_it_has_acknowledged(client, fleet):
    seen = taken(client, 5, fleet, consumer="index")
    assert revisions(seen) == [1, 2, 3, 4, 5]
    assert revisions(taken(client, 2, fleet, consumer="index")) == [1, 2]
    now = client.ack_feed(fleet, consumer="index", after=3, uid=seen[0].uid)
    assert (now.name, now.hull, now.prefix, now.after, now.uid) == ("index", fleet, None, 3, seen[0].uid)
    assert (now.backlog, now.lost, now.replaced) == (2, 0, False)
    assert client.ack_feed(fleet, consumer="index", after=1) == now
    assert revisions(taken(client, 2, fleet, consumer="index")) == [4, 5]
    assert revisions(taken(client, 1, fleet, consumer="other")) == [1]
    client.ack_feed(fleet, consumer="late", after=5)
    client.put(fleet, ["b"], [(9, 9)])
    assert revisions(taken(client, 1, fleet, consumer="late")) == [6]
    assert list(client.list_feed_consumers("mine/")) == [
        client.ack_feed(fleet, consumer=name, after=0) for name in ("index", "late", "other")
    ]
    client.delete_feed_consumer(fleet, consumer="index")
    with pytest.raises(ConsumerNotFoundError, match="feed of 'mine/fleet' has no consumer 'index'"):
        client.delete_feed_consumer(fleet, consumer="index")
    assert revisions(taken(client, 1, fleet, consumer="index")) == [1]


def test_a_consumer_of_a_prefix_gets_hulls_that_come_later(client, fleet):
    seen = taken(client, 6, prefix="mine/", consumer="sink")
    assert [each.type for each in seen] == ["hulls", *["batch"] * 5]
    assert seen[0].hulls == {fleet: seen[1].uid}
    now = client.ack_feed(prefix="mine/", consumer="sink", after=seen[-1].after)
    assert (now.hull, now.prefix, now.after, now.backlog) == (None, "mine/", seen[-1].after, 0)
    client.create_hull("mine/later")
    client.apply("mine/later", insert=[(1, 1)])
    behind = list(client.list_feed_consumers())
    assert behind[0].backlog > 0
    hulls, batch = taken(client, 2, prefix="mine/", consumer="sink")
    assert (set(hulls.hulls), batch.hull, batch.revision) == ({fleet, "mine/later"}, "mine/later", 1)
    assert client.ack_feed(prefix="mine/", consumer="sink", after=0).after == seen[-1].after
    client.ack_feed(prefix="mine/", consumer="sink", after=batch.after)
    client.delete_hull("mine/later")
    (hulls,) = taken(client, 1, prefix="mine/", consumer="sink")
    assert set(hulls.hulls) == {fleet}


def test_a_hull_that_is_made_again_is_another_one(client, fleet):
    seen = taken(client, 5, fleet, consumer="index")
    client.ack_feed(fleet, consumer="index", after=5, uid=seen[0].uid)
    client.delete_hull(fleet)
    (found,) = client.list_feed_consumers()
    assert (found.replaced, found.backlog, found.after) == (True, 0, 5)
    for call in (
        lambda: taken(client, 1, fleet, consumer="index"),
        lambda: client.ack_feed(fleet, consumer="index", after=5),
    ):
        with pytest.raises(HullNotFoundError):
            call()
    client.create_hull(fleet, keyed="str")
    client.put(fleet, ["a"], [(0, 1)])
    uid = client.get_hull(fleet).info.uid
    with pytest.raises(HullReplacedError) as refused:
        taken(client, 1, fleet, consumer="index")
    assert (refused.value.field, refused.value.metadata["uid"]) == ("consumer", uid)
    with pytest.raises(HullReplacedError):  # a reader of the earlier one, which does not know
        client.ack_feed(fleet, consumer="index", after=1)
    with pytest.raises(HullReplacedError):
        client.ack_feed(fleet, consumer="index", after=1, uid=seen[0].uid)
    now = client.ack_feed(fleet, consumer="index", after=0, uid=uid)
    assert (now.after, now.uid, now.backlog, now.replaced) == (0, uid, 1, False)
    assert revisions(taken(client, 1, fleet, consumer="index")) == [1]


def test_what_is_kept_no_more_is_named_by_its_revisions(client, fleet):
    seen = taken(client, 2, fleet, consumer="slow")
    client.ack_feed(fleet, consumer="slow", after=2)
    keys, points = [f"k{i}" for i in range(150)], np.random.default_rng(1).random((150, 2))

    def dropped():
        client.put(fleet, keys, points)
        return client.history(fleet).first_revision > 2

    wait_until(dropped)
    (found,) = client.list_feed_consumers()
    lost, after = taken(client, 2, fleet, consumer="slow")
    assert (lost.type, lost.first, lost.uid) == ("lost", 3, seen[0].uid)
    assert lost.last >= found.lost + 2 > 2
    assert after.revision == lost.last + 1


def test_bad_input_changes_nothing(client, fleet):
    client.ack_feed(fleet, consumer="index", after=3)
    before = list(client.list_feed_consumers())
    position = taken(client, 5, prefix="mine/", after=0)[-1].after
    for error, given in (
        (RevisionForgottenError, {"name": fleet, "consumer": "index", "after": 99}),
        (RevisionForgottenError, {"prefix": "mine/", "consumer": "index", "after": position[:4] + b"\xff" * 16}),
        (InvalidRequestError, {"prefix": "mine/", "consumer": "index", "after": b"odd"}),
        (InvalidRequestError, {"name": fleet, "consumer": "no good", "after": 1}),
        (InvalidRequestError, {"name": fleet, "consumer": "", "after": 1}),
        (InvalidRequestError, {"name": fleet, "consumer": "x" * 201, "after": 1}),
        (InvalidRequestError, {"prefix": "no good", "consumer": "index", "after": 0}),
        (HullNotFoundError, {"name": "nobody", "consumer": "index", "after": 0}),
        (HullReplacedError, {"name": fleet, "consumer": "new", "after": 0, "uid": "other"}),
    ):
        with pytest.raises(error):
            client.ack_feed(**given)
    for given in ({"name": fleet, "prefix": "mine/"}, {}):
        with pytest.raises(ValueError, match="either name or prefix"):
            client.ack_feed(**given, consumer="index", after=0)
    with pytest.raises(ValueError, match="either consumer"):
        client.feed(fleet, consumer="index", after=3)
    assert list(client.list_feed_consumers()) == before


def test_there_is_a_limit_on_consumers_and_they_are_counted(client, fleet):
    for number in range(20):
        client.ack_feed(fleet, consumer=f"c{number}", after=number % 5)
    for call in (
        lambda: client.ack_feed(fleet, consumer="more", after=0),
        lambda: taken(client, 1, prefix="mine/", consumer="more"),
    ):
        with pytest.raises(LimitExceededError, match="max_feed_consumers is 20"):
            call()
    client.delete_feed_consumer(fleet, consumer="c19")
    client.ack_feed(fleet, consumer="more", after=0)
    pages = [each.name for each in client.list_feed_consumers()]
    assert pages == sorted([*(f"c{number}" for number in range(19)), "more"])


def test_consumers_need_the_right_to_read_the_past(client, fleet):
    client.create_hull("yours/fleet")
    client.ack_feed("yours/fleet", consumer="index", after=0)
    client.ack_feed(fleet, consumer="index", after=0)
    client.ack_feed(prefix="", consumer="index", after=0)
    now, some = client.with_token("now"), client.with_token("some")
    for given in ({"name": fleet}, {"prefix": "mine/"}):
        for call in (
            lambda given=given: now.ack_feed(**given, consumer="index", after=0),
            lambda given=given: now.delete_feed_consumer(**given, consumer="index"),
            lambda given=given: taken(now, 1, **given, consumer="index"),
        ):
            with pytest.raises(PermissionDeniedError, match="past of"):
                call()
    assert list(now.list_feed_consumers()) == []
    assert [each.hull for each in some.list_feed_consumers()] == [fleet]
    with pytest.raises(PermissionDeniedError):
        some.ack_feed(prefix="", consumer="index", after=0)
    client.delete_hull("yours/fleet")
    client.delete_feed_consumer("yours/fleet", consumer="index")


def test_the_asyncio_client_and_the_command_line_have_consumers(served, client, fleet):
    async def followed():
        async with AsyncHullClient(served.address, token="all") as reader:
            async with reader.feed(fleet, consumer="index") as feed:
                first = await anext(feed)
            await reader.ack_feed(fleet, consumer="index", after=first.after, uid=first.uid)
            return [each async for each in reader.list_feed_consumers()]

    assert [each.after for each in asyncio.run(followed())] == [1]
    options = "--address", served.address, "--token", "all"
    for expected in ([2, 3], [4, 5]):
        lines = run("feed", fleet, "--consumer", "index", "--ack", "--batches", 2, "--json", *options).stdout
        assert [json.loads(line)["revision"] for line in lines.splitlines()] == expected
    run("feed", "--prefix", "mine/", "--consumer", "sink", "--ack", "--batches", 6, *options)
    lines = run("feed", "consumers", "--json", *options).stdout.splitlines()
    sink, index = map(json.loads, lines)
    assert (index["hull"], index["name"], index["after"], index["backlog"]) == (fleet, "index", 5, 0)
    assert (sink["prefix"], sink["name"]) == ("mine/", "sink")
    assert bytes.fromhex(sink["after"])
    cells = [line.split("\t") for line in run("feed", "consumers", *options).stdout.splitlines()]
    assert cells[0][:2] == ["mine/*", "sink"]
    assert cells[1] == [fleet, "index", "5", "0"]
    assert run("feed", "forget", "index", fleet, *options).stdout == "index: deleted\n"
    assert [each.name for each in client.list_feed_consumers()] == ["sink"]
    assert run("feed", fleet, "--ack", *options).returncode == 2


def test_http_has_consumers(served, client, fleet):
    past = {"Authorization": "Bearer all"}
    of_hull, of_prefix = "/hulls/mine%2Ffleet/feed", "/feed"
    with gateway_process(served.address) as gateway:
        events = Events(gateway, f"{of_hull}?consumer=page", **past)
        first = json.loads(next(each for each in iter(events) if each.get("event") == "batch")["data"])
        events.close()
        done = {"revision": 2, "uid": first["uid"]}
        now = gateway.call("PUT", f"{of_hull}/consumers/page", done, **past).json
        assert (now["name"], now["after"], now["backlog"], now["replaced"]) == ("page", 2, 3, False)
        events = Events(gateway, f"{of_hull}?consumer=page", **past, Last_Event_ID=f"{first['uid']}:1")
        batch = next(each for each in iter(events) if each.get("event") == "batch")
        assert json.loads(batch["data"])["revision"] == 3
        events.close()
        events = Events(gateway, f"{of_prefix}?prefix=mine/&consumer=page", **past)
        sent = [each for each in islice(iter(events), 7) if each.get("event") == "batch"]
        events.close()
        done = {"position": sent[-1]["id"]}
        now = gateway.call("PUT", f"{of_prefix}/consumers/page?prefix=mine/", done, **past).json
        assert (now["prefix"], now["after"]) == ("mine/", sent[-1]["id"])
        first = gateway.get("/feed/consumers?limit=1", **past).json
        second = gateway.get(f"/feed/consumers?after={first['next']}", **past).json
        assert [each["prefix"] for each in (*first["consumers"], *second["consumers"])] == ["mine/", None]
        assert second["next"] is None
        uid = client.get_hull(fleet).info.uid
        assert gateway.get(f"/hulls/mine%2Ffleet?at=2&at_uid={uid}", **past).status == 200
        client.delete_hull(fleet)
        client.create_hull(fleet)
        client.apply(fleet, insert=[(7, 7)])
        assert gateway.get("/hulls/mine%2Ffleet?at=1", **past).status == 200
        replaced = gateway.get(f"/hulls/mine%2Ffleet?at=1&at_uid={uid}", **past).json
        assert (replaced["reason"], replaced["field"]) == ("HULL_REPLACED", "at_uid")
        assert gateway.get(f"/hulls/mine%2Ffleet?at_uid={uid}", **past).status == 400
        events = Events(gateway, f"{of_hull}?consumer=page", **past)
        kinds = [each.get("event") for each in islice(iter(events), 3)]
        assert kinds == ["replaced", None, "batch"]
        events.close()
        for target in (f"{of_hull}/consumers/page", f"{of_prefix}/consumers/page?prefix=mine/"):
            assert gateway.call("DELETE", target, **past).status == 204
            assert gateway.call("DELETE", target, **past).json["reason"] == "CONSUMER_NOT_FOUND"


def test_a_server_in_memory_has_no_consumers(address, name):
    with HullClient(address) as client:
        client.create_hull(name)
        with pytest.raises(HullUnsuitableError, match="keeps no batches"):
            client.ack_feed(name, consumer="index", after=0)
        with pytest.raises(HullUnsuitableError, match="keeps no batches"):
            client.ack_feed(prefix=name, consumer="index", after=0)


def test_nothing_is_missing_after_kills_between_what_is_done_and_what_is_acknowledged(tmp_path):
    """A reader stores what it is sent, and then acknowledges; the server is killed again and again beside it."""
    server = MortalServer(tmp_path)
    with HullClient(server.address) as client:
        client.create_hull("fleet/a")
    enough = threading.Event()
    stored: dict[str, list[int]] = {"name": [], "prefix": []}

    def read(kind, of):
        while not enough.is_set():
            with HullClient(server.address, retries=1000) as client, client.feed(**{kind: of}, consumer="x") as feed:
                for number, batch in enumerate(feed):
                    if batch.type == "batch":
                        stored[kind].append(batch.revision)
                    if batch.after is None:  # more was sent with it, which has no place of its own
                        continue
                    done = client.ack_feed(**{kind: of}, consumer="x", after=batch.after)
                    assert batch.type == "hulls" or done.after == batch.after
                    if number >= 20:
                        break

    writer = SteadyWriter(server.address, "fleet/a")
    writer.start()
    with ThreadPoolExecutor(2) as pool:
        reading = [pool.submit(read, "name", "fleet/a"), pool.submit(read, "prefix", "fleet/")]
        for number in range(3):
            wait_until(lambda n=30 * number: any(map(Future.done, reading)) or n < min(map(len, stored.values())))
            server.kill()
            server.start()
        enough.set()
        for each in reading:
            each.result()
    writer.stop()
    for kept in stored.values():
        assert list(dict.fromkeys(kept)) == list(range(1, max(kept) + 1))
        assert sum(each <= before for before, each in pairwise(kept)) <= 3
    server.kill()


def test_a_restored_server_has_other_hulls_and_says_so(tmp_path):
    data, backup = tmp_path / "data", tmp_path / "backup"
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("fleet/a", keyed="str")
        for number in range(3):
            client.put("fleet/a", ["k"], [(number, 1)])
        position = taken(client, 3, prefix="fleet/", after=0)[-1].after
        client.ack_feed("fleet/a", consumer="index", after=3)
        client.ack_feed(prefix="fleet/", consumer="index", after=position)
        dynhull("backup", "--data", data, backup)
        client.put("fleet/a", ["k"], [(9, 9)])
        client.ack_feed("fleet/a", consumer="index", after=4)
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        assert [each.after for each in client.list_feed_consumers()] == [position, 4]
        assert not any(each.replaced for each in client.list_feed_consumers())
    dynhull("restore", backup, "--data", tmp_path / "restored")
    with server_process("--data", str(tmp_path / "restored")) as server, HullClient(server.address) as client:
        found = list(client.list_feed_consumers())
        assert [(each.after, each.replaced) for each in found] == [(position, True), (3, True)]
        with pytest.raises(HullReplacedError):
            taken(client, 1, "fleet/a", consumer="index")
        with pytest.raises(RevisionForgottenError, match="a backup was restored"):
            taken(client, 1, prefix="fleet/", consumer="index")
        uid = client.get_hull("fleet/a").info.uid
        assert client.ack_feed("fleet/a", consumer="index", after=3, uid=uid).after == 3
        assert client.ack_feed(prefix="fleet/", consumer="index", after=0).replaced is False
        assert len(taken(client, 4, prefix="fleet/", consumer="index")) == 4
