"""What one viewer sees."""

import time
from dataclasses import dataclass
from html import escape
from pathlib import Path

from bokeh.document import Document
from bokeh.models.widgets import Button, Div, MultiChoice
from jinja2 import Template

from . import cards
from .feed import HullFeed
from .hub import Hub
from .looks import LOOKS, Look
from .plane import Plane
from .timelines import Lines, time_plots

TICK_MILLISECONDS = 100
# Words and figures change slower than the hulls: nobody reads ten a second.
TICKS_OF_TEXT = 5
TEMPLATE = Template(Path(__file__).with_name("page.html").read_text("utf-8"))
STYLE = Path(__file__).with_name("widgets.css").read_text("utf-8")
ALARM: dict[str, str | None] = {
    "color": "var(--alarm-ink)",
    "background": "var(--alarm)",
    "border-radius": "6px",
    "padding": ".6rem .9rem",
}

HULL_COLUMNS = ("points", "vertices", "area", "rate")
SERVER_LOOKS = {"updates": LOOKS[0], "mean": LOOKS[0], "percentile": LOOKS[1]}


@dataclass(frozen=True, slots=True)
class Shown:
    """A hull on the page."""

    feed: HullFeed
    look: Look
    lines: Lines


class Page:
    """The models of one document, and what keeps them up to date.

    Args:
        document: where they go.
        hub: where the hulls come from.
        picked: the hulls to begin with; the largest where there are none.
    """

    def __init__(self, document: Document, hub: Hub, picked: list[str]) -> None:
        self._hub = hub
        self._shown: dict[str, Shown] = {}
        self._ticks = 0
        self._models = document.models
        picked = (picked or hub.server.largest())[: len(LOOKS)]
        self._untouched = not picked
        self._banner = Div(name="banner", visible=False, stylesheets=[STYLE], styles=ALARM, sizing_mode="stretch_width")
        self._picker = MultiChoice(
            name="picker",
            placeholder="Pick hulls",
            max_items=len(LOOKS),
            value=picked,
            stylesheets=[STYLE],
            sizing_mode="stretch_width",
        )
        self._verify = Button(name="verify", label="Verify now", stylesheets=[STYLE])
        self._table = Div(name="table", stylesheets=[STYLE], sizing_mode="stretch_width")
        self._plane = Plane()
        self._plots = time_plots(*HULL_COLUMNS, *(["updates", "delay"] if hub.metrics else []))
        self._server_lines: Lines | None = None
        if hub.metrics:
            plots = {**self._plots, "mean": self._plots["delay"], "percentile": self._plots["delay"]}
            self._server_lines = Lines(hub.metrics.history, "whole server", plots, SERVER_LOOKS)
        self._picker.on_change("value", self._picked)
        self._verify.on_click(self._verify_now)
        self._pick(picked)
        self._tick()
        self._picker.options = [*self._picker.tags]
        document.title = "dynhull"
        document.template = TEMPLATE
        document.template_variables.update(address=hub.address, with_metrics=hub.metrics is not None)
        document.config.notify_connection_status = False  # the page's own banner does
        with self._models.freeze():  # it looks through all of them whenever one comes or goes
            for root in (
                self._banner,
                self._picker,
                self._verify,
                self._table,
                self._plane.plot,
                *self._plots.values(),
            ):
                document.add_root(root)
        document.add_periodic_callback(self._tick, TICK_MILLISECONDS)
        document.on_session_destroyed(lambda _context: self._pick([]))

    def _picked(self, _attribute: str, _old: list[str], new: list[str]) -> None:
        self._untouched = False
        with self._models.freeze():
            self._pick(new)

    def _pick(self, names: list[str]) -> None:
        for name in self._shown.keys() - set(names):
            self._shown.pop(name).lines.remove()
            self._plane.hide(name)
            self._hub.look_away(name)
        for name in names:
            if name not in self._shown:
                taken = [shown.look for shown in self._shown.values()]
                look = next(look for look in LOOKS if look not in taken)
                feed = self._hub.look(name)
                lines = Lines(feed.history, name, self._plots, dict.fromkeys(HULL_COLUMNS, look))
                self._shown[name] = Shown(feed, look, lines)
                self._plane.show(feed, look)

    def _verify_now(self) -> None:
        for shown in self._shown.values():
            shown.feed.verify_now()

    def _tick(self) -> None:
        self._plane.update()
        if self._ticks % TICKS_OF_TEXT == 0:
            self._tell()
        self._ticks += 1

    def _tell(self) -> None:
        """Words, figures and time lines."""
        server = self._hub.server
        hulls = sorted({*server.hulls, *self._picker.value})
        if hulls != self._picker.tags:
            self._picker.tags = hulls  # the page makes options of them when nobody is picking
        if self._untouched and server.hulls:
            self._picker.update(options=[*hulls], value=server.largest())
        self._table.text = cards.table(
            ((shown.feed, shown.look) for shown in self._shown.values()), connected=server.trouble is None
        )
        for shown in self._shown.values():
            shown.lines.update()
        if self._server_lines:
            self._server_lines.update()
        self._banner.visible = server.trouble is not None
        if server.trouble is not None:
            silent = time.monotonic() - server.since
            self._banner.text = (
                f"<b>No connection to {escape(self._hub.address)}</b> for {silent:.0f} s: {escape(server.trouble)}. "
                "What you see is the last that was told. Trying again."
            )
