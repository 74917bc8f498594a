"""The rings around the key that a viewer looks for."""

from collections.abc import Iterable

from bokeh.models import ColumnDataSource, Text
from bokeh.plotting import figure

from .looks import Look
from .outline import Box
from .search import Sighting

SIZE, LINE_WIDTH, HALO_WIDTH = 24, 3, 7
INK, PAPER = "#1b1f24", "#ffffff"  # on the light and on the dark page: they cover the points beneath


class Rings:
    """A ring with the key in each hull that holds it."""

    def __init__(self, plot: figure) -> None:
        self._source = ColumnDataSource(_columns("", [], []), name="found")
        for colour, width in ((PAPER, HALO_WIDTH), ("colour", LINE_WIDTH)):
            plot.scatter(
                source=self._source, size=SIZE, fill_alpha=0, line_color=colour, line_width=width, level="overlay"
            )
        name = Text(
            text="label",
            text_align="side",
            y_offset=-SIZE // 2 - LINE_WIDTH,
            text_color=INK,
            text_font_size="12px",
            text_font_style="bold",
            background_fill_color=PAPER,
            border_line_color="colour",
            padding=2,  # type: ignore[arg-type]  # Bokeh takes a plain number
        )
        plot.add_glyph(self._source, name, level="overlay")

    def draw(self, key: str, sightings: Iterable[tuple[Sighting, Look]], frame: Box) -> None:
        """Draw the key where it is; the text lies towards the middle of the frame."""
        present = [(sighting, look.colour) for sighting, look in sightings if sighting.present]
        middle = (frame[0] + frame[2]) / 2
        columns = _columns(key, present, ["right" if each.x > middle else "left" for each, _ in present])
        if columns != self._source.data:
            self._source.data = columns


def _columns(key: str, present: list[tuple[Sighting, str]], side: list[str]) -> dict[str, list[float] | list[str]]:
    return {
        "x": [sighting.x for sighting, _ in present],
        "y": [sighting.y for sighting, _ in present],
        "label": [key] * len(present),
        "side": side,
        "colour": [colour for _, colour in present],
    }
