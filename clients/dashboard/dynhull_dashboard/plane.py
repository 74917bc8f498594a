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

from .feed import HullFeed
from .looks import Look
from .outline import Box, Outline, Points, frame_around
from .styles import bare, compact_ticks

FILL_ALPHA, POINT_ALPHA = 0.12, 0.65
VERTEX_SIZE, POINT_SIZE = 8, 4
TOOLTIPS = [("", "$name"), ("x", "@x{%.12g}"), ("y", "@y{%.12g}"), ("revision", "@revision")]


class DrawnHull:
    """One hull in the picture."""

    def __init__(self, plot: figure, feed: HullFeed, look: Look) -> None:
        self.feed = feed
        self._outline: Outline | None = None
        self._sample: object = None
        self._vertices, self._points = _source(), _source()
        name, colour = feed.name, look.colour
        surface = plot.patch(
            source=self._vertices,
            fill_color=colour,
            fill_alpha=FILL_ALPHA,
            line_color=colour,
            line_width=2,
            line_dash=look.dash,
        )
        self.markers = [
            plot.scatter(
                source=self._points, size=POINT_SIZE, color=colour, alpha=POINT_ALPHA, name=f"a point of {name}"
            ),
            plot.scatter(
                source=self._vertices, marker=look.marker, size=VERTEX_SIZE, color=colour, name=f"a vertex of {name}"
            ),
        ]
        self.renderers = [surface, *self.markers]

    def update(self) -> None:
        """Draw what is new."""
        outline, sample = self.feed.outline, self.feed.sample
        if outline is not self._outline:
            self._outline = outline
            self._vertices.data = _columns(outline.vertices, outline.revision)
        if sample is not None and sample is not self._sample:
            self._sample = sample
            self._points.data = _columns(sample.points, sample.revision)


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
        self._set_hover()

    def hide(self, name: str) -> None:
        """One hull fewer."""
        gone = self._drawn.pop(name)
        self._set_hover()
        self.plot.renderers = [each for each in self.plot.renderers if each not in gone.renderers]
        self._frame = None

    def update(self) -> None:
        """Draw what is new."""
        for drawn in self._drawn.values():
            drawn.update()
        boxes = [drawn.feed.outline.bounds for drawn in self._drawn.values()]
        frame = frame_around([box for box in boxes if box is not None], self._frame)
        if frame is not None and frame is not self._frame:
            self._frame = frame
            self._corners.data = {"x": [frame[0], frame[2]], "y": [frame[1], frame[3]]}

    def _set_hover(self) -> None:
        self._hover.renderers = [marker for drawn in self._drawn.values() for marker in drawn.markers]


def _source() -> ColumnDataSource:
    return ColumnDataSource({"x": [], "y": [], "revision": []})


def _columns(xy: Points, revision: int) -> dict[str, list[float] | list[int]]:
    return {"x": xy[:, 0].tolist(), "y": xy[:, 1].tolist(), "revision": [revision] * len(xy)}
