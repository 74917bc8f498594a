"""A browser that follows a past with a hole is told so once, and does not connect again and again."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cases import in_browser
from chromium import chromium
from gateway_process import gateway_process
from patience import PATIENCE, wait_until
from playwright.sync_api import Browser
from server_process import server_process

from dynhull_client import HullClient

KEYS = [f"vehicle {i}" for i in range(40)]
FOLLOW = """url => {
    const seen = {types: [], problems: [], closed: false}
    const source = new EventSource(url)
    source.onerror = () => { seen.closed = source.readyState == EventSource.CLOSED }
    for (const type of ["snapshot", "change", "progress", "batch", "lost", "end"])
        source.addEventListener(type, event => seen.types.push(type))
    source.addEventListener("problem", event => seen.problems.push(JSON.parse(event.data).reason))
    window.seen = {...window.seen, [url]: seen}
}"""
STREAMS = (
    "/hulls/fleet/replay",
    "/hulls/fleet/replay?f=vertices",
    "/hulls/fleet/replay?max_vertices=4",
    "/hulls/fleet/feed?after=0",
    "/hulls/fleet/feed?consumer=sink",
    "/feed?begin=true",
    "/feed?consumer=sink",
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


def filed(client: HullClient, folder: Path) -> list[Path]:
    """The segments of a fleet that is written to until there are three."""

    def write() -> bool:
        for _ in range(12):
            client.put("fleet", KEYS, np.random.default_rng().random((len(KEYS), 2)))
        return len(list(folder.rglob("*.batches.parquet"))) > 2

    wait_until(write)
    return sorted(folder.rglob("*.batches.parquet"))


@in_browser
def test_an_event_source_ends_at_a_hole(browser: Browser, tmp_path: Path) -> None:
    options = "--data", str(tmp_path), "--snapshot-points", "200"
    with (
        server_process(*options, complaints="a part of the past cannot be read") as server,
        HullClient(server.address) as client,
        gateway_process(server.address) as gateway,
    ):
        client.create_hull("fleet", keyed="str", history="30d")
        damaged = filed(client, tmp_path)[1]
        content = damaged.read_bytes()
        damaged.write_bytes(content[:-1])
        page = browser.new_page()
        requests: Counter[str] = Counter()
        page.on("request", lambda request: requests.update([request.url]))
        page.goto(f"{gateway.url}/openapi.json")
        for each in STREAMS:
            page.evaluate(FOLLOW, each)
        page.wait_for_function("Object.values(window.seen).every(seen => seen.closed)", timeout=PATIENCE * 1000)
        for each, seen in page.evaluate("window.seen").items():
            assert "end" not in seen["types"], each
            assert len(seen["types"]) > 5, each
            assert requests[gateway.url + each] == 2, (each, requests)
            assert seen["problems"] == ["PAST_DAMAGED"], each

        damaged.write_bytes(content)
        over = "/hulls/fleet/replay?from=1&max_vertices=4"
        page.evaluate(FOLLOW, over)
        page.wait_for_function("url => window.seen[url].closed", arg=over, timeout=PATIENCE * 1000)
        assert page.evaluate("url => window.seen[url].types", over).count("end") == 1
        assert requests[gateway.url + over] == 2
        page.close()
