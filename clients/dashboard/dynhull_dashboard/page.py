"""The page of one viewer."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from bokeh.application.application import SessionContext
from bokeh.document import Document
from bokeh.models.widgets import Button, Div
from jinja2 import Template

from .advice import about_fences, about_metrics, about_picture, about_server
from .cards import key, symbol, table
from .describe import describe, describe_key
from .event_rows import MOST_EVENTS
from .feed import HullFeed
from .fence_picks import FencePicks
from .hub import Hub
from .looks import FENCE_LOOKS, INSIDE, LOOKS, MEAN, PERCENTILE, Look
from .page_model import PageModel
from .plane import Plane
from .timelines import Lines, time_plots

TICK_MILLISECONDS = 100
# Text changes slower than the picture: nobody reads ten times a second.
TICKS_OF_TEXT = 5


def _read(name: str) -> str:
    return Path(__file__).with_name(name).read_text("utf-8")


TEMPLATE = Template(_read("page.html"))
STYLE = _read("widgets.css")
SCRIPTS = "".join(map(_read, ("labels.js", "fences.js", "events.js", "page.js")))

HULL_COLUMNS = ("points", "vertices", "area", "rate")
MOST_LABELS = 24  # vertices with a name beside them; of more, hovering shows the name
SERVER_LOOKS = {"updates": MEAN, "mean": MEAN, "percentile": PERCENTILE}


@dataclass(frozen=True, slots=True)
class Shown:
    """A hull on the page."""

    feed: HullFeed
    look: Look
    lines: Lines


class Page:
    """The models of one document, and their updates.

    Args:
        document: the document to fill.
        hub: the source of the hulls.
        picked: the hulls to begin with; if empty, those of the fences, or the largest one.
        fences: the fences to begin with; if empty, the first ones of these hulls.
        sought: the key to look for to begin with; empty for none.
    """

    def __init__(self, document: Document, hub: Hub, picked: list[str], fences: list[str], sought: str) -> None:
        self._hub = hub
        self._shown: dict[str, Shown] = {}
        self._ticks = 0
        self._sought = sought
        self._models = document.models
        same_scale = hub.units.same
        self._model = PageModel(name="page", same_scale=same_scale, sought=sought)
        self._verify = Button(name="verify", label="Verify now", stylesheets=[STYLE])
        self._table = Div(name="table", stylesheets=[STYLE], sizing_mode="stretch_width")
        self._fence_table = Div(name="fence_table", stylesheets=[STYLE], sizing_mode="stretch_width")
        self._plane = Plane(hub.units, same_scale)
        self._fences = FencePicks(hub, self._plane, self._fence_table, fences)
        self._plots = time_plots(*HULL_COLUMNS, *(["updates", "delay"] if hub.metrics else []))
        self._server_lines: Lines | None = None
        if hub.metrics:
            plots = {**self._plots, "mean": self._plots["delay"], "percentile": self._plots["delay"]}
            self._server_lines = Lines(hub.metrics.history, "whole server", plots, SERVER_LOOKS)
        self._untouched = not (picked or fences)
        self._show(picked if picked or fences else hub.server.largest())
        self._show_fences(fences)
        self._model.on_change("picked", self._picked)
        self._model.on_change("picked_fences", self._picked_fences)
        self._model.on_change("same_scale", lambda _attribute, _old, new: self._plane.set_same_scale(new))
        self._model.on_change("sought", self._seek)
        self._verify.on_click(self._verify_now)
        self._tick()
        document.title = "dynhull"
        document.template = TEMPLATE
        document.template_variables.update(
            address=hub.address,
            with_metrics=hub.metrics is not None,
            area_unit=hub.units.area,
            most_hulls=len(LOOKS),
            most_fences=len(FENCE_LOOKS),
            most_events=MOST_EVENTS,
            inside=symbol(INSIDE),
            most_labels=MOST_LABELS,
            mean=key(MEAN),
            percentile=key(PERCENTILE),
            scripts=SCRIPTS,
        )
        document.config.notify_connection_status = False  # the page has a banner of its own
        with self._models.freeze():  # otherwise Bokeh walks all models at each change
            for root in (
                self._model,
                self._verify,
                self._table,
                self._fence_table,
                self._plane.plot,
                *self._plots.values(),
            ):
                document.add_root(root)
        document.add_periodic_callback(self._tick, TICK_MILLISECONDS)
        document.on_session_destroyed(self._end)

    def _end(self, _context: SessionContext) -> None:
        for name in self._shown:
            self._hub.hulls.release(name)
        self._fences.close()

    def _picked(self, _attribute: str, _old: list[str], new: list[str]) -> None:
        if new != list(self._shown):
            self._untouched = False
            self._show(new)

    def _picked_fences(self, _attribute: str, _old: list[str], new: list[str]) -> None:
        if new != self._fences.names:
            self._fences.untouched = False
            self._show_fences(new)

    def _show_fences(self, picked: Iterable[str]) -> None:
        with self._models.freeze():
            self._fences.show(picked)
        self._model.update(legend_fences=self._fences.legend, picked_fences=self._fences.names)

    def _show(self, picked: Iterable[str]) -> None:
        names = list(dict.fromkeys(picked))[: len(LOOKS)]
        with self._models.freeze():
            for name in self._shown.keys() - set(names):
                self._shown.pop(name).lines.remove()
                self._plane.hide(name)
                self._hub.hulls.release(name)
            for name in names:
                if name not in self._shown:
                    self._add(name)
        legend = [[name, key(shown.look)] for name, shown in self._shown.items()]
        self._model.update(legend=legend, picked=list(self._shown))

    def _add(self, name: str) -> None:
        taken = [shown.look for shown in self._shown.values()]
        look = next(look for look in LOOKS if look not in taken)
        feed = self._hub.hulls.open(name)
        lines = Lines(feed.history, name, self._plots, dict.fromkeys(HULL_COLUMNS, look))
        self._shown[name] = Shown(feed, look, lines)
        self._plane.show(feed, look)

    def _verify_now(self) -> None:
        for shown in self._shown.values():
            shown.feed.verify_now()

    def _tick(self) -> None:
        self._plane.update()
        self._find()
        if self._ticks % TICKS_OF_TEXT == 0:
            self._update_text()
        self._ticks += 1

    def _seek(self, _attribute: str, _old: str, new: str) -> None:
        self._sought = new
        self._find()

    def _find(self) -> None:
        """Show where the key is that the viewer looks for."""
        key = self._sought
        sightings = [(shown.feed.search.find(key), shown) for shown in self._shown.values()] if key else []
        self._plane.mark(key, [(sighting, shown.look) for sighting, shown in sightings])
        self._model.update(found=[describe_key(key, shown.feed, sighting) for sighting, shown in sightings])

    def _choose(self) -> None:
        """Show what belongs to the viewer's choice, and something where there is none."""
        if self._untouched and not self._shown:
            self._show(self._hub.server.largest())
        if self._fences.untouched and not self._fences.names and (fences := self._fences.some(self._shown)):
            self._show_fences(fences)
        hulls = self._fences.new_hulls()
        if hulls and (self._untouched or not self._fences.untouched):
            self._show([*self._shown, *hulls])

    def _update_text(self) -> None:
        """Update the text, the figures and the time lines."""
        self._choose()
        server, fences = self._hub.server, self._hub.fence_list
        feeds = [shown.feed for shown in self._shown.values()]
        self._model.update(
            offered=sorted(server.hulls),
            offered_fences=sorted(fences.fences),
            banner=about_server(self._hub.address, server.error) if server.error else about_metrics(self._hub.metrics),
            note=about_picture(self._hub.address, server, feeds, self._fences.feeds),
            fence_hint=about_fences(self._hub.address, fences, shown=bool(self._fences.names)),
            description=describe(feeds, self._fences.feeds),
        )
        self._table.text = table(
            ((shown.feed, shown.look) for shown in self._shown.values()),
            connected=server.error is None,
            area_unit=self._hub.units.area,
        )
        self._fences.update(self._shown, connected=server.error is None)
        for shown in self._shown.values():
            shown.lines.update()
        if self._server_lines:
            self._server_lines.update()
