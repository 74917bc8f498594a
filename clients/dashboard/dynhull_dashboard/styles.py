"""The style of all plots. Text and background colours come from the page's style sheet, light or dark."""

from bokeh.models import CustomJSTickFormatter
from bokeh.plotting import figure

LABEL_WIDTH = 48


def bare(plot: figure) -> None:
    """Remove all decoration but the grid and the tick labels."""
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.outline_line_color = None
    plot.min_border = 4
    # Room for the longest label: Bokeh draws longer ones beyond the edge and leaves them there.
    plot.min_border_left = LABEL_WIDTH
    plot.axis.axis_line_color = None
    plot.axis.major_tick_line_color = None
    plot.axis.minor_tick_line_color = None


def compact_ticks() -> CustomJSTickFormatter:
    """Labels such as 1.2K and 3.4M; very small and very large numbers with an exponent."""
    return CustomJSTickFormatter(
        code="""
        const size = Math.abs(tick)
        if (size > 0 && (size < 1e-3 || size >= 1e15)) return tick.toExponential(1)
        return new Intl.NumberFormat("en", {notation: "compact", maximumSignificantDigits: 4}).format(tick)
        """
    )
