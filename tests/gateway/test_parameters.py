"""Parameters over HTTP: each once, moments by the names that the request has, and time spans as people write them."""

from collections.abc import Iterator
from datetime import timedelta

import pytest
from gateway_process import Events, Gateway, gateway_process
from server_process import server_process

from dynhull_client import HullClient


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with server_process("--data", str(tmp_path_factory.mktemp("past") / "data")) as server:
        yield server.address


@pytest.fixture(scope="module")
def gateway(address: str) -> Iterator[Gateway]:
    with gateway_process(address) as running:
        yield running


@pytest.fixture
def square(gateway: Gateway, name: str) -> str:
    assert gateway.post("/hulls", {"name": name}).status == 201
    assert gateway.post(f"/hulls/{name}/points", [[0, 0], [4, 0], [4, 4], [0, 4]]).json["revision"] == 1
    return name


def test_a_parameter_that_is_given_twice_is_refused_by_its_name(gateway: Gateway, address: str, square: str) -> None:
    at = f"/hulls/{square}"
    for url, name in (
        (f"{at}?at=1&at=0", "at"),
        (f"{at}/replay?from=1&from=0", "from"),
        (f"{at}/replay?speed=1&speed=1", "speed"),
        (f"{at}/feed?after=0&after=1", "after"),
        ("/hulls?prefix=a&prefix=b", "prefix"),
        ("/collections/hulls/items?limit=1&limit=2", "limit"),
    ):
        refused = gateway.get(url)
        assert (refused.status, refused.json["field"]) == (400, name), url
        assert refused.json["detail"] == f"{name}: the parameter is given 2 times: give it once"
    assert gateway.get(f"{at}?at=1&at=0").json["value"] == "1, 0"
    with HullClient(address) as client:
        client.create_hull("given-twice", keyed="str")
        client.put("given-twice", ["a", "b"], [[0, 0], [1, 1]])
    tracks = gateway.get("/hulls/given-twice/tracks?key=a&key=b&from=1").json["tracks"]
    assert [each["key"] for each in tracks] == ["a", "b"]


def test_moments_are_refused_by_the_names_that_the_request_has(gateway: Gateway, square: str) -> None:
    at = f"/hulls/{square}"
    subjects = {"name": f"{square}-keys", "keyed": "str"}
    assert gateway.post("/hulls", subjects).status == 201
    fence = {"area": {"exterior": [[0, 0], [9, 0], [9, 9]]}, "subjects": subjects["name"]}
    cases = (
        (gateway.get(f"{at}?at=99"), 410, "at"),
        (gateway.get(f"{at}?at=2099-01-01T00:00Z"), 410, "at"),
        (gateway.get(f"{at}/replay?from=1&to=0"), 400, "to"),
        (gateway.get(f"{at}/replay?from=99"), 410, "from"),
        (gateway.get(f"{at}/replay?from=2001-01-01T00:00Z"), 410, "from"),
        (gateway.get(f"{at}/replay?to=99"), 410, "to"),
        (gateway.get(f"{at}/replay?to=2099-01-01T00:00Z"), 410, "to"),
        (gateway.get(f"{at}/feed?after=99"), 410, "after"),
        (gateway.post("/fences/between", fence | {"start": "99"}), 410, "start"),
        (gateway.post("/fences/between", fence | {"start": "1", "end": "99"}), 410, "end"),
        (gateway.post("/fences/between", fence | {"start": "soon"}), 400, "start"),
        (gateway.post("/fences/between", fence | {"start": 1}), 400, "start"),
    )
    for number, (answer, status, field) in enumerate(cases):
        assert (answer.status, answer.json.get("field")) == (status, field), (number, answer.json)
    assert cases[2][0].json["detail"] == "to: is before the start, which is revision 1"


def test_a_replay_after_an_event_of_a_hull_that_was_made_again_says_so(gateway: Gateway, square: str) -> None:
    at = f"/hulls/{square}/replay?from=1&to=1"
    uid = gateway.get(f"/hulls/{square}").json["info"]["uid"]
    kept_no_more = gateway.get(at, Last_Event_ID=f"{uid}:9")
    assert (kept_no_more.status, kept_no_more.json["field"]) == (410, "Last-Event-ID")
    assert gateway.call("DELETE", f"/hulls/{square}").status == 204
    assert gateway.post("/hulls", {"name": square}).status == 201
    assert gateway.post(f"/hulls/{square}/points", [[0, 0]]).status == 200
    for revision in (1, 9):  # one that the new hull has, and one that it has not
        refused = gateway.get(at, Last_Event_ID=f"{uid}:{revision}")
        assert (refused.status, refused.json["reason"], refused.json["field"]) == (
            409,
            "HULL_REPLACED",
            "Last-Event-ID",
        )


