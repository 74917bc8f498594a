"""The page as a screen in a room: its room, its drawers, day and night, and what axe finds, in a real browser."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from contrast import CONTRAST
from dashboard_process import opened
from peers import axe
from playwright.sync_api import Browser, Page, expect

from dynhull_client import Circle, HullClient

pytestmark = [
    pytest.mark.long,  # first, so that one worker, and one browser, has all of them
    pytest.mark.usefixtures("fleet"),
]
FLEET = "screen"
CITIES = {"berlin": (13.4, 52.5), "a-city-with-a-name-that-is-as-long-as-names-of-fleets-may-well-be": (10.0, 53.55)}
SIZES = [(390, 844), (1400, 900), (1920, 1080), (3840, 2160)]
PHONE = {"width": 390, "height": 844}
# Pairs of texts that lie over each other, outside of the map, as they are seen.
OVERPRINTED = """() => {
    const seen = []
    const hidden = holder => holder && (getComputedStyle(holder).clipPath != "none" || hidden(holder.parentElement))
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT)
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
        const holder = node.parentElement
        if (!node.textContent.trim() || !holder.checkVisibility()) continue
        if (holder.closest(".map, option, script")) continue
        const range = document.createRange()
        range.selectNodeContents(node)
        for (const {left, top, right, bottom} of range.getClientRects()) {
            const box = {left, top, right, bottom, text: node.textContent.trim()}
            if (hidden(holder)) continue
            for (let frame = holder; frame; frame = frame.parentElement) {
                if (getComputedStyle(frame).overflow == "visible") continue
                const edge = frame.getBoundingClientRect()
                box.top = Math.max(box.top, edge.top)
                box.bottom = Math.min(box.bottom, edge.bottom)
            }
            if (box.bottom - box.top > 2 && box.right - box.left > 2) seen.push(box)
        }
    }
    const over = (one, two) => Math.min(one.right, two.right) - Math.max(one.left, two.left) > 1
        && Math.min(one.bottom, two.bottom) - Math.max(one.top, two.top) > 3
    const pairs = seen.flatMap((one, row) => seen.slice(row + 1).map(two => [one, two]))
    return pairs.filter(pair => over(...pair)).map(pair => pair.map(({text}) => text))
}"""
FINDINGS = """async () => {
    const {violations} = await axe.run()
    return violations.map(({id, nodes}) => [id, ...nodes.map(({target, failureSummary}) => [target, failureSummary])])
}"""

# Ten thousand rings in a plane, as a prefix brings them.
CROWD = """() => {
    picture.keep([], [], [{name: "crowd/", colour: "#0072B2", dash: []}])
    globalThis.ring_of = (hull, moved = 0) => {
        const middle = [10 * (hull % 100), 10 * Math.floor(hull / 100)], steps = [...Array(24).keys()]
        const at = (turn, axis) => middle[axis] + moved + 4 * [Math.cos, Math.sin][axis](turn * Math.PI / 12)
        picture.take({kind: "outline", within: "crowd/", hull: `crowd/${hull}`, revision: 1 + moved, keys: null,
            rings: null, x: steps.map(step => at(step, 0)), y: steps.map(step => at(step, 1))})
    }
    for (let hull = 0; hull < 10_000; hull++) ring_of(hull)
    picture.draw()
    return picture.many.crowd.job != undefined && picture.many.crowd.front == undefined
}"""


@pytest.fixture(scope="module")
def fleet(client: HullClient) -> Iterator[None]:
    """Two hulls on the globe with a fence each, one of them with a long name, and an alarm that is raised for both."""
    for city, (lon, lat) in CITIES.items():
        hull = f"{FLEET}/{city}"
        client.create_hull(hull, keyed="str", geographic=True, center=(lon, lat))
        client.put(hull, [f"van-{n}" for n in range(40)], [(lon + n % 7 / 9, lat + n % 11 / 20) for n in range(40)])
        client.create_fence(hull, Circle(lon, lat, 20_000), hull)
    client.create_alarm(FLEET, prefix=f"{FLEET}/", when="area > 100 km2")
    yield
    client.delete_alarm(FLEET)


@contextmanager
def screen(browser: Browser, url: str, **look: object) -> Iterator[Page]:
    """The page with all of the fleet."""
    names = [f"{FLEET}/{city}" for city in CITIES]
    with opened(browser, url, *names, fences=names, **look) as page:
        page.wait_for_function("() => [...picture.hulls.values()].every(({corners}) => corners?.length)")
        expect(page.locator(".alarms tbody tr")).to_have_count(2)
        expect(page.locator(".events tbody tr").first).to_be_visible()
        yield page


def width_of_map(page: Page) -> float:
    width: float = page.evaluate("picture.element.clientWidth")
    return width


def test_the_map_takes_what_the_drawers_leave(browser: Browser, url: str) -> None:
    with screen(browser, url) as page:
        wide, high = 1440, 900
        assert page.evaluate("document.documentElement.scrollHeight") == high
        beside = width_of_map(page)
        assert beside > 0.65 * wide
        drawers = page.get_by_role("group", name="Drawers").get_by_role("button")
        expect(drawers).to_have_text(["Time lines", "Events", "Hulls", "Fences"])
        for drawer in drawers.all():
            expect(drawer).to_have_attribute("aria-expanded", "true")
            drawer.focus()
            drawer.press("Enter")
            expect(drawer).to_have_attribute("aria-expanded", "false")
        page.wait_for_function("before => picture.width > before && picture.frames", arg=beside)
        assert width_of_map(page) > 0.95 * wide
        # The link has it; and Escape in a drawer is as good as its button.
        page.reload()
        page.wait_for_function("wide => globalThis.picture?.width > wide", arg=0.95 * wide)
        events = page.get_by_role("button", name="Events")
        events.press(" ")
        page.get_by_role("region", name="List of events").press("Escape")
        expect(events).to_be_focused()
        expect(page.get_by_role("region", name="List of events")).to_be_hidden()


def test_nothing_overprints(browser: Browser, url: str) -> None:
    with screen(browser, url) as page:
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.evaluate(OVERPRINTED) == []
        page.set_viewport_size({"width": 1440, "height": 900})


def test_axe_finds_nothing(browser: Browser, url: str) -> None:
    script = axe()
    with screen(browser, url) as page:
        page.evaluate(script)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                assert page.evaluate(FINDINGS) == [], (width, scheme)
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1440, "height": 900})


def test_day_and_night_by_the_system_and_by_choice(browser: Browser, url: str) -> None:
    dark, light = "rgb(18, 22, 27)", "rgb(255, 255, 255)"
    paper = "getComputedStyle(document.body).backgroundColor"
    drawn = "picture.colours.paper"
    with screen(browser, url, color_scheme="light") as page:
        choice = page.get_by_label("Day or night")
        for look, colour in (("Night", dark), ("As the system", light), ("Night", dark)):
            choice.select_option(look)
            assert page.evaluate(paper) == colour
            page.wait_for_function(f"colour => {drawn} == colour", arg=colour)
        page.reload()
        page.wait_for_function(f"colour => globalThis.picture && {drawn} == colour", arg=dark)
        expect(choice).to_have_value("night")
        page.emulate_media(color_scheme="dark")
        choice.select_option("Day")
        assert page.evaluate(paper) == light


def test_lines_and_names_stand_out(browser: Browser, url: str) -> None:
    """The contrast of the colours of hulls, fences and time lines is 4.5 to 1 by day and by night: some are of text."""
    with screen(browser, url, color_scheme="light") as page:
        looks = "(await import(document.querySelector('script[src]').src.replace('page.js', 'looks.js')))"
        lit = looks.replace("looks.js", "dynhull/map/looks.js")
        shown = page.evaluate(f"""async () => {{
            const {{LOOKS, FENCE_LOOKS, MEAN}} = {looks}, {{ALARM_LOOK, lit}} = {lit}
            const shades = ({{colour}}) => [lit(colour, false), lit(colour, true)]
            return [...LOOKS, ...FENCE_LOOKS, MEAN, ALARM_LOOK].map(shades)
        }}""")
        for night, scheme in enumerate(("light", "dark")):
            page.emulate_media(color_scheme=scheme)
            grounds = page.evaluate("""() => ["paper", "sea", "raised"]
                .map(name => getComputedStyle(document.body).getPropertyValue(`--${name}`))""")
            for colours in shown:
                for ground in grounds:
                    assert page.evaluate(CONTRAST, [colours[night], ground]) >= 4.5, (colours[night], ground)
            coast, sea = page.evaluate("""() => ["coast", "sea"]
                .map(name => getComputedStyle(document.body).getPropertyValue(`--${name}`))""")
            assert page.evaluate(CONTRAST, [coast, sea]) >= 3


def test_the_picture_grows_with_the_screen(browser: Browser, url: str) -> None:
    """On a wall of 3,840 pixels, text and marks are twice as large; what is under the pointer is found there, too."""
    with screen(browser, url) as page:
        page.set_viewport_size({"width": 3840, "height": 2160})
        page.wait_for_function("() => picture.enlarged == 2 && 2 * picture.width == picture.element.clientWidth")
        corner = page.evaluate("picture.hulls.values().next().value.corners[0]")
        place = page.evaluate(
            """corner => {
                picture.draw()
                const {x, y} = picture.element.getBoundingClientRect(), [across, down] = picture.view.place(...corner)
                return [x + 2 * across, y + 2 * down]
            }""",
            corner,
        )
        page.mouse.move(*place)
        tip = page.get_by_role("tooltip")
        expect(tip).to_contain_text("van-0")
        box = tip.bounding_box()
        assert box is not None
        assert abs(box["x"] - place[0]) < box["width"] + 40
        page.set_viewport_size({"width": 1440, "height": 900})


def test_a_kiosk_turns_and_shows_alarms(browser: Browser, url: str, client: HullClient) -> None:
    other = "apart"
    for name in "ab":
        client.create_hull(f"{other}/{name}")
        client.apply(f"{other}/{name}", insert=[[0, 0], [4, 0], [4, 4]])
    with opened(browser, url, "none") as page:
        figures = page.get_by_role("region", name="Figures")
        shown = figures.locator(".what")
        page.goto(f"{url}/?kiosk=1&silent=3600&prefix={other}/&prefix={FLEET}/&sound=1")
        # While alarms are raised, only the prefix has its turn where they are.
        expect(figures.locator(".raised")).to_have_text("2")
        expect(shown).to_have_text(f"{FLEET}/*")
        expect(figures.locator(".moving")).to_have_text("2")
        expect(figures.locator(".silent")).to_have_text("0")
        expect(figures.locator(".clock")).to_have_text(re.compile(r"\w+, \w+ \d+, 20\d\d, \d\d:\d\d \S+"))
        for control in ("Pick hulls", "Pick fences", "Find a key", "Save what is shown", "Moment shown", "Zoom in"):
            expect(page.get_by_label(control, exact=True)).to_be_hidden()
        page.evaluate(axe())
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.documentElement.scrollHeight") <= height
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.evaluate(OVERPRINTED) == []
            for scheme in ("dark", "light"):
                page.emulate_media(color_scheme=scheme)
                assert page.evaluate(FINDINGS) == [], (width, scheme)
        page.set_viewport_size({"width": 1920, "height": 1080})
        raised = page.locator(".alarms tbody tr.raised")
        size = page.locator(".alarms h2").evaluate("each => parseFloat(getComputedStyle(each).fontSize)")
        assert size >= 60
        # On the map, too: a thick line in the colour of alarms, through the middle of an edge.
        page.wait_for_function("""() => picture.alarmed.length == 2 && picture.alarmed.every(name => {
            const [one, two] = picture.many.find(name).corners.map(corner => picture.view.place(...corner))
            const pixel = [0, 1].map(axis => Math.round((one[axis] + two[axis]) / 2 * picture.ratio))
            const copy = new OffscreenCanvas(1, 1).getContext("2d", {willReadFrequently: true})
            copy.drawImage(picture.canvases[1], -pixel[0], -pixel[1])
            const shade = copy.getImageData(0, 0, 1, 1).data.slice(0, 3)
            return picture.colours.alarm == `rgb(${shade.join(", ")})`
        })""")
        expect(raised.first.locator(".since")).to_have_text(re.compile(r"20\d\d, \d\d:\d\d:\d\d \S+"))
        page.mouse.click(10, 10)  # browsers let nothing sound before
        page.wait_for_function("() => sound.rung > 1")
        expect(page.locator(".silenced")).to_be_hidden()
        for left in (1, 0):
            raised.first.get_by_role("button", name="Acknowledge").click()
            expect(raised).to_have_count(left)
        expect(figures.locator(".raised")).to_have_text("0")
        assert all(status.acknowledged is not None for status in client.get_alarm(FLEET).statuses)
        # Nobody has to do anything: prefix by prefix.
        for prefix in (f"{other}/*", f"{FLEET}/*", f"{other}/*"):
            expect(shown).to_have_text(prefix)
        assert page.url.endswith("sound=1"), "the link stays as it was given"
        page.set_viewport_size({"width": 1440, "height": 900})


def test_a_crowd_is_painted_in_pieces_and_thinned(browser: Browser, url: str) -> None:
    with opened(browser, url, "none") as page:
        page.wait_for_function("() => picture.hulls.has('none')")  # the page has shown what it was asked for
        expect(page.locator(".alarms tbody tr")).to_have_count(2)  # later they would move the map below the pointer
        assert page.evaluate(CROWD), "it was painted at once, while whoever pointed at something waited"
        painted = "() => picture.many.crowd.front && !picture.many.crowd.job"
        page.evaluate("""() => {
            const draw = CanvasRenderingContext2D.prototype.lineTo
            globalThis.lines = 0
            CanvasRenderingContext2D.prototype.lineTo = function (...place) { lines++; draw.apply(this, place) }
        }""")
        page.wait_for_function(painted)
        crowd = page.evaluate("picture.many.hulls.length")
        far = page.evaluate("lines")
        assert crowd == 10_000
        assert far < 6 * crowd, "outlines of some pixels have few corners"
        pointed = """hull => {
            picture.draw()
            const {x, y} = picture.element.getBoundingClientRect(), {corners} = picture.many.hulls[hull]
            const [across, down] = picture.view.place(...corners[0])
            return [x + across, y + down]
        }"""
        tip = page.get_by_role("tooltip")
        for hull in (0, 5_050, 9_999):
            page.mouse.move(*page.evaluate(pointed, hull))
            expect(tip).to_contain_text(f"a vertex of crowd/{hull}")
        # What has moved is painted again, and found where it is.
        page.evaluate("() => ring_of(5_050, 1)")
        page.wait_for_function("() => !picture.many.crowd.dirty && !picture.many.crowd.job")
        page.mouse.move(*page.evaluate(pointed, 5_050))
        expect(tip).to_contain_text("revision 2")
        # From near all corners of the few that are to be seen.
        page.evaluate("() => { globalThis.far = picture.many.crowd.front; lines = 0 }")
        page.evaluate("() => picture.move(view => view.zoom(30, 400, 300))")
        # Once nothing moves, the painting from far is there until the next frame begins another one.
        page.wait_for_function("() => !picture.moving && picture.many.crowd.front != far && !picture.many.crowd.job")
        seen = page.evaluate(
            "new Set([...picture.many.crowd.front.cells.values(), picture.many.crowd.front.large].flat()).size"
        )
        assert 0 < seen < 100
        assert page.evaluate("lines") >= 23 * seen
