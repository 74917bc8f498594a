"""Streams of events joined to one: each is as if it were alone, also over kills of the server and the gateway."""

import json
from collections import defaultdict
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from cases import slow
from gateway_process import Answer, Events, Gateway, gateway_process
from metrics import scrape
from mortal_server import MortalServer
from patience import wait_until
from ports import free_port
from server_process import server_process

from dynhull_client import HullClient

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
AROUND = {"exterior": [[-1, -1], [5, -1], [5, 5], [-1, 5]]}


class Joined:
    """A reader of several streams in one, who opens another one with the last ids when it is lost.

    Attributes:
        events: the events of each subscription, by its name: the kind, the id and the data.
    """

    def __init__(self, gateway: Gateway, **headers: str) -> None:
        self.events: dict[str, list[tuple[str, str, Any]]] = defaultdict(list)
        self.stream = ""
        self._gateway = gateway
        self._headers = headers
        self._wanted: dict[str, dict[str, str]] = {}
        self._stream: Events | None = None

    def open(self, gateway: Gateway | None = None, **paths: str) -> None:
        """Follow these paths, and those from before."""
        self._gateway = gateway or self._gateway
        self._wanted |= {name: {"path": path} for name, path in paths.items()}
        self.close()
        self._stream = Events(self._gateway, "/streams", {"subscriptions": self._wanted}, **self._headers)
        assert self._stream.response.status == 200, self._stream.response.read()
        kind, data = self._stream.next()
        assert kind == "stream"
        self.stream = data["stream"]

    def add(self, name: str, path: str, **body: str) -> Answer:
        self._wanted[name] = {"path": path, **body}
        return self._gateway.call("PUT", f"/streams/{self.stream}/subscriptions/{name}", self._wanted[name])

    def remove(self, name: str) -> Answer:
        del self._wanted[name]
        return self._gateway.call("DELETE", f"/streams/{self.stream}/subscriptions/{name}")

    def read(self) -> bool:
        """Take the next event; False when the stream is lost."""
        assert self._stream is not None
        event = next(iter(self._stream), None)
        if event is None:
            return False
        name, _, place = event.get("id", "").partition(" ")
        if place:
            self._wanted[name]["last_event_id"] = place
        if "data" in event:
            self.events[name].append((event["event"], place, json.loads(event["data"])))
        return True

    def next(self, name: str) -> tuple[str, Any]:
        """The next event of a subscription, which is forgotten."""
        while not self.events[name]:
            assert self.read(), "the stream is lost"
        kind, _, data = self.events[name].pop(0)
        return kind, data

    def close(self) -> None:
        if self._stream is not None:
            self._stream.close()


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gateway]:
    """A gateway of a server that can keep a past."""
    with (
        server_process("--data", str(tmp_path_factory.mktemp("joined"))) as server,
        gateway_process(server.address) as running,
    ):
        yield running


@pytest.fixture
def joined(gateway: Gateway) -> Iterator[Joined]:
    reader = Joined(gateway)
    yield reader
    reader.close()


def prepared(gateway: Gateway, name: str) -> str:
    """A hull, a fence and an alarm of the name, which is returned as paths have it."""
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    gateway.post("/fences", {"name": name, "area": AROUND, "subjects": name, "initial": "none"})
    gateway.post("/alarms", {"name": name, "hull": name, "when": "area > 9"})
    return quote(name, safe="")


def put(gateway: Gateway, name: str, size: float) -> None:
    keys = {"keys": list("abcd"), "points": [[0, 0], [size, 0], [size, size], [0, size]]}
    assert gateway.post(f"/hulls/{quote(name, safe='')}/points", keys).status == 200


def test_each_stream_is_as_if_it_were_alone(gateway: Gateway, joined: Joined, name: str) -> None:
    path = prepared(gateway, name)
    paths = {
        "hull": f"/hulls/{path}/events?rate=100&keys=true",
        "fence": f"/fences/{path}/events?after=0",
        "alarm": f"/alarms/{path}/events?after=0",
        "many": f"/events?prefix={path}",
        "feed": f"/hulls/{path}/feed?after=0",
        "past": f"/hulls/{path}/replay",
    }
    put(gateway, name, 4)
    joined.open(**paths)
    alone = {each: Events(gateway, of) for each, of in paths.items()}
    for each, count in {"hull": 1, "fence": 4, "alarm": 1, "many": 3, "feed": 1, "past": 3}.items():
        for _ in range(count):
            told = joined.next(each)
            while (expected := alone[each].next())[1] is None:
                continue
            assert told == expected, each
    assert joined.next("past") == ("over", {})
    put(gateway, name, 9)
    for each in ("hull", "fence", "many", "feed"):
        assert joined.next(each) == alone[each].next(), each
    for events in alone.values():
        events.close()