OF_HULL, OF_FENCE, OF_ALARM = "/hulls/ids/events", "/fences/ids/events", "/alarms/ids/events"
OF_MANY, REPLAY, FEED, FEEDS = "/events", "/hulls/ids/replay", "/hulls/ids/feed", "/feed"
PLACES = OF_HULL, OF_FENCE, OF_ALARM, REPLAY, FEED
STRANGE = ":1", "a:", "a:-1", "a:1.0", f"a:{2**64}", "a:1~", "a:\xb2", "a b:1", "nonsense"


def test_an_id_that_cannot_be_read_is_refused(gateway: Gateway) -> None:
    """An EventSource gives up after it; what it has received is never such an id."""
    gateway.post("/hulls", {"name": "ids", "keyed": "str"})
    gateway.post("/fences", {"name": "ids", "area": {"center": [0, 0], "radius": 1}, "subjects": "ids"})
    gateway.post("/alarms", {"name": "ids", "hull": "ids", "when": "count > 3"})
    cases = [(path, ident) for path in PLACES for ident in STRANGE]
    cases += [(path, "a:over") for path in (OF_HULL, OF_FENCE, OF_ALARM, OF_MANY)]
    cases += [(path, "a:1~2") for path in (OF_HULL, OF_ALARM, REPLAY, FEED)] + [(OF_FENCE, f"a:1~{2**64}")]
    cases += [(path, ident) for path in (OF_MANY, FEEDS) for ident in ("a:1", "0", "0g", "00 11", "00", "ff" * 21)]
    for path, ident in cases:
        refused = gateway.get(path, Last_Event_ID=ident)
        assert (refused.status, refused.json["reason"]) == (400, "INVALID_FIELD"), (path, ident)
        assert (refused.json["field"], refused.json["value"]) == ("Last-Event-ID", ident), (path, ident)
        assert refused.json["detail"].startswith("Last-Event-ID: "), (path, ident)
    twice = gateway.get(OF_HULL, Last_Event_ID="a:1", last_event_id="a:2")
    assert (twice.status, twice.json["field"], twice.json["value"]) == (400, "Last-Event-ID", "a:1, a:2")
    for path in (REPLAY, FEED, FEEDS):
        assert gateway.get(path, Last_Event_ID="any:over").status == 204
    joined = Events(gateway, "/streams", {"subscriptions": {"a": {"path": OF_HULL, "last_event_id": "nonsense"}}})
    assert next(problem for kind, problem in iter(joined.next, None) if kind == "problem")["field"] == "Last-Event-ID"
    joined.close()
    for path, ident in ((OF_HULL, ""), (OF_HULL, "a:1"), (OF_MANY, "")):
        events = Events(gateway, path, Last_Event_ID=ident)
        assert next(iter(events))["event"] in ("snapshot", "begin")
        events.close()


def test_time_spans_are_seconds_or_text_everywhere(gateway: Gateway, address: str) -> None:
    made = gateway.post("/hulls", {"name": "spans", "keyed": "str", "max_age": "1h", "history": "30d"})
    assert (made.status, made.json["window"]["max_age"]) == (201, 3600.0)
    put = {"keys": ["a"], "points": [[0, 0]]}
    assert gateway.post("/hulls/spans/points", put | {"ttl": "10m"}).status == 200
    assert gateway.get("/hulls/spans/tracks?key=a&every=1m&from=0").status == 200
    assert [gateway.get(f"/hulls/spans/series?last={last}").status for last in ("30m", "60")] == [200, 200]
    assert gateway.post("/hulls/spans/rows?ttl=10m", b"key,x,y\nb,1,1\n", "text/csv").status == 200
    for refused in (
        gateway.post("/hulls", {"name": "spans-2", "max_age": "an hour"}),
        gateway.post("/hulls", {"name": "spans-2", "history": "an hour"}),
        gateway.post("/hulls/spans/points", put | {"ttl": "an hour"}),
        gateway.get("/hulls/spans/tracks?key=a&every=an hour".replace(" ", "%20")),
    ):
        assert refused.status == 400
        assert "must be a time span: write for example 500ms, 90s, 30m, 2h or 7d" in refused.json["detail"]
        assert refused.json["field"] in ("max_age", "history", "ttl", "every")
    for nothing in ("-1", "0", "nan", "inf", "99999999d"):
        refused = gateway.get(f"/hulls/spans/tracks?key=a&every={nothing}")
        assert (refused.status, refused.json["field"]) == (400, "every"), nothing
    with HullClient(address) as client:
        made = client.create_hull("spans-sdk", keyed="str", max_age="1h")
        assert made.window is not None
        assert made.window.max_age == timedelta(hours=1)
        client.put("spans-sdk", ["a"], [[0, 0]], ttl="10m")
        assert list(client.track("spans-sdk", ["a"], 0, every="1m")) == ["a"]
