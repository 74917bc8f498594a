"""A real dashboard in a process of its own, and its page in a real browser."""

import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from urllib.parse import urlencode

from forked import COMMAND, Process
from patience import PATIENCE
from playwright.sync_api import Browser, Page, expect

DESKTOP = {"viewport": {"width": 1440, "height": 900}}
PATIENCE_OF_BROWSER = 1000 * PATIENCE  # milliseconds
expect.set_options(timeout=PATIENCE_OF_BROWSER)
LOUD = "warning", "error"
REFUSED = (
    "Failed to load resource:"  # what browsers say of each answer that is an error; the page says it in its own words
)
# What the page is made of, for tests of parts.
PARTS = """async () => {
    const folder = document.querySelector("script[type=module]").src.replace(/[^/]*$/, "")
    const names = [
        ...["views", "picture", "hulls", "trails", "coasts"].map(name => `dynhull/map/${name}`), "recorder", "degrees",
        "time_bar",
        ...["fence_area", "event_rows", "hull_state", "hull_feed", "server_lists", "server_metrics", "repeating"]
            .map(name => `sources/${name}`),
    ]
    const parts = await Promise.all(names.map(name => import(`${folder}${name}.js`)))
    Object.assign(globalThis, ...parts, {d3: await import("d3-geo")})
}"""
VERTICES = "name => picture.hulls.get(name)?.corners ?? []"


@contextmanager
def dashboard_process(address: str, *options: str) -> Iterator[str]:
    """`dynhull dashboard` on a free port, unless the options name one; yields its URL. It must exit with code 0."""
    command = [COMMAND, "dashboard", "--port", "0", "--address", address, *options]
    with (
        tempfile.TemporaryFile("w+") as errors,
        Process(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        try:
            first_line = process.stdout.readline()
            assert first_line.startswith("dynhull dashboard on http://")
            yield first_line.split()[-1]
        finally:
            process.terminate()
            assert process.wait(PATIENCE) == 0
            errors.seek(0)
            assert "Traceback" not in errors.read()  # pages may close at any time


@cache
def _idle(_: Browser) -> list[Page]:
    """Pages that show nothing. A page that is used again needs half of the processor time of a new one."""
    return []


@contextmanager
def opened(browser: Browser, url: str, *hulls: str, fences: Sequence[str] = (), **look: object) -> Iterator[Page]:
    """The page with these hulls and fences. It must not raise an error, nor log a warning to the browser's console."""
    failures: list[object] = []
    scheme = look.pop("color_scheme") if look.keys() == {"color_scheme"} else "light"
    idle = [] if look else _idle(browser)
    page = idle.pop() if idle else browser.new_context(**{**DESKTOP, **look}).new_page()
    listeners = {
        "pageerror": lambda error: failures.append(error),
        "console": lambda message: (
            failures.append(message.text) if message.type in LOUD and not message.text.startswith(REFUSED) else None
        ),
    }
    for event, listener in listeners.items():
        page.on(event, listener)
    page.set_default_timeout(PATIENCE_OF_BROWSER)
    page.mouse.move(0, 0)
    if not look:
        page.emulate_media(color_scheme=scheme)
    page.goto(f"{url}?{urlencode({'hull': hulls, 'fence': fences}, doseq=True)}")
    page.evaluate(PARTS)
    try:
        yield page
    finally:
        for event, listener in listeners.items():
            page.remove_listener(event, listener)
        if look:
            page.context.close()
        else:
            page.goto("about:blank")
            idle.append(page)
    assert failures == []


def wait_for_vertices(page: Page, name: str, vertices: list[list[float]]) -> None:
    """Wait until the page shows this polygon, in a picture that fills its place.

    With the table comes another size of the picture, but only with the next frame, a moment after the vertices.
    """
    shown = f"""([name, vertices]) => JSON.stringify(({VERTICES})(name)) == JSON.stringify(vertices)
        && picture.width == picture.element.clientWidth && picture.height == picture.element.clientHeight"""
    page.wait_for_function(shown, arg=[name, vertices])


def let_go(page: Page, name: str) -> None:
    """Press the button that removes a hull or a fence.

    In one step: between the press and the release of a pointer, the button moves if something above it goes.
    """
    page.get_by_role("button", name=f"Remove {name}", exact=True).dispatch_event("click")
