"""What all plots have in common. Ink and paper come from the page's style sheet, light or dark."""

from bokeh.models import CustomJSTickFormatter
from bokeh.plotting import figure

LABEL_WIDTH = 48


def bare(plot: figure) -> None:
    """Nothing but the data, faint lines to measure them by, and figures at the edge."""
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.outline_line_color = None
    plot.min_border = 4
    # Room for the longest figure: labels that grow would be drawn beyond the edge, and stay there.
    plot.min_border_left = LABEL_WIDTH
    plot.axis.axis_line_color = None
    plot.axis.major_tick_line_color = None
    plot.axis.minor_tick_line_color = None


def compact_ticks() -> CustomJSTickFormatter:
    """1.2K, 3.4M; very small and very large ones with an exponent."""
    return CustomJSTickFormatter(
        code="""
        const size = Math.abs(tick)
        if (size > 0 && (size < 1e-3 || size >= 1e15)) return tick.toExponential(1)
        return new Intl.NumberFormat("en", {notation: "compact", maximumSignificantDigits: 4}).format(tick)
        """
    )
