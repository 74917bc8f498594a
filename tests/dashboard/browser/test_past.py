"""The past of hulls on the dashboard, in a real browser, on real servers that keep it."""

import json
import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from dashboard_process import PARTS, dashboard_process, opened, wait_for_vertices
from patience import wait_until
from playwright.sync_api import Browser, Locator, Page, Route, expect
from server_process import Server, run, server_process

from dynhull_client import HullClient

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
CORNERS = [[0, 0], [4, 0], [4, 4], [0, 4]]
KEYS = ["a", "b", "c", "d"]
REFUSALS = 8  # more than the client of the page asks again
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the server has its data."""
    return tmp_path_factory.mktemp("past")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[tuple[Server, str]]:
    """A server that keeps the past."""
    with server_process("--data", str(folder), "--snapshot-points", "200", complaints=None) as running:
        yield running, ""


@pytest.fixture
def fleet(client: HullClient, name: str) -> str:
    """A hull that has kept how its third vehicle went away."""
    client.create_hull(f"{name}/fleet", keyed="str", history="30d")
    client.put(f"{name}/fleet", [*KEYS, "inner"], [*CORNERS, [1, 2]])
    for step in range(1, 4):
        client.put(f"{name}/fleet", ["c"], [[4 + step, 4]])
    return f"{name}/fleet"


def corners(step: int) -> list[list[float]]:
    return [[0, 0], [4, 0], [4 + step, 4], [0, 4]]


def moment(client: HullClient, hull: str, revision: int) -> float:
    """When a revision was committed, in milliseconds since 1970."""
    return (client.at(hull, revision).time - datetime.fromtimestamp(0, UTC)) / timedelta(milliseconds=1)


def go(page: Page, client: HullClient, hull: str, revision: int) -> None:
    """Go to when a revision was committed, once the page knows that this is kept."""
    time = moment(client, hull, revision) + 0.001  # a browser's numbers are rounded
    page.wait_for_function("time => recorder.kept <= time", arg=time)
    page.evaluate("time => recorder.go(time)", time)


def timer(page: Page) -> Locator:
    return page.get_by_role("timer")


SAME_WORDS = """() => document.querySelector(".time [type=range]").getAttribute("aria-valuetext")
    == document.querySelector(".time [role=timer]").textContent"""


def row(page: Page, hull: str) -> Locator:
    return page.locator(".of_hulls").get_by_role("row").filter(has_text=hull)


@pytest.mark.smoke
def test_the_slider_goes_over_all_that_is_kept(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, corners(3))
        expect(page.locator(".oldest")).to_contain_text("Kept since")
        slider = page.get_by_role("slider", name="Moment shown")
        slider.press("Home")
        expect(row(page, fleet).locator("td").first).to_have_text("0")
        wait_for_vertices(page, fleet, [])
        go(page, client, fleet, 1)
        wait_for_vertices(page, fleet, corners(0))
        page.wait_for_function("name => picture.hulls.get(name).points.keys?.[0] == 'inner'", arg=fleet)
        expect(row(page, fleet)).to_contain_text("As it was")
        expect(timer(page)).to_have_text(re.compile(r"\w+ \d+, 20\d\d, \d\d:\d\d:\d\d \S+, \d+ s ago"))
        page.wait_for_function(SAME_WORDS)  # at one moment: it says how many seconds ago
        expect(page.get_by_role("group", name="Picture of the hulls")).to_have_accessible_description(
            re.compile("at revision 1")
        )
        for revision in (2, 3):
            go(page, client, fleet, revision)
            wait_for_vertices(page, fleet, corners(revision - 1))
        client.put(fleet, ["c"], [[9, 4]])  # the live picture goes on unseen
        go(page, client, fleet, 2)
        wait_for_vertices(page, fleet, corners(1))
        page.get_by_role("button", name="To now").click()
        wait_for_vertices(page, fleet, corners(5))
        expect(timer(page)).to_have_text("Live")
        expect(row(page, fleet)).not_to_contain_text("As it was")


def test_the_link_keeps_the_moment(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, corners(3))
        # Each moment is that of its revision, to the microsecond.
        for revision in (2, 3):
            go(page, client, fleet, revision)
            wait_for_vertices(page, fleet, corners(revision - 1))
            page.wait_for_function(
                "() => location.search.includes(`at=${encodeURIComponent(text_of(recorder.moment))}`)"
            )
            page.reload()
            page.evaluate(PARTS)
            wait_for_vertices(page, fleet, corners(revision - 1))
            expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
        page.get_by_role("button", name="To now").click()
        wait_for_vertices(page, fleet, corners(3))
        page.wait_for_function("() => !location.search.includes('at=')")
        # What is not kept is said, and the page shows what is now.
        page.goto(f"{url}?hull={fleet}&at=2001-02-03T04:05:06.789012Z")
        expect(page.locator(".why")).to_contain_text("The link is of Feb 3, 2001, 04:05:06 UTC, which is not kept.")
        wait_for_vertices(page, fleet, corners(3))
        page.evaluate(PARTS)
        assert page.evaluate(
            "[moment_of('2001-02-03T04:05:06.789012Z') % 1000, moment_of('soon'), moment_of(null)]"
        ) == [
            pytest.approx(789.012, abs=1e-3),
            None,
            None,
        ]


def test_a_page_that_is_loaded_again(browser: Browser, url: str, client: HullClient, name: str, fleet: str) -> None:
    """What it was sent before is gone; the server has the last hour of figures, and the past of hulls that keep one."""
    forgetful = f"{name}/forgetful"
    client.create_hull(forgetful)
    client.apply(forgetful, insert=CORNERS)
    with opened(browser, url, fleet, forgetful) as page:
        wait_for_vertices(page, fleet, corners(3))
        client.put(fleet, ["c"], [[8, 4]])
        client.apply(forgetful, insert=[[9, 9]])
        wait_for_vertices(page, fleet, corners(4))
        # The server keeps a row each ten seconds.
        wait_until(lambda: all(len(client.series(each).times) > 1 for each in (fleet, forgetful)))
        page.reload()
        page.evaluate(PARTS)
        wait_for_vertices(page, fleet, corners(4))
        # Rows of before it was loaded, which only the server has, and what is now.
        page.wait_for_function(
            """hulls => hulls.every(([hull, now]) => {
                const {time, area} = time_lines.rows.get(hull) ?? {time: []}
                return time[0] < recorder.began && area.at(-1) == now
            })""",
            arg=[[fleet, 24], [forgetful, 36]],
        )
        # A few seconds back, before it was loaded: the picture comes from the server.
        go(page, client, fleet, 2)
        assert page.evaluate("recorder.moment < recorder.recorded")
        wait_for_vertices(page, fleet, corners(1))
        wait_for_vertices(page, forgetful, [])
        expect(page.locator(".why")).to_contain_text(f"{forgetful} keeps no past. Keep it: dynhull history set")
        page.get_by_role("button", name="To now").click()
        expect(page.locator(".oldest")).to_contain_text("Kept since")
        page.goto(f"{url}?hull={forgetful}")
        page.evaluate(PARTS)
        expect(page.locator(".oldest")).to_have_text(
            re.compile(r"Back to \d\d:\d\d:\d\d \S+, when this page was opened: what it shows keeps no past")
        )
        page.evaluate("recorder.began -= 600_000")
        expect(page.locator(".oldest")).to_have_text("Back for five minutes: what it shows keeps no past")


# In each frame, where the bar is: a button that moves between the press and the release of a pointer is not clicked.
NOTE_PLACES = """() => {
    window.places = new Set()
    const note = () => {
        places.add(document.querySelector(".pause").getBoundingClientRect().top)
        requestAnimationFrame(note)
    }
    note()
}"""


@pytest.mark.parametrize("speed", ["1", "1000"])
def test_the_past_is_played_until_now(browser: Browser, url: str, client: HullClient, fleet: str, speed: str) -> None:
    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, corners(3))
        page.get_by_label("Speed").select_option(speed)
        go(page, client, fleet, 1)
        wait_for_vertices(page, fleet, corners(0))
        expect(row(page, fleet)).to_contain_text("As it was")
        page.evaluate(NOTE_PLACES)
        page.get_by_role("button", name="Play", exact=True).click()
        wait_for_vertices(page, fleet, corners(3))
        expect(row(page, fleet)).not_to_contain_text("As it was")
        assert page.evaluate("places.size") == 1
        page.get_by_role("button", name="Pause", exact=True).click()
        expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()


def test_what_is_missing_is_said(browser: Browser, url: str, client: HullClient, name: str, fleet: str) -> None:
    forgetful = f"{name}/forgetful"
    client.create_hull(forgetful)
    client.apply(forgetful, insert=CORNERS)
    client.remove(fleet, ["inner"])
    client.erase_history(fleet, ["inner"])
    with opened(browser, url, fleet, forgetful) as page:
        wait_for_vertices(page, fleet, corners(3))
        expect(page.locator(".why")).to_be_hidden()
        page.wait_for_function(
            "name => time_bar.hulls.some(({hull, erased}) => hull == name && erased.length)", arg=fleet
        )
        go(page, client, fleet, 2)
        wait_for_vertices(page, fleet, corners(1))
        expect(row(page, fleet)).to_contain_text("Keys were erased from this past on 20")
        page.wait_for_function("name => picture.hulls.get(name).points.keys?.length == 0", arg=fleet)
        # A hull that keeps nothing: how to keep it.
        keeps_none = f"{forgetful} keeps no past. Keep it: dynhull history set {forgetful} 30d"
        expect(page.locator(".why")).to_contain_text(keeps_none)  # the page asks about each hull by itself
        advice = page.locator(".why").text_content() or ""
        assert run(*advice.rpartition("dynhull ")[2].split()).returncode == 0
        expect(page.locator(".why")).to_be_hidden()


def test_a_hole_is_said_and_heals(browser: Browser, url: str, client: HullClient, fleet: str, folder: Path) -> None:
    time = moment(client, fleet, 2) + 0.001
    client.remove(fleet, ["inner"])
    client.erase_history(fleet, ["inner"])  # which makes segments of what the journal has
    (segment,) = (folder / "history" / client.get_hull(fleet).info.uid).glob("*.batches.parquet")
    content = segment.read_bytes()
    segment.unlink()
    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, corners(3))
        page.wait_for_function("time => recorder.kept <= time", arg=time)
        page.evaluate("time => recorder.go(time)", time)
        expect(row(page, fleet)).to_contain_text("cannot be read")
        wait_for_vertices(page, fleet, [])
        page.wait_for_function("() => time_bar.holes.length > 0")
        segment.write_bytes(content)
        wait_for_vertices(page, fleet, corners(1))


def test_a_server_that_cannot_answer_for_some_time_is_asked_again(
    browser: Browser, url: str, client: HullClient, fleet: str
) -> None:
    problem = {
        "type": "about:blank",
        "title": "Service Unavailable",
        "status": 503,
        "detail": "x",
        "reason": "STARTING",
    }
    refused = 0

    def refuse(route: Route) -> None:
        nonlocal refused
        if refused == REFUSALS or "/replay" not in (route.request.post_data or ""):
            route.continue_()
            return
        refused += 1
        route.fulfill(status=503, content_type="application/problem+json", body=json.dumps(problem))

    with opened(browser, url, fleet) as page:
        wait_for_vertices(page, fleet, corners(3))
        page.route(re.compile("/streams"), refuse)
        go(page, client, fleet, 2)
        wait_for_vertices(page, fleet, corners(1))
        assert refused == REFUSALS


def test_a_hull_whose_past_begins_later(browser: Browser, url: str, client: HullClient, name: str, fleet: str) -> None:
    late = f"{name}/late"
    client.create_hull(late, history=True)
    client.apply(late, insert=CORNERS)
    with opened(browser, url, fleet, late) as page:
        wait_for_vertices(page, late, CORNERS)
        go(page, client, fleet, 1)
        wait_for_vertices(page, fleet, corners(0))
        wait_for_vertices(page, late, [])
        expect(row(page, late)).to_contain_text("✗ Its past begins later")
        page.get_by_role("button", name="Play", exact=True).click()
        wait_for_vertices(page, late, CORNERS)
        wait_for_vertices(page, fleet, corners(3))


def test_without_the_right_to_the_past(browser: Browser, tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"
    made = run("token", "--name", "eye", "--read", "fleet", "--write", "fleet")
    tokens.write_text(made.stdout)
    token = made.stderr.split()[-1]
    with (
        server_process(
            "--data", str(tmp_path / "data"), "--tokens", str(tokens), complaints="may not read the past"
        ) as server,
        HullClient(server.address, token=token) as client,
        dashboard_process(server.address, "--token", token) as url,
    ):
        client.create_hull("fleet", history=True)
        client.apply("fleet", insert=CORNERS)
        with opened(browser, url, "fleet") as page:
            wait_for_vertices(page, "fleet", CORNERS)
            expect(page.locator(".oldest")).to_contain_text("Kept since")
            page.get_by_role("slider").press("Home")
            expect(row(page, "fleet")).to_contain_text("Start the dashboard with a --token that may read its past")


def test_dates_are_local_and_a_phone_has_all_of_it(browser: Browser, url: str, client: HullClient, fleet: str) -> None:
    with opened(browser, url, fleet, timezone_id="Asia/Kolkata", **PHONE) as page:
        wait_for_vertices(page, fleet, corners(3))
        go(page, client, fleet, 1)
        wait_for_vertices(page, fleet, corners(0))
        expect(timer(page)).to_contain_text("GMT+5:30")
        field = page.get_by_label("Go to a date and time")
        local = datetime.fromtimestamp(moment(client, fleet, 1) // 1000, UTC) + timedelta(hours=5.5)
        assert datetime.fromisoformat(field.input_value() + "Z") == local  # its text may leave out the seconds
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        # Before all that is kept: the oldest moment.
        field.fill(f"{local - timedelta(hours=1):%Y-%m-%dT%H:%M:%S}")
        field.blur()
        expect(row(page, fleet).locator("td").first).to_have_text("0")
