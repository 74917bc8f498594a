"""Many hulls as server-sent events: whoever reads them holds the newest state of each."""

import asyncio
import json
from collections.abc import AsyncGenerator, AsyncIterator, Iterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from gateway_process import Events, Gateway, gateway_process
from metrics import scrape
from patience import wait_until
from ports import free_port

from dynhull_client import HullClient, ManyChange
from dynhull_gateway.events.many import ManyFeed, ManyView

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]


@pytest.fixture
def client(address: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        yield client


class ScriptedClient:
    """A client whose watch says what a test tells it."""

    def __init__(self) -> None:
        self.told: asyncio.Queue[ManyChange] = asyncio.Queue()

    @asynccontextmanager
    async def watch_many(self, **_: object) -> AsyncIterator[AsyncIterator[ManyChange]]:
        async def changes() -> AsyncIterator[ManyChange]:
            while True:
                yield await self.told.get()

        yield changes()


class Reader:
    """Keeps what the events say.

    Attributes:
        hulls: the newest state of each hull.
        ident: the id to go on after.
    """

    def __init__(
        self, gateway: Gateway, path: str, ident: str | None = None, hulls: dict[str, Any] | None = None
    ) -> None:
        headers = {} if ident is None else {"Last_Event_ID": ident}
        self._events = Events(gateway, path, **headers)
        self.hulls: dict[str, Any] = dict(hulls or {})
        self.ident = ident
        self._named: set[str] = set()

    def until(self, kind: str) -> None:
        for event in self._events:
            self.ident = event.get("id", self.ident)
            data = json.loads(event["data"]) if "data" in event else {}
            if event.get("event") in ("begin", "restored"):
                self._named = set()
            for hull in data.get("hulls", []) if event.get("event") == "hulls" else []:
                self.hulls[hull["hull"]] = hull
                self._named.add(hull["hull"])
            self._named |= set(data.get("unchanged", []))
            for gone in data.get("gone", []):
                self.hulls.pop(gone, None)
            if event.get("event") == "complete":
                self.hulls = {name: self.hulls[name] for name in self._named}
            if event.get("event") == kind:
                return
        raise AssertionError(f"the stream has ended without {kind}")

    def close(self) -> None:
        self._events.close()


def present(client: HullClient, prefix: str) -> dict[str, tuple[str, int, float | None]]:
    found = {}
    for info in client.list_hulls(prefix):
        area = client.get_hull(info.name).measures.area
        found[info.name] = info.uid, info.revision, area if info.points else None
    return found


def held(reader: Reader) -> dict[str, tuple[str, int, float | None]]:
    return {
        name: (hull["uid"], hull["revision"], hull["measures"]["area"] if "measures" in hull else None)
        for name, hull in reader.hulls.items()
    }


def test_a_reader_holds_what_there_is_and_goes_on_where_it_was(gateway: Gateway, client: HullClient, name: str) -> None:
    for part in "abc":
        client.create_hull(f"{name}/{part}")
        client.apply(f"{name}/{part}", insert=SQUARE)
    reader = Reader(gateway, f"/events?prefix={name}/&rate=100")
    reader.until("complete")
    assert held(reader) == present(client, f"{name}/")
    client.apply(f"{name}/a", insert=[[9, 9]])
    client.delete_hull(f"{name}/b")
    client.create_hull(f"{name}/new")
    while held(reader) != present(client, f"{name}/"):
        reader.until("hulls")
    reader.close()
    client.apply(f"{name}/c", insert=[[7, 7]])
    client.delete_hull(f"{name}/a")
    again = Reader(gateway, f"/events?prefix={name}/&rate=100", reader.ident, reader.hulls)
    again.until("complete")
    assert held(again) == present(client, f"{name}/")
    again.close()


def test_outlines_of_names(gateway: Gateway, client: HullClient, name: str) -> None:
    client.create_hull(name)
    client.apply(name, insert=SQUARE)
    reader = Reader(gateway, f"/events?name={name}&name={name}-later&outlines=true&max_vertices=3")
    reader.until("complete")
    assert len(reader.hulls[name]["vertices"]) == 3
    assert reader.hulls[name]["error"] > 0
    client.create_hull(f"{name}-later")
    reader.until("hulls")
    assert set(reader.hulls) == {name, f"{name}-later"}
    reader.close()


def test_an_id_of_another_server_begins_with_all(gateway: Gateway, client: HullClient, name: str) -> None:
    client.create_hull(name)
    for ident in ("ab" * 20, "ab" * 40, "ab" * 1000):  # of one partition, two, and as many as there can be
        reader = Reader(gateway, f"/events?name={name}", ident)
        reader.until("complete")
        assert set(reader.hulls) == {name}
        reader.close()


def test_restores_before_a_reader_are_none_of_its_own() -> None:
    view = ManyView(None, "", (), False, None, 10.0)
    picture = ManyChange("state", "a"), ManyChange("complete", position=b"1")

    async def kinds(texts: AsyncGenerator[bytes, None]) -> list[bytes]:
        return [(await anext(texts)).partition(b"\n")[0] for _ in range(3)]

    async def main() -> None:
        client = ScriptedClient()
        feed = ManyFeed(client, view)  # type: ignore[arg-type]
        for change in picture:
            client.told.put_nowait(change)
        early = feed.read(None, 60)
        assert await kinds(early) == [b"event: begin", b"event: hulls", b"event: complete"]
        for change in (ManyChange("restored"), *picture):
            client.told.put_nowait(change)
        assert await kinds(early) == [b"event: restored", b"event: hulls", b"event: complete"]
        late = feed.read(None, 60)
        assert await kinds(late) == [b"event: begin", b"event: hulls", b"event: complete"]
        for reading in (early, late):
            await reading.aclose()
        await feed.close()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("query", "field"), [("prefix=a&name=b", "name"), ("max_vertices=3", "max_vertices"), ("name=a%20b", "name")]
)
def test_refused(gateway: Gateway, query: str, field: str) -> None:
    answer = gateway.get(f"/events?{query}")
    assert (answer.status, answer.json["field"]) == (400, field)


def test_streams_of_a_caller_are_limited(address: str, client: HullClient, name: str) -> None:
    client.create_hull(name)
    metrics = f"127.0.0.1:{(port := free_port())}"
    options = ("--max-many-streams-per-caller", "1", "--metrics-port", str(port))
    with gateway_process(address, *options) as gateway:
        reader = Reader(gateway, f"/events?name={name}")
        reader.until("complete")
        other = Events(gateway, f"/hulls/{name}/events")  # of one hull: not one of these
        refused = gateway.get(f"/events?name={name}-other")
        assert (refused.status, refused.json["reason"], refused.json["value"]) == (429, "STREAM_LIMIT", "1")
        assert "max_many_streams_per_caller" in refused.json["detail"]
        counted = 'dynhull_gateway_refused_streams_total{limit="max_many_streams_per_caller"}'
        assert scrape(metrics)[counted] == 1
        other.close()
        reader.close()
        wait_until(lambda: not scrape(metrics)["dynhull_gateway_streams"])
        reader = Reader(gateway, f"/events?name={name}")
        reader.until("complete")
        reader.close()