def test_what_is_followed_changes_while_it_runs(gateway: Gateway, joined: Joined, name: str) -> None:
    path = prepared(gateway, name)
    joined.open()
    watched = f"/hulls/{path}/events?rate=100"
    assert joined.add("hull", watched).status == 204
    assert joined.next("hull")[0] == "snapshot"
    assert joined.add("hull", watched).status == 204, "the same again"
    other = joined.add("hull", f"/fences/{path}/events")
    assert (other.status, other.json["reason"], other.json["field"]) == (409, "SUBSCRIPTION_EXISTS", "subscription")
    assert joined.add("fence", f"/fences/{path}/events?after=0").status == 204
    assert joined.remove("hull").status == 204
    put(gateway, name, 4)
    assert [joined.next("fence")[0] for _ in range(4)] == ["enter"] * 4
    assert joined.events["hull"] == []
    assert joined.add("again", watched, last_event_id="other:0").status == 204
    assert joined.next("again")[1]["revision"] == 1
    gateway.call("DELETE", f"/fences/{path}")
    assert joined.next("fence")[0] == "closed"
    assert joined.next("fence") == ("over", {})


def test_one_that_is_refused_leaves_the_others(gateway: Gateway, joined: Joined, name: str) -> None:
    path = prepared(gateway, name)
    refused = {
        "absent": (f"/hulls/{path}-no/events", "HULL_NOT_FOUND"),
        "misspelled": (f"/hulls/{path}/events?kyes=true", "INVALID_FIELD"),
        "ahead": (f"/fences/{path}/events?after=99", "SEQUENCE_AHEAD"),
    }
    joined.open(hull=f"/hulls/{path}/events", **{each: of for each, (of, _) in refused.items()})
    for each, (_, reason) in refused.items():
        kind, problem = joined.next(each)
        assert (kind, problem["reason"]) == ("problem", reason)
    assert joined.next("hull")[0] == "snapshot"
    assert joined.add("later", refused["absent"][0]).status == 204
    assert joined.next("later")[1]["status"] == 404


@pytest.mark.parametrize(
    ("subscriptions", "field"),
    [
        ({"a": {"path": "/hulls"}}, "/subscriptions/a/path"),
        ({"a": {"path": "/hulls/x/events", "last_event_id": "a\nb"}}, "/subscriptions/a/last_event_id"),
        ({"a": {"path": "hulls/x/events"}}, "/subscriptions/a/path"),
        ({"a": {"path": "/streams"}}, "/subscriptions/a/path"),
        ({"a b": {"path": "/hulls/x/events"}}, "/subscriptions/a b"),
        ({"a": {"path": "/hulls/x/events", "after": 1}}, "/subscriptions/a/after"),
    ],
)
def test_refused(gateway: Gateway, subscriptions: Any, field: str) -> None:
    answer = gateway.post("/streams", {"subscriptions": subscriptions})
    assert answer.status == 400
    assert answer.json["errors"][0]["pointer"] == field


def test_only_its_caller_changes_a_stream(gateway: Gateway, joined: Joined) -> None:
    joined.open()
    for method, body in (("PUT", {"path": "/events"}), ("DELETE", None)):
        for stream, headers in ((joined.stream, {"Authorization": "Bearer other"}), ("none", {})):
            answer = gateway.call(method, f"/streams/{stream}/subscriptions/a", body, **headers)
            assert (answer.status, answer.json["reason"]) == (404, "STREAM_NOT_FOUND")


