"""The page: its HTML with its styles and scripts, the same for all viewers."""

import hashlib
from html import escape
from pathlib import Path
from string import Template

from tornado.web import RequestHandler

from ..cards import key, symbol
from ..event_rows import MOST_EVENTS
from ..hub import Hub
from ..looks import FENCE_COLOUR, FENCE_LOOKS, INSIDE, LOOKS, MEAN, NEUTRAL, PERCENTILE

HERE = Path(__file__).parent
# Libraries and maps of others, as published; their licences are in LICENSES.txt.
VENDOR = HERE.parent / "vendor"
SCRIPTS = (
    "views.js",
    "coasts.js",
    "boxes.js",
    "hulls.js",
    "fences.js",
    "labels.js",
    "trails.js",
    "picture.js",
    "hands.js",
    "recorder.js",
    "time_lines.js",
    "events.js",
    "page.js",
)


class PageHandler(RequestHandler):
    """Answers with the page."""

    def initialize(self, html: str) -> None:
        """Tornado passes the application's arguments."""
        self._html = html

    def get(self) -> None:
        """The page."""
        self.set_header("Cache-Control", "no-cache")
        self.finish(self._html)

    def head(self) -> None:
        """Whether the page is there."""
        self.finish()


def page(hub: Hub) -> tuple[str, str]:
    """The HTML, and its version."""
    units = hub.units
    area = units.area if units.area == "km²" else f"{units.area}; km² on the globe"
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
        "percentile_dash": " ".join(map(str, PERCENTILE.dash)),
    }
    texts = {name: escape(str(value)) for name, value in settings.items()}
    pictures = {"inside": symbol(INSIDE), "mean": key(MEAN), "percentile": key(PERCENTILE)}
    parts = {"styles": _read("page.css"), "scripts": "".join(map(_read, SCRIPTS))}
    version = hashlib.sha256((_read("page.html") + "".join(parts.values())).encode()).hexdigest()[:16]
    return Template(_read("page.html")).substitute(texts, **pictures, **parts, version=version), version


def _read(name: str) -> str:
    return (HERE / name).read_text("utf-8")
