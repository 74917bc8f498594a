"""The picture of the hulls and the fences."""

from collections.abc import Iterable, Sequence

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

from .drawing import outline_of, points_of, vertices_of
from .feed import HullFeed
from .fence_feed import FenceFeed
from .fence_plane import DrawnFence, add_fence_names
from .looks import Look
from .outline import Box, frame_around
from .rings import Rings
from .search import Sighting
from .styles import LABEL_WIDTH, bare, compact_ticks
from .units import Units, axis_label

FILL_ALPHA, POINT_ALPHA = 0.12, 0.65
AXIS_LABEL_HEIGHT = 24
VERTEX_SIZE, POINT_SIZE = 8, 4
EMPTY_FRAME: Box = (0.0, 0.0, 1.0, 1.0)
PLACE = [("x", "@x{%.12g}"), ("y", "@y{%.12g}")]
TOOLTIPS = [("", "@title$name"), *PLACE, ("revision", "@revision")]
INSIDE_TOOLTIPS = [("", "@title$name"), *PLACE]


class DrawnHull:
    """One hull in the picture. A `HullSocket` fills its data sources."""

    def __init__(self, plot: figure, feed: HullFeed, look: Look) -> None:
        self.feed = feed
        name, colour = feed.name, look.colour
        vertices, points = _source(vertices_of(name)), _source(points_of(name))
        outline = ColumnDataSource({"x": [], "y": []}, name=outline_of(name), syncable=False)
        surface = plot.patch(
            source=outline,
            fill_color=colour,
            fill_alpha=FILL_ALPHA,
            line_color=colour,
            line_width=2,
            line_dash=look.dash,
        )
        self.markers = [
            plot.scatter(source=points, size=POINT_SIZE, color=colour, alpha=POINT_ALPHA, name=f"a point of {name}"),
            plot.scatter(
                source=vertices, marker=look.marker, size=VERTEX_SIZE, color=colour, name=f"a vertex of {name}"
            ),
        ]
        names = plot.text(
            source=vertices,
            text="label",
            text_align="side",
            y_offset=-VERTEX_SIZE,
            text_color=colour,
            text_font_size="12px",
        )
        self.renderers = [surface, *self.markers, names]


class Plane:
    """The plot, and the hulls and fences in it.

    Args:
        units: the units of the axes.
        same_scale: whether x and y are drawn to one scale.
    """

    def __init__(self, units: Units, same_scale: bool) -> None:
        self._frame: Box | None = None
        self._same_scale = same_scale
        self._drawn: dict[str, DrawnHull] = {}
        self._fences: dict[str, tuple[FenceFeed, DrawnFence]] = {}
        self._hover, self._hover_inside = _hover(TOOLTIPS), _hover(INSIDE_TOOLTIPS)
        self._box_zoom = BoxZoomTool(match_aspect=same_scale)
        zoom = WheelZoomTool()
        x, y = DataRange1d(range_padding=0), DataRange1d(range_padding=0)
        self.plot = figure(
            name="plane",
            match_aspect=same_scale,
            sizing_mode="stretch_both",
            x_range=x,
            y_range=y,
            tools=[PanTool(), zoom, self._box_zoom, ResetTool(), SaveTool(), self._hover, self._hover_inside],
            active_scroll=zoom,
            toolbar_location="above",
        )
        bare(self.plot)
        self.plot.min_border_left = LABEL_WIDTH + AXIS_LABEL_HEIGHT
        self._names = axis_label("x", units.x), axis_label("y", units.y)
        self.plot.xaxis.axis_label, self.plot.yaxis.axis_label = self._names
        self.plot.xaxis.formatter = compact_ticks()
        self.plot.yaxis.formatter = compact_ticks()
        # The ranges follow only these two corners, which move seldom; the hulls move often.
        self._corners = ColumnDataSource(_corners(EMPTY_FRAME))
        corners = self.plot.scatter(source=self._corners, alpha=0)
        x.renderers = [corners]
        y.renderers = [corners]
        add_fence_names(self.plot)
        self._rings = Rings(self.plot)

    def show(self, feed: HullFeed, look: Look) -> None:
        """Add a hull."""
        self._drawn[feed.name] = DrawnHull(self.plot, feed, look)
        self._name_sources()

    def hide(self, name: str) -> None:
        """Remove a hull."""
        self._remove(self._drawn.pop(name).renderers)

    def show_fence(self, feed: FenceFeed, look: Look) -> None:
        """Add a fence."""
        self._fences[feed.name] = feed, DrawnFence(self.plot, feed.name, look)
        self._name_sources()

    def hide_fence(self, name: str) -> None:
        """Remove a fence."""
        _, drawn = self._fences.pop(name)
        self._remove(drawn.renderers)

    def set_same_scale(self, same_scale: bool) -> None:
        """Draw both axes to one scale, or let each fill its side of the picture."""
        self._same_scale = self.plot.match_aspect = self._box_zoom.match_aspect = same_scale
        self._frame = None
        self.update()

    def mark(self, key: str, sightings: Iterable[tuple[Sighting, Look]]) -> None:
        """Draw a ring around the key in each hull that holds it."""
        self._rings.draw(key, sightings, self._frame or EMPTY_FRAME)

    def update(self) -> None:
        """Adjust the frame to the hulls and the fences."""
        self._name_axes()
        boxes = [drawn.feed.bounds for drawn in self._drawn.values()]
        boxes += [feed.area.bounds for feed, _ in self._fences.values()]
        frame = frame_around([box for box in boxes if box is not None], self._frame, self._same_scale)
        if frame is not None and frame is not self._frame:
            self._frame = frame
            self._corners.data = _corners(frame)

    def _name_axes(self) -> None:
        """Name the axes longitude and latitude while all hulls with points are on the globe."""
        feeds = [drawn.feed for drawn in self._drawn.values() if drawn.feed.bounds is not None]
        on_globe = bool(feeds) and all(feed.center is not None for feed in feeds)
        names = ("longitude (°)", "latitude (°)") if on_globe else self._names
        if (self.plot.xaxis.axis_label, self.plot.yaxis.axis_label) != names:
            self.plot.xaxis.axis_label, self.plot.yaxis.axis_label = names

    def _remove(self, gone: Sequence[object]) -> None:
        self._name_sources()
        self.plot.renderers = [each for each in self.plot.renderers if each not in gone]
        self._frame = None

    def _name_sources(self) -> None:
        self._hover.renderers = [marker for drawn in self._drawn.values() for marker in drawn.markers]
        self._hover_inside.renderers = [drawn.marks for _, drawn in self._fences.values()]
        # The page asks for the hulls and fences named here.
        self.plot.tags = [*(["hull", name] for name in self._drawn), *(["fence", name] for name in self._fences)]


def _hover(tooltips: list[tuple[str, str]]) -> HoverTool:
    return HoverTool(renderers=[], tooltips=tooltips, formatters={"@x": "printf", "@y": "printf"})


def _corners(frame: Box) -> dict[str, list[float]]:
    return {"x": [frame[0], frame[2]], "y": [frame[1], frame[3]]}


def _source(name: str) -> ColumnDataSource:
    """An empty data source. It is not synced: the page must not send back what the socket sent it."""
    return ColumnDataSource(
        {"x": [], "y": [], "revision": [], "title": [], "key": [], "hull": [], "label": [], "side": []},
        name=name,
        syncable=False,
    )