def test_rights_are_those_of_the_token(tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"
    digests = [sha256(each).hexdigest() for each in (b"secret", b"other")]
    tokens.write_text("".join(f'[[token]]\nsha256 = "{each}"\nread = ["a"]\nwrite = ["a"]\n' for each in digests))
    secret = {"Authorization": "Bearer secret"}
    with (
        server_process("--tokens", str(tokens), "--log-level", "error") as server,
        gateway_process(server.address) as gateway,
    ):
        assert gateway.post("/hulls", {"name": "a"}, **secret).status == 201
        joined, anonymous = Joined(gateway, **secret), Joined(gateway)
        joined.open(mine="/hulls/a/events", other="/hulls/b/events?wait=true")
        assert joined.next("mine")[0] == "snapshot"
        assert joined.next("other")[1]["status"] == 403
        own = gateway.call("PUT", f"/streams/{joined.stream}/subscriptions/b", {"path": "/events?prefix=a"}, **secret)
        others = joined.add("b", "/events?prefix=a")
        assert (own.status, others.status) == (204, 404)
        assert joined.next("b")[0] == "begin"
        anonymous.open(mine="/hulls/a/events")
        assert anonymous.next("mine")[1]["status"] == 401
        tokens.write_text(tokens.read_text().replace(digests[0], digests[1]))
        for each in ("mine", "b"):
            while joined.next(each)[0] != "problem":
                continue
        joined.close()
        anonymous.close()


def test_limits(address: str, name: str) -> None:
    metrics = f"127.0.0.1:{(port := free_port())}"
    options = ("--max-subscriptions", "2", "--max-streams", "4", "--metrics-port", str(port))
    with gateway_process(address, *options) as gateway:
        path = prepared(gateway, name)
        events = f"/hulls/{path}/events"
        refused = gateway.post("/streams", {"subscriptions": {each: {"path": events} for each in "abc"}})
        assert (refused.status, refused.json["reason"], refused.json["value"]) == (429, "STREAM_LIMIT", "2")
        joined, other = Joined(gateway), Joined(gateway)
        joined.open(a=events, b=events)
        assert [joined.next(each)[0] for each in "ab"] == ["snapshot"] * 2
        assert joined.add("c", events).json["reason"] == "STREAM_LIMIT"
        assert scrape(metrics)["dynhull_gateway_streams"] == 3
        other.open(a=events)
        assert other.next("a")[1]["reason"] == "STREAM_LIMIT"
        assert joined.remove("a").status == 204
        assert other.add("b", events).status == 204
        assert other.next("b")[0] == "snapshot"
        joined.close()
        other.close()
        wait_until(lambda: not scrape(metrics)["dynhull_gateway_streams"])


@slow
def test_nothing_is_missed_over_kills_of_the_server_and_the_gateway(tmp_path: Path, name: str) -> None:
    """Every event of a fence, an alarm and a feed once and in order, and the hulls in the end."""
    server = MortalServer(tmp_path)
    rounds = 0

    def change() -> None:
        nonlocal rounds
        rounds += 1
        with HullClient(server.address) as client:
            client.put(name, ["a"], [[rounds, 50.0 + rounds % 2]] if rounds % 2 else [[1, 1]])

    def sequences(of: str) -> list[int]:
        return [data["sequence"] for _, place, data in joined.events[of] if place]

    def up_to_date() -> bool:
        kept = joined.events
        revisions = [kept[each][-1][2]["revision"] for each in ("feed", "hull") if kept[each]]
        revisions += [each["revision"] for kind, _, data in kept["many"] if kind == "hulls" for each in data["hulls"]][
            -1:
        ]
        return (
            revisions == [rounds + 1] * 3
            and sequences("fence")[-1:] == [rounds + 3]
            and len(sequences("alarm")) == rounds
        )

    def catch_up() -> None:
        while not up_to_date():
            if not joined.read():
                joined.open()

    options = "--port", str(free_port())
    with gateway_process(server.address, *options, killed=True) as gateway:
        path = prepared(gateway, name)
        gateway.post(f"/hulls/{path}/points", {"keys": list("abc"), "points": [[1, 1], [0, 0], [3, 0]]})
        joined = Joined(gateway)
        joined.open(
            fence=f"/fences/{path}/events?after=0",
            alarm=f"/alarms/{path}/events?after=0",
            feed=f"/hulls/{path}/feed?after=0",
            hull=f"/hulls/{path}/events?rate=100&f=vertices",
            many=f"/events?prefix={path}&rate=100&outlines=true",
        )
        catch_up()
        for _ in range(2):
            change()
            server.kill()
            server.start()
            change()
            catch_up()
        change()
        gateway.process.kill()
        gateway.process.wait()
        change()
    with gateway_process(server.address, *options) as gateway:
        catch_up()
        change()
        catch_up()
        joined.close()
        vertices = gateway.get(f"/hulls/{path}").json["vertices"]
        assert joined.events["hull"][-1][2]["vertices"] == vertices
        assert joined.events["many"][-1][2]["hulls"][0]["vertices"] == vertices
    assert sequences("fence") == list(range(1, rounds + 4))
    assert sequences("alarm") == list(range(1, rounds + 1))
    assert [data["revision"] for _, place, data in joined.events["feed"] if place] == list(range(1, rounds + 2))
    server.kill()
