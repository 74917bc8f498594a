"""The picture of the hulls, to one scale in x and y."""

from bokeh.models import (
    BoxZoomTool,
    ColumnDataSource,
    DataRange1d,
    HoverTool,
    PanTool,
    ResetTool,
    SaveTool,
    WheelZoomTool,
)
from bokeh.plotting import figure

from .drawing import points_of, vertices_of
from .feed import HullFeed
from .looks import Look
from .outline import Box, frame_around
from .styles import bare, compact_ticks

FILL_ALPHA, POINT_ALPHA = 0.12, 0.65
VERTEX_SIZE, POINT_SIZE = 8, 4
TOOLTIPS = [("", "$name"), ("x", "@x{%.12g}"), ("y", "@y{%.12g}"), ("revision", "@revision")]


class DrawnHull:
    """One hull in the picture. What is in its sources comes from a `HullSocket`."""

    def __init__(self, plot: figure, feed: HullFeed, look: Look) -> None:
        self.feed = feed
        name, colour = feed.name, look.colour
        vertices, points = _source(vertices_of(name)), _source(points_of(name))
        surface = plot.patch(
            source=vertices,
            fill_color=colour,
            fill_alpha=FILL_ALPHA,
            line_color=colour,
            line_width=2,
            line_dash=look.dash,
        )
        self.markers = [
            plot.scatter(
                source=points,
                size=POINT_SIZE,
                color=colour,
                alpha=POINT_ALPHA,
                level="underlay",
                name=f"a point of {name}",
            ),
            plot.scatter(
                source=vertices, marker=look.marker, size=VERTEX_SIZE, color=colour, name=f"a vertex of {name}"
            ),
        ]
        self.renderers = [surface, *self.markers]


class Plane:
    """The plot, and the hulls in it."""

    def __init__(self) -> None:
        self._frame: Box | None = None
        self._drawn: dict[str, DrawnHull] = {}
        self._hover = HoverTool(renderers=[], tooltips=TOOLTIPS, formatters={"@x": "printf", "@y": "printf"})
        zoom = WheelZoomTool()
        x, y = DataRange1d(range_padding=0), DataRange1d(range_padding=0)
        self.plot = figure(
            name="plane",
            match_aspect=True,
            sizing_mode="stretch_both",
            x_range=x,
            y_range=y,
            tools=[PanTool(), zoom, BoxZoomTool(match_aspect=True), ResetTool(), SaveTool(), self._hover],
            active_scroll=zoom,
            toolbar_location="above",
        )
        bare(self.plot)
        self.plot.xaxis.formatter = compact_ticks()
        self.plot.yaxis.formatter = compact_ticks()
        # The ranges follow these two corners alone: they move seldom, the hulls often.
        self._corners = ColumnDataSource({"x": [], "y": []})
        corners = self.plot.scatter(source=self._corners, alpha=0)
        x.renderers = [corners]
        y.renderers = [corners]

    def show(self, feed: HullFeed, look: Look) -> None:
        """One hull more."""
        self._drawn[feed.name] = DrawnHull(self.plot, feed, look)
        self._tell_page()

    def hide(self, name: str) -> None:
        """One hull fewer."""
        gone = self._drawn.pop(name)
        self._tell_page()
        self.plot.renderers = [each for each in self.plot.renderers if each not in gone.renderers]
        self._frame = None

    def update(self) -> None:
        """Frame what there is now."""
        boxes = [drawn.feed.bounds for drawn in self._drawn.values()]
        frame = frame_around([box for box in boxes if box is not None], self._frame)
        if frame is not None and frame is not self._frame:
            self._frame = frame
            self._corners.data = {"x": [frame[0], frame[2]], "y": [frame[1], frame[3]]}

    def _tell_page(self) -> None:
        self._hover.renderers = [marker for drawn in self._drawn.values() for marker in drawn.markers]
        self.plot.tags = list(self._drawn)  # the page asks for the hulls named here


def _source(name: str) -> ColumnDataSource:
    """Not synced: what the socket brings must not travel back."""
    return ColumnDataSource({"x": [], "y": [], "revision": []}, name=name, syncable=False)
