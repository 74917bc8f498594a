"""Time lines: one plot per quantity, on a shared time axis."""

import time
from collections.abc import Mapping

from bokeh.models import AdaptiveTicker, BasicTicker, ColumnDataSource, CustomJSTickFormatter, DataRange1d, HoverTool
from bokeh.plotting import figure

from .history import ROWS, History
from .looks import Look
from .styles import bare, compact_ticks

SHOWN_MILLISECONDS = 5 * 60 * 1000
OPENING_MILLISECONDS = 10 * 1000
# Hours and minutes at full minutes, only the seconds between them.
LOCAL_TIME = """
    const time = new Date(tick).toLocaleTimeString("en", {timeStyle: "medium", hourCycle: "h23"})
    return time.endsWith(":00") ? time.slice(0, 5) : time.slice(5)
"""
SECONDS, TICKS = [1, 2, 5, 10, 15, 30], 3


class Lines:
    """The columns of one history, each as a line in one of the plots."""

    def __init__(self, history: History, name: str, plots: Mapping[str, figure], looks: Mapping[str, Look]) -> None:
        self._history = history
        self._seen = history.length
        self._plots = plots
        self._source = ColumnDataSource(dict(history.since(0)), name=f"time lines of {name}")
        self._lines = {
            column: plots[column].line(
                "time",
                column,
                source=self._source,
                color=look.colour,
                line_width=2,
                line_dash=look.dash,
                name=name,
            )
            for column, look in looks.items()
        }

    def update(self) -> None:
        """Draw the new rows."""
        new = self._history.since(self._seen)
        if new["time"]:
            self._source.stream(dict(new), ROWS)
            self._seen = self._history.length

    def remove(self) -> None:
        """Remove the lines from the plots."""
        for column, line in self._lines.items():
            self._plots[column].renderers = [each for each in self._plots[column].renderers if each is not line]


def time_plots(*names: str) -> dict[str, figure]:
    """Empty plots with a shared time axis, which follows the newest row."""
    times = DataRange1d(follow="end", follow_interval=SHOWN_MILLISECONDS, range_padding=0)
    now = time.time() * 1000
    opening = ColumnDataSource({"time": [now - OPENING_MILLISECONDS, now], "value": [0.0, 0.0]})
    return {name: _time_plot(name, times, opening) for name in names}


def _time_plot(name: str, times: DataRange1d, opening: ColumnDataSource) -> figure:
    plot = figure(
        name=name,
        sizing_mode="stretch_both",
        x_range=times,
        y_range=DataRange1d(start=0, range_padding=0.15),
        tools=[HoverTool(tooltips=[("$name", "$snap_y{0,0.[000]}")])],
        toolbar_location=None,
    )
    # Without any data Bokeh cannot choose the ranges, and warns.
    plot.scatter("time", "value", source=opening, visible=False)
    bare(plot)
    plot.xgrid.visible = False
    plot.xaxis.formatter = CustomJSTickFormatter(code=LOCAL_TIME)
    plot.yaxis.formatter = compact_ticks()
    plot.xaxis.ticker = AdaptiveTicker(base=60, mantissas=SECONDS, min_interval=1000, desired_num_ticks=TICKS)
    plot.yaxis.ticker = BasicTicker(desired_num_ticks=TICKS)
    return plot
