"""A map of another server under hulls on the globe, in a real browser."""

import io
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from command_line import dynhull
from dashboard_process import dashboard_process, opened
from patience import PATIENCE
from PIL import Image
from playwright.sync_api import Browser, Page, expect

from dynhull_client import HullClient
from dynhull_gateway.tiles import Tiles

pytestmark = pytest.mark.long  # first, so that one worker, and one browser, has all of them
ATTRIBUTION = "© <nobody>"
PIXELS, FIELD = 256, 10  # of a tile, and the degrees of a field of the chessboard that is on the map


def is_red(lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
    return (np.floor(lon / FIELD) + np.floor(lat / FIELD)) % 2 == 0


class TileServer(ThreadingHTTPServer):
    """A chessboard of degrees, as tiles of the Web Mercator projection."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Answer)
        self.origin = f"http://127.0.0.1:{self.server_address[1]}"
        self.broken = False
        self.asked: list[str] = []

    def tile(self, path: str) -> bytes:
        self.asked.append(path)
        zoom, column, row = map(int, path.removeprefix("/t/").removesuffix(".png").split("/"))
        assert 0 <= column < 2**zoom
        assert 0 <= row < 2**zoom
        if self.broken:
            return b"no picture"
        part = (np.arange(PIXELS) + 0.5) / PIXELS
        lon = (column + part) / 2**zoom * 360 - 180
        lat = np.degrees(np.arctan(np.sinh(np.pi * (1 - 2 * (row + part) / 2**zoom))))
        red = is_red(*np.meshgrid(lon, lat))[..., None]
        content = io.BytesIO()
        Image.fromarray(np.where(red, [255, 0, 0], [0, 0, 255]).astype(np.uint8)).save(content, "PNG")
        return content.getvalue()


class Answer(BaseHTTPRequestHandler):
    server: TileServer

    def do_GET(self) -> None:
        content = self.server.tile(self.path)
        self.send_response(200)
        self.send_header("Content-Type", "image/png")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def serving(server: TileServer) -> Iterator[TileServer]:
    with server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def wait_for_tiles(page: Page) -> None:
    """Wait until all pictures have come and are drawn, and the picture is at rest."""
    page.wait_for_function(
        """() => {
            const {tiles, moving, view, frames} = picture
            const settled = tiles.pictures.size && [...tiles.pictures.values()].every(each => each.naturalWidth)
            if (!view.globe || !settled || moving) return false
            window.settled ??= frames
            return frames > window.settled || void picture.draw_all()
        }"""
    )
    page.evaluate("() => { window.settled = undefined }")


def wrong_places(page: Page) -> tuple[int, int]:
    """How many places in the picture have another colour than the map has there, and of how many."""
    drawn = np.asarray(Image.open(io.BytesIO(page.locator(".map").screenshot())).convert("RGB"), np.int16)
    places = page.evaluate(
        """() => {
            const {view, element: {clientWidth, clientHeight}} = picture, found = []
            for (let across = 5.5; across < clientWidth - 60; across += 17)
                for (let down = 5.5; down < clientHeight - 40; down += 17) {
                    const place = view.invert(across, down), [back] = view.place(...place)
                    if (Math.abs(back - across) < 0.01 && d3.geoDistance(place, view.middle) < 1 && place[1] < 85)
                        found.push([across, down, ...place])
                }
            return found
        }"""
    )
    across, down, lon, lat = np.array(places).T
    within = np.minimum(np.abs(lon / FIELD - np.round(lon / FIELD)), np.abs(lat / FIELD - np.round(lat / FIELD))) > 0.15
    pixels = drawn[down.astype(int), across.astype(int)][within]
    red = is_red(lon, lat)[within]
    return int(np.sum((pixels[:, 0] > pixels[:, 2]) != red)), len(red)


def test_a_map_is_where_it_belongs(browser: Browser, address: str, name: str) -> None:
    with HullClient(address) as client, serving(TileServer()) as tiles:
        client.create_hull(name, geographic=True, center=(170, 60))
        client.apply(name, insert=[[150, 50], [-170, 50], [-170, 70], [150, 70]])
        url = f"{tiles.origin}/t/{{z}}/{{x}}/{{y}}.png"
        with (
            dashboard_process(address, "--tiles", url, "--tiles-attribution", ATTRIBUTION) as page_url,
            opened(browser, page_url, name, color_scheme="light") as page,
        ):
            expect(page.get_by_role("note")).to_have_text(ATTRIBUTION)
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                wait_for_tiles(page)
                wrong, count = wrong_places(page)
                assert count > 200, scheme
                assert wrong <= count // 50, scheme  # under lines
                for _ in range(3):
                    page.get_by_role("application").press("-")
            with urllib.request.urlopen(page_url, timeout=PATIENCE) as answer:
                policy = answer.headers["Content-Security-Policy"]
            assert f"img-src data: {tiles.origin};" in policy
            assert len(tiles.asked) == len(set(tiles.asked))
            tiles.broken = True
            page.get_by_role("button", name="Show all").click()
            page.get_by_role("application").press("ArrowLeft")
            for _ in range(4):
                page.get_by_role("application").press("+")
            expect(page.get_by_role("note")).to_have_text(f"No map from {tiles.origin.removeprefix('http://')}")


@pytest.mark.parametrize(
    ("url", "problem"),
    [
        ("ftp://tiles.example/{z}/{x}/{y}.png", "expected http"),
        ("//tiles.example/{z}/{x}/{y}.png", "expected http"),
        ("https://{x}.tiles.example/{z}/{x}/{y}.png", "expected http"),
        ("https://a:b@tiles.example/{z}/{x}/{y}.png", "expected http"),
        ("https://tiles.example:65536/{z}/{x}/{y}.png", "expected http"),
        ("https://tiles.example/{z}/{x}/{y}.png; script-src *", "expected http"),
        ("https://tiles.example/\n{z}/{x}/{y}.png", "expected http"),
        ("https://tiles.example/{z}/{x}.png", "expected each of"),
        ("https://tiles.example/{z}/{x}/{y}/{y}.png", "expected each of"),
        ("https://tiles.example/{z}/{x}/{y}{r}.png", "expected each of"),
    ],
)
def test_what_is_no_url_of_tiles_is_an_error(url: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Tiles(url)


def test_a_url_without_tiles_ends_the_command() -> None:
    ended = dynhull("dashboard", "--port", "0", "--tiles", "https://tiles.example")
    assert (ended.exit_code, "--tiles is 'https://tiles.example': expected" in ended.stderr) == (2, True)
