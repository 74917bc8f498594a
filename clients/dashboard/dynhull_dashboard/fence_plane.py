"""Fences in the picture of the hulls."""

from bokeh.core.properties import value
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure

from .looks import FENCE_COLOUR, INSIDE, Look

FILL_ALPHA, HALO_ALPHA, MARGIN_ALPHA = 0.08, 0.25, 0.8
LINE_WIDTH, HALO_WIDTH, MARGIN_WIDTH = 2, 8, 1
MARGIN_DASH = (3, 3)
MARK_SIZE = 15
PAPER = "#ffffff"


class DrawnFence:
    """One fence in the picture. A `HullSocket` fills its data sources.

    Attributes:
        marks: the renderer of the subjects inside, for hovering.
        renderers: all of its renderers.
    """

    def __init__(self, plot: figure, name: str, look: Look) -> None:
        area, margin = _source("area", name, "xs", "ys"), _source("margin", name, "xs", "ys")
        inside = _source("inside", name, "x", "y", "hull", "key", "title", "label", "side")
        colour = look.colour
        # Below the hulls, some of which are the areas: their own lines stay visible in the middle of the halo.
        lines = [
            plot.multi_polygons(
                source=area,
                fill_color=None,
                line_color=colour,
                line_width=HALO_WIDTH,
                line_alpha=HALO_ALPHA,
                level="underlay",
            ),
            plot.multi_polygons(
                source=area,
                fill_color=colour,
                fill_alpha=FILL_ALPHA,
                line_color=colour,
                line_width=LINE_WIDTH,
                line_dash=value(look.dash),
                level="underlay",
            ),
            plot.multi_polygons(
                source=margin,
                fill_color=None,
                line_color=colour,
                line_width=MARGIN_WIDTH,
                line_alpha=MARGIN_ALPHA,
                line_dash=value(MARGIN_DASH),
                level="underlay",
            ),
        ]
        self.marks = plot.scatter(
            source=inside,
            marker=INSIDE.marker,
            size=MARK_SIZE,
            fill_color=colour,
            line_color=PAPER,
            level="annotation",
            name=f"inside {name}",
        )
        keys = plot.text(
            source=inside,
            text="label",
            text_align="side",
            y_offset=-MARK_SIZE // 2,
            text_color=colour,
            text_font_size="12px",
            level="annotation",
        )
        self.renderers = [*lines, self.marks, keys]


def add_fence_names(plot: figure) -> None:
    """The names of the fences in the picture. The page places them."""
    plot.text(
        source=_source("names", "fences", "x", "y", "label", "baseline"),
        text="label",
        text_align="center",
        text_baseline="baseline",
        text_color=FENCE_COLOUR,
        text_font_size="13px",
        text_font_style="bold",
        level="annotation",
    )


def _source(kind: str, name: str, *columns: str) -> ColumnDataSource:
    """An empty data source. It is not synced: the page must not send back what the socket sent it."""
    return ColumnDataSource({column: [] for column in columns}, name=f"{kind} of {name}", syncable=False)
