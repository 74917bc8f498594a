"""The page: its HTML with its styles and scripts, the same for all viewers."""

import base64
import hashlib
import json
import re
from html import escape
from pathlib import Path
from string import Template

from tornado.web import RequestHandler

from ..cards import key, symbol
from ..event_rows import MOST_EVENTS
from ..hub import Hub
from ..looks import FENCE_COLOUR, FENCE_LOOKS, INSIDE, LOOKS, MEAN, NEUTRAL, ON_DARK, PERCENTILE
from ..tiles import Tiles

HERE = Path(__file__).parent
# Libraries and maps of others, as published; their licences are in LICENSES.txt.
VENDOR = HERE.parent / "vendor"
# What draws, which the package for browsers has; of the source code, or beside the other scripts.
MAP = next(each for each in (HERE / "map", HERE.parents[2] / "typescript" / "src" / "map") if each.exists())
DRAWING = (
    "views.js",
    "coasts.js",
    "tiles.js",
    "boxes.js",
    "hulls.js",
    "many.js",
    "fences.js",
    "labels.js",
    "trails.js",
    "picture.js",
    "hands.js",
)
SCRIPTS = (
    "recorder.js",
    "time_bar.js",
    "time_lines.js",
    "events.js",
    "alarms.js",
    "saving.js",
    "page.js",
)


class PageHandler(RequestHandler):
    """Answers with the page."""

    def initialize(self, html: str, policy: str) -> None:
        """Tornado passes the application's arguments."""
        self._html = html
        self._policy = policy

    def get(self) -> None:
        """The page."""
        self.set_header("Cache-Control", "no-cache")
        self.set_header("Content-Security-Policy", self._policy)
        self.finish(self._html)

    def head(self) -> None:
        """Whether the page is there."""
        self.finish()


def page(hub: Hub, tiles: Tiles | None) -> tuple[str, str]:
    """The HTML, and its version."""
    units = hub.units
    area = "km²" if units.area == "km²" else f"{units.area}; km² on the globe" if units.known else "km² on the globe"
    settings = {
        "address": hub.address,
        "x_unit": units.x,
        "y_unit": units.y,
        "area_unit": area,
        "with_metrics": "true" if hub.metrics is not None else "",
        "most_hulls": len(LOOKS),
        "most_fences": len(FENCE_LOOKS),
        "most_events": MOST_EVENTS,
        "fence_colour": FENCE_COLOUR,
        "neutral": NEUTRAL,
        "on_dark": json.dumps(ON_DARK),
        "percentile_dash": " ".join(map(str, PERCENTILE.dash)),
        "tiles": tiles.url if tiles else "",
        "largest_zoom": tiles.largest_zoom if tiles else 0,
        "attribution": tiles.attribution if tiles else "",
    }
    texts = {name: escape(str(value)) for name, value in settings.items()}
    pictures = {"inside": symbol(INSIDE), "mean": key(MEAN), "percentile": key(PERCENTILE)}
    parts = {
        "styles": _read("page.css") + _dark_symbols(),
        "scripts": "".join([*map(_drawing, DRAWING), *map(_read, SCRIPTS)]),
    }
    content = "".join([_read("page.html"), *parts.values(), *texts.values()])
    version = hashlib.sha256(content.encode()).hexdigest()[:16]
    return Template(_read("page.html")).substitute(texts, **pictures, **parts, version=version), version


def policy(html: str, tiles: Tiles | None) -> str:
    """The Content-Security-Policy of the page: nothing but its own, and pictures from the server of the tiles."""
    hashes = {element: _hash(html, element) for element in ("script", "style")}
    pictures = f" {tiles.origin}" if tiles else ""
    return (
        f"default-src 'none'; script-src 'self' '{hashes['script']}'; style-src '{hashes['style']}'; "
        f"img-src data:{pictures}; connect-src 'self'; base-uri 'none'; form-action 'none'"
    )


def _hash(html: str, element: str) -> str:
    """Names the content of an element of the page, as a policy does."""
    (content,) = re.findall(f"<{element}>(.*?)</{element}>", html, re.DOTALL)
    return "sha256-" + base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()


def _dark_symbols() -> str:
    """The colours of symbols on the dark page as CSS."""
    rules = "".join(
        f'  [fill="{colour}"] {{ fill: {lighter}; }} [stroke="{colour}"] {{ stroke: {lighter}; }}\n'
        for colour, lighter in ON_DARK.items()
    )
    return f"@media (prefers-color-scheme: dark) {{\n{rules}}}\n"


def _drawing(name: str) -> str:
    """A module as a part of the one script of the page: there is nothing to import or export."""
    return re.sub("^(import .*\n|export )", "", (MAP / name).read_text("utf-8"), flags=re.MULTILINE)


def _read(name: str) -> str:
    return (HERE / name).read_text("utf-8")
