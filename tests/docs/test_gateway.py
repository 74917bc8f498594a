"""The pages about the gateway: their commands and the page of HTML, run as a reader would run them."""

import functools
import html
import json
import re
import shlex
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from chromium import chromium
from command_line import dynhull
from gateway_process import Events, gateway_process
from patience import PATIENCE
from peers import program
from playwright.sync_api import expect
from server_process import server_process

ADDRESS = "http://127.0.0.1:8080"
ORIGIN = "http://127.0.0.1:8000"


def text_of(site: Path, page: str) -> str:
    """A page without its markup."""
    return html.unescape(re.sub(r"<[^>]+>", "", (site / "how-to" / page / "index.html").read_text()))


def commands(site: Path, page: str, first: str) -> list[str]:
    """The lines of a page that begin so, in order."""
    return [line for line in text_of(site, page).splitlines() if re.match(first, line)]


def lasting(answer: str) -> Any:
    """An answer, without what differs from day to day."""

    def kept(value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        return {name: kept(each) for name, each in value.items() if name not in ("created", "changed", "uid")}

    return kept(json.loads(answer))


def shell(command: str, folder: Path) -> str:
    done = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, check=True, timeout=PATIENCE)
    return done.stdout


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The folder over HTTP, as `python3 -m http.server` serves it."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            return

    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


@pytest.mark.long
def test_a_page_that_follows_a_hull(take_program: Callable[[str, str], Path], site: Path, tmp_path: Path) -> None:
    page = take_program("how-to/browser", "index.html")
    create, put, upload, show, wrong, more, fence = commands(site, "browser", "(curl(?! -N)|printf) ")
    follow, follow_many, follow_fence = (
        line.split()[-1].strip("'") for line in commands(site, "browser", r"curl -N (?!.* -d ).*http")
    )
    (join,) = commands(site, "browser", "curl -N .* -d ")
    answers = iter(commands(site, "browser", r'\{"\w+":\S.*\}$'))
    assert commands(site, "browser", "dynhull gateway") == [f"dynhull gateway --origin {ORIGIN}"]
    with (
        server_process() as server,
        served(tmp_path) as origin,
        gateway_process(server.address, "--origin", origin) as gateway,
        chromium() as browser,
    ):
        for each in (create, put, upload, show, wrong):
            assert lasting(shell(each.replace(ADDRESS, gateway.url), tmp_path)) == lasting(next(answers))
        assert '"repeated":2' in shell(upload.replace(ADDRESS, gateway.url), tmp_path)
        events = Events(gateway, follow.removeprefix(ADDRESS))
        assert events.next()[0] == "snapshot"
        (tmp_path / "index.html").write_text(page.read_text().replace(ADDRESS, gateway.url))
        shown = browser.new_page()
        shown.goto(origin)
        state = shown.locator("#state")
        expect(state).to_have_text("revision 2: 3 vertices", timeout=PATIENCE * 1000)
        shell(more.replace(ADDRESS, gateway.url), tmp_path)
        expect(state).to_have_text("revision 3: 4 vertices", timeout=PATIENCE * 1000)
        kind, data = events.next()
        assert kind == "change"
        assert lasting(json.dumps(data)) == lasting(
            commands(site, "browser", "data: .*removed")[0].removeprefix("data: ")
        )
        events.close()
        events = Events(gateway, follow_many.removeprefix(ADDRESS))
        assert [events.next()[0] for _ in range(3)] == ["begin", "hulls", "complete"]
        events.close()
        shell(fence.replace(ADDRESS, gateway.url), tmp_path)
        events = Events(gateway, follow_fence.removeprefix(ADDRESS))
        place = events.next()[0]  # an id alone
        inside = events.next()[1]["inside"]
        assert inside == [{"hull": "browser", "keys": ["a", "d"], "revision": 3}]
        assert str(inside).replace("'", '"').replace(" ", "") in text_of(site, "browser")
        events.close()
        events = Events(gateway, "/streams", json.loads(shlex.split(join)[-1]))
        assert events.next()[0] == "stream"
        assert {events.next()[0], events.next()[0], events.next()[0]} == {"snapshot", f"depot {place}"}
        events.close()
        assert shown.locator("polygon").get_attribute("points") == "0,0 4,0 4,3 2,4"


@pytest.mark.long
def test_a_live_hull_on_a_map(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program("ogrinfo")
    with server_process() as server, gateway_process(server.address) as gateway:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        for line in commands(site, "qgis", "dynhull (create|put)"):
            done = dynhull(*line.split()[1:])
            assert done.exit_code == 0, done.stderr
        listed, read, written = commands(site, "qgis", "ogr")
        text = text_of(site, "qgis")
        for each in (listed, read):
            for line in shell(each.replace(ADDRESS, gateway.url), tmp_path).replace(gateway.url, ADDRESS).splitlines():
                assert line in text
        shell(written.replace(ADDRESS, gateway.url), tmp_path)
        assert "Feature Count: 3" in shell("ogrinfo -al -so ships.gpkg", tmp_path)
        (boxed,) = commands(site, "qgis", "curl")
        assert '"numberMatched":2' in shell(boxed.replace(ADDRESS, gateway.url), tmp_path)
