"""Alarms on the dashboard, in a real browser, on a real server."""

import re
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest
from contrast import CONTRAST
from dashboard_process import dashboard_process, opened, wait_for_vertices
from playwright.sync_api import Browser, Locator, Page, expect
from server_process import run, server_process

from dynhull_client import HullClient

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
NUMBERS = count(1)
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True}


@pytest.fixture
def fleet(client: HullClient) -> Iterator[str]:
    """A hull for which an alarm of its name is raised."""
    name = f"fleet-{next(NUMBERS)}"
    client.create_hull(name)
    client.apply(name, insert=SQUARE)
    client.create_alarm(name, hull=name, when="area > 10", clear="area < 9")
    yield name
    client.delete_alarm(name)


def row(page: Page, hull: str) -> Locator:
    return page.locator(".alarms tbody").get_by_role("row").filter(has_text=hull)


def heading(page: Page) -> Locator:
    return page.locator(".alarms h2")


def test_an_alarm_is_raised_acknowledged_muted_and_cleared(
    browser: Browser, url: str, client: HullClient, fleet: str
) -> None:
    client.apply(fleet, insert=[[9, 4]])
    with opened(browser, url, fleet) as page:
        expect(heading(page)).to_have_text("▲ 1 alarm")
        assert page.title() == "▲ 1 dynhull"
        alarm = row(page, fleet)
        expect(alarm.locator(".state")).to_have_text("▲ Raised")
        expect(alarm.locator(".value")).to_have_text("26")
        expect(alarm.locator(".rule")).to_have_text(f"{fleet}: area > 10, clear area < 9")
        expect(alarm.locator(".since")).to_have_text(re.compile(r"\w+ \d+, 20\d\d, \d\d:\d\d:\d\d \S+"))
        # By keyboard; the focus stays while the value changes.
        acknowledge = alarm.get_by_role("button", name="Acknowledge")
        acknowledge.focus()
        client.apply(fleet, insert=[[9, 5]])
        expect(alarm.locator(".value")).not_to_have_text("26")
        expect(acknowledge).to_be_focused()
        acknowledge.press("Enter")
        expect(alarm.locator(".state")).to_have_text("◆ Acknowledged")
        assert [status.acknowledged is not None for status in client.get_alarm(fleet).statuses] == [True]
        expect(heading(page)).not_to_contain_text("▲")
        assert page.title() == "dynhull"
        alarm.get_by_role("button", name="Mute 1 h").click()
        expect(alarm.locator(".state")).to_have_text(re.compile("◇ Muted until .*20"))
        alarm.get_by_role("button", name="Unmute").click()
        expect(alarm.locator(".state")).to_have_text("◆ Acknowledged")
        client.apply(fleet, delete=[[9, 4], [9, 5], [4, 4]])
        expect(alarm.locator(".state")).to_have_text("✓ Cleared")
        expect(alarm.get_by_role("button")).to_have_count(0)


def test_raised_ones_are_first_and_deleted_ones_leave(
    browser: Browser, url: str, client: HullClient, fleet: str
) -> None:
    hulls = [f"{fleet}-{each}/x" for each in "ab"]
    for hull in hulls:
        client.create_hull(hull)
        client.apply(hull, insert=SQUARE)
    client.create_alarm(f"{fleet}-many", prefix=f"{fleet}-", when="count > 3")
    client.acknowledge_alarm(f"{fleet}-many", hulls[0])
    with opened(browser, url, fleet) as page:
        expect(page.locator(".alarms tbody .hull")).to_have_text([hulls[1], fleet, hulls[0]])
        client.delete_alarm(f"{fleet}-many")
        expect(page.locator(".alarms tbody .hull")).to_have_text([fleet])


def test_a_token_that_may_not_acknowledge(browser: Browser, tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"
    made = [
        run("token", "--name", each, "--read", "fleet", *write)
        for each, write in (("eye", ()), ("hand", ("--write", "fleet")))
    ]
    tokens.write_text("".join(each.stdout for each in made))
    eye, hand = (each.stderr.split()[-1] for each in made)
    with (
        server_process("--in-memory", "--tokens", str(tokens), complaints="may not write") as server,
        HullClient(server.address, token=hand) as client,
        dashboard_process(server.address, "--token", eye) as url,
    ):
        client.create_hull("fleet")
        client.apply("fleet", insert=SQUARE)
        client.create_alarm("fleet", hull="fleet", when="area > 10")
        with opened(browser, url, "fleet") as page:
            row(page, "fleet").get_by_role("button", name="Acknowledge").click()
            expect(page.locator(".alarms .trouble")).to_contain_text(
                "Start the dashboard with a --token that may write fleet"
            )
            expect(row(page, "fleet").get_by_role("button")).to_have_count(0)
            expect(row(page, "fleet").locator(".state")).to_have_text("▲ Raised")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_alarms_have_contrast_and_fit_a_phone(browser: Browser, url: str, fleet: str, scheme: str) -> None:
    with opened(browser, url, fleet, color_scheme=scheme, **PHONE) as page:
        wait_for_vertices(page, fleet, SQUARE)
        expect(row(page, fleet)).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        for part in (
            heading(page),
            *(row(page, fleet).locator(each) for each in (".state", ".value", ".since", ".rule")),
        ):
            ink, ground = part.evaluate("""each => {
                const ground = each => getComputedStyle(each).backgroundColor
                let under = each
                while (ground(under) == "rgba(0, 0, 0, 0)") under = under.parentElement
                return [getComputedStyle(each).color, ground(under)]
            }""")
            assert page.evaluate(CONTRAST, [ink, ground]) >= 4.5
