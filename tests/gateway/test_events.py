"""Server-sent events: read by a real browser, over restarts of everything."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from cases import slow
from chromium import chromium
from gateway_process import Events, Gateway, gateway_process
from patience import PATIENCE, wait_until
from playwright.sync_api import Browser, Page
from ports import free_port
from server_process import server_process

from dynhull_client import HullClient

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]

# Keeps what arrives, and the hull as the events of a watch make it.
FOLLOW = """url => {
    const seen = {ids: [], types: [], vertices: [], failed: false}
    const source = new EventSource(url)
    const note = event => { seen.ids.push(event.lastEventId); seen.types.push(event.type) }
    source.onerror = () => { seen.failed = source.readyState == EventSource.CLOSED }
    for (const type of ["enter", "exit", "progress", "deleted", "problem"]) source.addEventListener(type, note)
    source.addEventListener("snapshot", event => { note(event); seen.vertices = JSON.parse(event.data).vertices })
    source.addEventListener("change", event => {
        note(event)
        const {removed_rows, rotation, added, added_rows} = JSON.parse(event.data)
        const kept = seen.vertices.filter((_, row) => !removed_rows.includes(row))
        kept.push(...kept.splice(0, rotation))
        added_rows.forEach((row, i) => kept.splice(row, 0, added[i]))
        seen.vertices = kept
    })
    window.seen = {...window.seen, [url]: seen}
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


def seen(page: Page, url: str) -> dict[str, Any]:
    return page.evaluate("url => window.seen[url]", url)


@slow
def test_a_browser_misses_nothing_over_restarts(browser: Browser, tmp_path: Path) -> None:
    """The server is restarted, then the gateway, while points and keys come: every event once, and the exact hull."""
    served = ["--data", str(tmp_path), "--port", str(free_port())]
    own = ["--port", str(free_port())]
    hull, fence = "/hulls/a%2Fb/events?rate=100", "/fences/yard/events"
    moves = 0

    def move(client: HullClient) -> None:
        """A hull that grows, and a key that enters and leaves."""
        nonlocal moves
        moves += 1
        client.apply("a/b", insert=[[moves, moves * moves], [-moves, moves * moves]])
        client.put("fleet", ["van"], [[1, 1]] if moves % 2 else [[9, 9]])

    def arrived() -> bool:
        events = seen(page, fence)["ids"]
        return len(events) == moves and seen(page, hull)["vertices"] == vertices()

    def vertices() -> list[list[float]]:
        return client.get_hull("a/b").vertices.tolist()

    with browser.new_context() as context:
        page = context.new_page()
        with gateway_process("127.0.0.1:" + served[-1], *own) as gateway:
            with server_process(*served) as server, HullClient(server.address) as client:
                client.create_hull("a/b")
                client.create_hull("fleet", keyed="str")
                client.create_fence("yard", area=SQUARE, subjects="fleet", initial="none")
                page.goto(f"{gateway.url}/livez")
                for each in (hull, fence):
                    page.evaluate(FOLLOW, each)
                page.wait_for_function("url => window.seen[url].ids.length", arg=hull)
                for _ in range(3):
                    move(client)
                wait_until(arrived)
            with server_process(*served) as server, HullClient(server.address) as client:
                for _ in range(3):
                    move(client)
                wait_until(arrived)
                gateway.process.terminate()
                gateway.process.wait(PATIENCE)
                for _ in range(3):
                    move(client)
                with gateway_process(server.address, *own):
                    wait_until(arrived)
                    move(client)
                    wait_until(arrived)
                    of_fence, of_hull = seen(page, fence), seen(page, hull)
                    page.goto("about:blank")
    assert [int(each.rpartition(":")[2]) for each in of_fence["ids"]] == list(range(1, moves + 1))
    assert of_fence["types"] == ["enter", "exit"] * (moves // 2)
    revisions = [int(each.rpartition(":")[2]) for each in of_hull["ids"]]
    assert revisions == sorted(set(revisions))
    assert not of_hull["failed"]


def test_a_reader_continues_where_it_was(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name})
    gateway.post(f"/hulls/{name}/points", SQUARE)
    events = Events(gateway, f"/hulls/{name}/events?rate=100&measures=true")
    first = next(iter(events))
    gateway.post(f"/hulls/{name}/points", [[9, 9]])
    second = next(iter(events))
    assert (first["event"], second["event"]) == ("snapshot", "change")
    assert json.loads(second["data"])["measures"]["area"] == 36
    again = Events(gateway, f"/hulls/{name}/events?rate=100&measures=true", Last_Event_ID=first["id"])
    assert next(iter(again)) == second
    current = Events(gateway, f"/hulls/{name}/events?rate=100&measures=true", Last_Event_ID=second["id"])
    gateway.post(f"/hulls/{name}/points", [[11, 9]])
    assert current.next()[1]["revision"] == 3
    unknown = Events(gateway, f"/hulls/{name}/events?form=geojson", Last_Event_ID="other:3")
    kind, feature = unknown.next()
    assert (kind, feature["geometry"]["type"]) == ("snapshot", "Polygon")
    gateway.call("DELETE", f"/hulls/{name}")
    assert current.next()[0] == "deleted"
    gateway.post("/hulls", {"name": name})
    assert current.next()[0] == "snapshot"
    for each in (events, again, current, unknown):
        each.close()


def test_a_reader_cut_off_where_events_are_left_out(gateway: Gateway, name: str) -> None:
    """It would have missed the exit that was left out: it gets all events up to where what was sent together led."""
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    gateway.post("/fences", {"name": name, "area": {"exterior": SQUARE}, "subjects": name, "initial": "none"})

    def move(key: str, place: int) -> None:
        gateway.post(f"/hulls/{name}/points", {"keys": [key], "points": [[place, place]]})

    def after(ident: str) -> Events:
        return Events(gateway, f"/fences/{name}/events?conflate=true", Last_Event_ID=ident)

    for key, place in (("a", 1), ("a", 9), ("b", 1), ("c", 1), ("a", 1)):
        move(key, place)
    uid = gateway.get(f"/fences/{name}").json["uid"]
    whole = after(f"{uid}:1")
    first, last = next(iter(whole)), next(iter(whole))
    assert [json.loads(each["data"])["key"] for each in (first, last)] == ["b", "c"]
    assert last["id"] == f"{uid}:5"
    cut_off = after(first["id"])
    move("a", 9)
    for reader, expected in (
        (cut_off, ["exit a", "enter b", "enter c", "enter a", "exit a"]),
        (after(last["id"]), ["exit a"]),
        (whole, ["exit a"]),
    ):
        told = [reader.next() for _ in expected]
        assert [f"{kind} {data['key']}" for kind, data in told] == expected
        reader.close()


def test_a_layer_and_a_sketch(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name})
    octagon = [[2, 0], [4, 0], [6, 2], [6, 4], [4, 6], [2, 6], [0, 4], [0, 2]]
    gateway.post(f"/hulls/{name}/points", [*octagon, [2, 2], [3, 2], [3, 3]])
    path = f"/hulls/{name}/events?rate=100"
    layer = Events(gateway, f"{path}&layer=2&measures=true")
    first = next(iter(layer))
    assert json.loads(first["data"])["vertices"] == [[2, 2], [3, 2], [3, 3]]
    few = Events(gateway, f"{path}&max_vertices=4")
    sketch = next(iter(few))
    shown = json.loads(sketch["data"])
    assert (sketch["event"], "id" in sketch, len(shown["vertices"]), shown["revision"]) == ("snapshot", False, 4, 1)
    assert shown["error"] == 2**0.5
    feature = Events(gateway, f"{path}&max_vertices=4&form=geojson", Last_Event_ID=first["id"])
    assert len(feature.next()[1]["geometry"]["coordinates"][0]) == 5
    gateway.post(f"/hulls/{name}/points", [[9, 9]])
    second = next(iter(layer))
    # Without the octagon's (6, 4) and (4, 6), which are now below (9, 9).
    assert (second["event"], json.loads(second["data"])["measures"]["area"]) == ("change", 7)
    again = Events(gateway, f"{path}&layer=2&measures=true", Last_Event_ID=first["id"])
    assert next(iter(again)) == second
    assert [9, 9] in few.next()[1]["vertices"]
    gateway.call("DELETE", f"/hulls/{name}")
    assert (layer.next()[0], few.next()[0]) == ("deleted", "deleted")
    gateway.post("/hulls", {"name": name})
    assert few.next()[1]["vertices"] == []
    for each in (layer, few, feature, again):
        each.close()


