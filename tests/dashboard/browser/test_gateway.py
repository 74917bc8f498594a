"""The page as a part of the gateway: its one stream, its token, and what it may load, in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from dashboard_process import opened, wait_for_vertices
from gateway_process import gateway_process
from playwright.sync_api import Browser, Page, Request, expect
from server_process import run, server_process

from dynhull_client import HullClient

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
HULLS, FENCES, PREFIXES = 10, 6, 2  # as many as fit on a page


@pytest.fixture
def fleet(client: HullClient, name: str) -> Iterator[str]:
    """A prefix of hulls and of fences around their keys, and an alarm of each."""
    for row in range(HULLS):
        client.create_hull(f"{name}/{row}", keyed="str")
        client.put(f"{name}/{row}", ["a", "b", "c", "d"], SQUARE)
    for row in range(FENCES):
        client.create_fence(f"{name}/f{row}", area=SQUARE, subjects=f"{name}/{row}")
    client.create_alarm(f"{name}/alarm", prefix=f"{name}/", when="count > 3")
    yield name
    client.delete_alarm(f"{name}/alarm")


def is_stream(request: Request) -> bool:
    return request.method == "POST" and request.url.endswith("/streams")


def test_a_page_has_one_stream_whatever_it_shows(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    """Six connections are what a browser gives to an origin: three tabs that show all that they can are alive."""
    hulls, fences = [f"{fleet}/{row}" for row in range(HULLS)], [f"{fleet}/f{row}" for row in range(FENCES)]
    with browser.new_context(viewport={"width": 1440, "height": 900}) as context:
        tabs = [context.new_page() for _ in range(3)]
        opened_streams: dict[Page, list[str]] = {tab: [] for tab in tabs}
        query = "&".join([*(f"hull={each}" for each in hulls), *(f"fence={each}" for each in fences)])
        for tab in tabs:
            tab.on("request", lambda request, tab=tab: is_stream(request) and opened_streams[tab].append(request.url))
            tab.goto(f"{url}/?{query}&outliers=1")
        for tab in tabs:
            wait_for_vertices(tab, hulls[0], SQUARE)
            expect(tab.locator(".alarms h2")).to_contain_text("alarms")
        client.put(hulls[0], ["c"], [[9, 4]])
        client.put(hulls[-1], ["c"], [[9, 4]])
        for tab in tabs:
            for hull in (hulls[0], hulls[-1]):
                wait_for_vertices(tab, hull, [[0, 0], [4, 0], [9, 4], [0, 4]])
            expect(tab.locator(".events tbody tr").filter(has_text="exit")).to_have_count(1)
        assert [len(each) for each in opened_streams.values()] == [1, 1, 1]


# A page with a map alone, from the files of the dashboard, which counts the events of each kind.
MAP = """async ([page, hulls, fences]) => {
    const html = new DOMParser().parseFromString(await (await fetch(page)).text(), "text/html")
    const script = document.createElement("script")
    Object.assign(script, {type: "importmap", textContent: html.querySelector("[type=importmap]").textContent})
    document.head.append(script)
    await import(html.querySelector("[type=module]").src.replace("page.js", "dynhull/map/index.js"))
    globalThis.seen = {}
    addEventListener("dynhull-event", ({detail: {kind, event}}) => {
        const of = kind == "fence" ? `${event.fence} ${event.type}` : kind
        seen[of] = (seen[of] ?? 0) + 1
    })
    const map = document.createElement("dynhull-map")
    map.setAttribute("hull", hulls.join(" "))
    map.setAttribute("fence", fences.join(" "))
    document.body.append(map)
}"""
# From where on a fence is followed is known once its settings have come.
ASKED = """count => {
    const come = performance.getEntriesByType("resource").filter(({responseEnd}) => responseEnd)
    return new Set(come.map(({name}) => name).filter(name => /fences\\/[^/]+$/.test(name))).size == count
}"""
TWELVE = 12


def test_twelve_hulls_and_twelve_fences_in_three_tabs(
    browser: Browser, url: str, client: HullClient, name: str
) -> None:
    """More than a dashboard shows by name; the origin still answers other requests of these tabs at once."""
    hulls, fences = [f"{name}/{row}" for row in range(TWELVE)], [f"{name}/f{row}" for row in range(TWELVE)]
    for hull, fence in zip(hulls, fences, strict=True):
        client.create_hull(hull, keyed="str")
        client.put(hull, ["a", "b", "c", "d"], SQUARE)
        client.create_fence(fence, area=SQUARE, subjects=hull)
    with browser.new_context() as context:
        tabs = [context.new_page() for _ in range(3)]
        streams: list[str] = []
        for tab in tabs:
            tab.on("request", lambda request: streams.append(request.url) if is_stream(request) else None)
            tab.goto(f"{url}/dashboard/version")
            tab.evaluate(MAP, [f"{url}/dashboard", hulls, fences])
        for tab in tabs:
            tab.wait_for_function("all => seen.hull >= all", arg=TWELVE)
            tab.wait_for_function(ASKED, arg=TWELVE)
        for hull in hulls:
            client.put(hull, ["c"], [[9, 4]])
        for tab in tabs:
            tab.wait_for_function("fences => fences.every(each => seen[`${each} exit`] == 1)", arg=fences)
            assert tab.evaluate("fetch('/dashboard/version').then(answer => answer.status)") == 200
        assert len(streams) == len(tabs)


@pytest.mark.smoke
def test_a_gateway_asks_for_a_token_and_keeps_it_in_memory(browser: Browser, tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"
    made = run("token", "--name", "eye", "--read", "fleet", "--write", "fleet")
    tokens.write_text(made.stdout)
    token = made.stderr.split()[-1]
    with (
        server_process("--in-memory", "--tokens", str(tokens), complaints="UNAUTHENTICATED") as server,
        HullClient(server.address, token=token) as client,
        gateway_process(server.address) as gateway,
    ):
        client.create_hull("fleet")
        client.apply("fleet", insert=SQUARE)
        asked: list[Request] = []
        with opened(browser, f"{gateway.url}/dashboard", "fleet") as page:
            page.on("request", lambda request: asked.append(request))
            field = page.get_by_label("Token")
            expect(field).to_be_visible()
            expect(page.get_by_role("alert")).to_contain_text("refuses the dashboard")
            field.fill(token)
            field.press("Enter")
            wait_for_vertices(page, "fleet", SQUARE)
            expect(field).to_be_hidden()
            expect(page.get_by_role("alert")).to_be_hidden()
            assert token not in page.url
            assert all(token not in request.url for request in asked)
            assert page.context.cookies() == []
            assert page.evaluate("JSON.stringify([{...localStorage}, {...sessionStorage}])") == "[{},{}]"
            page.reload()
            expect(field).to_be_visible()
            expect(field).to_have_value("")


def test_the_page_loads_nothing_that_its_policy_does_not_allow(browser: Browser, url: str) -> None:
    with browser.new_context() as context:
        page = context.new_page()
        page.goto(f"{url}/?hull=none")
        refused = page.evaluate("""async () => {
            const refused = []
            addEventListener("securitypolicyviolation", ({effectiveDirective}) => refused.push(effectiveDirective))
            document.body.append(Object.assign(document.createElement("script"), {textContent: "window.ran = true"}))
            document.body.append(Object.assign(document.createElement("img"), {src: "http://127.0.0.1:9/x.png"}))
            await fetch("http://127.0.0.1:9/").catch(() => {})
            await new Promise(resolve => setTimeout(resolve, 200))
            return [window.ran, ...refused.sort()]
        }""")
        assert refused == [None, "connect-src", "img-src", "script-src-elem"]