@pytest.mark.parametrize(
    "query", ["layer=0", "layer=1001", "max_vertices=0", "max_vertices=1001", "layer=x", "rate=1e-9"]
)
def test_layers_and_sketches_out_of_range_are_refused(gateway: Gateway, name: str, query: str) -> None:
    gateway.post("/hulls", {"name": name})
    refused = gateway.get(f"/hulls/{name}/events?{query}")
    assert (refused.status, refused.json["field"]) == (400, query.partition("=")[0])


def test_the_form_of_events_has_one_name_and_an_old_one(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name})
    for query in ("f=geojson", "form=geojson"):
        events = Events(gateway, f"/hulls/{name}/events?{query}")
        assert events.next()[1]["type"] == "Feature"
        events.close()
    refused = gateway.get(f"/hulls/{name}/events?f=geojson&form=vertices")
    assert (refused.status, refused.json["field"]) == (400, "form")


def test_what_a_hull_does_not_have_is_refused_before_the_stream(gateway: Gateway, name: str) -> None:
    """After an event "problem", an EventSource would come again and again."""
    gateway.post("/hulls", {"name": name, "geographic": True})
    refused = gateway.get(f"/hulls/{name}/events?keys=true")
    assert (refused.status, refused.json["field"]) == (409, "keys")


def test_what_is_not_there_is_not_found(gateway: Gateway, name: str) -> None:
    for path in (f"/hulls/{name}/events", f"/fences/{name}/events"):
        assert gateway.get(path).status == 404


def test_a_hull_that_is_not_there_yet_is_awaited(gateway: Gateway, name: str) -> None:
    """A 404 would end an EventSource for good."""
    events = Events(gateway, f"/hulls/{name}/events?wait=true")
    gateway.post("/hulls", {"name": name})
    assert events.next()[0] == "snapshot"
    events.close()


def test_a_fence_from_any_place(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    gateway.post("/fences", {"name": name, "area": {"exterior": SQUARE}, "subjects": name, "initial": "none"})
    for x in (1, 9, 2):
        gateway.post(f"/hulls/{name}/points", {"keys": ["van"], "points": [[x, x]]})
    path = f"/fences/{quote(name)}/events"
    everything = Events(gateway, f"{path}?after=0")
    place = everything.next()
    assert place[1] is None
    assert [everything.next()[1]["type"] for _ in range(3)] == ["enter", "exit", "enter"]
    uid = place[0].partition(":")[0]
    rest = Events(gateway, path, Last_Event_ID=f"{uid}:2")
    assert rest.next() == ("enter", {**rest_of(gateway, path), "sequence": 3})
    consumer = Events(gateway, f"{path}?consumer=c")
    assert consumer.next()[1]["sequence"] == 1
    gateway.call("PUT", f"/fences/{name}/consumers/c", {"sequence": 2})
    later = Events(gateway, f"{path}?consumer=c")
    assert later.next()[1]["sequence"] == 3
    replaced = [Events(gateway, path, Last_Event_ID=f"another:{sequence}") for sequence in (9, 2**63, 2**64 - 1)]
    assert [each.next()[0] for each in replaced] == ["replaced"] * 3
    for ahead in (gateway.get(f"{path}?after=4"), gateway.get(path, Last_Event_ID=f"{uid}:{2**64 - 1}")):
        assert (ahead.status, ahead.json["reason"]) == (409, "SEQUENCE_AHEAD"), (
            "an EventSource would come again and again"
        )
    gateway.call("DELETE", f"/fences/{name}")
    assert rest.next()[0] == "closed"
    for each in (everything, rest, consumer, later, *replaced):
        each.close()


def test_who_sees_a_stream_open_misses_no_event(gateway: Gateway, address: str, name: str) -> None:
    """The place of "the next event" is known before the head of the answer is sent, and not looked for after it."""
    with HullClient(address) as client:
        client.create_hull(name, keyed="str")
        client.create_fence(name, area=SQUARE, subjects=name, initial="none")
        client.create_alarm(name, hull=name, when="count > 0")
        for turn in range(1, 26):
            streams = [Events(gateway, f"/{kind}/{quote(name, '')}/events") for kind in ("fences", "alarms")]
            client.put(name, ["van"], [(1, 1)])  # at once: the answers have begun, and nothing else of them is read
            client.remove(name, ["van"])
            for each, kind in zip(streams, ("enter", "raised"), strict=True):
                (_, nothing), (_, first) = each.next(), each.next()
                assert (nothing, first["type"], first["sequence"]) == (None, kind, 2 * turn - 1)
                each.close()


def test_keys_and_distances_that_are_zero_are_in_events(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "int"})
    gateway.post("/fences", {"name": name, "area": {"exterior": SQUARE}, "subjects": name})
    gateway.post(f"/hulls/{name}/points", {"keys": [0], "points": [[1, 1]]})
    events = Events(gateway, f"/fences/{quote(name)}/events?after=0")
    place, (_, nobody), (_, enter) = (events.next() for _ in range(3))
    assert (place[1], nobody["inside"]) == (None, [])
    assert (enter["key"], enter["distance"], "inside" in enter) == (0, 0, False)
    events.close()


def rest_of(gateway: Gateway, path: str) -> dict[str, Any]:
    events = Events(gateway, f"{path}?after=2")
    events.next()
    try:
        return events.next()[1]
    finally:
        events.close()


@slow
def test_a_reader_that_does_not_read_gets_a_snapshot_later(address: str, name: str) -> None:
    """While it does not read, what waits for it stays small; then it gets the whole hull, and what follows."""
    with HullClient(address) as client, gateway_process(address, "--metrics-port", "0") as gateway:
        client.create_hull(name)
        client.apply(name, insert=[[i, i * i] for i in range(8000)])  # 26 such events fill the most that Linux buffers
        slow = Events(gateway, f"/hulls/{name}/events?rate=100&f=vertices")
        other = Events(gateway, f"/hulls/{name}/events?rate=100&f=vertices")
        revision = 1
        for i in range(8000, 8120):
            revision = client.apply(name, insert=[[i, i * i]]).revision
            while other.next()[1]["revision"] < revision:
                pass
        received = []
        while not received or received[-1] < revision:
            received.append(slow.next()[1]["revision"])
        assert len(received) < 120
        slow.close()
        other.close()


def test_streams_end_with_the_gateway(address: str, name: str) -> None:
    with HullClient(address) as client, gateway_process(address, "--max-streams", "1") as gateway:
        client.create_hull(name)
        events = Events(gateway, f"/hulls/{name}/events")
        assert events.next()[0] == "snapshot"
        refused = gateway.get(f"/hulls/{name}/events")
        assert (refused.status, refused.json["reason"]) == (503, "STREAM_LIMIT")
        gateway.process.terminate()
        assert list(events) == []
        events.close()
