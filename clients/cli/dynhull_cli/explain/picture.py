"""A story drawn with matplotlib: a sheet with a panel for each step (PNG, SVG), or an animation (GIF)."""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from .scene import Mark, Story, Style, chosen

MOST_PANELS, COLUMNS = 40, 4
MOST_FRAMES = 300
ENTRIES = 3  # of the legend in a row under an animation
FRAMES_A_SECOND, LAST_FRAMES = 1.25, 4
PANEL, FRAME = 3.0, 5.0  # widths in inches
CAPTION, TITLE, LEGEND = 0.4, 0.5, 0.6  # heights in inches


def draw_sheet(path: Path, story: Story) -> int:
    """Write a PNG or an SVG, by the name's suffix. Returns the number of steps on it."""
    shown = chosen(len(story.pictures), MOST_PANELS)
    rows = -(-len(shown) // COLUMNS)
    panel = PANEL * _aspect(story)
    size = COLUMNS * PANEL, rows * (panel + CAPTION) + TITLE + LEGEND
    # Text stays text, and the same story makes the same file.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": story.title}):
        figure, grid = plt.subplots(rows, COLUMNS, figsize=size, dpi=100, squeeze=False)
        for axes in grid.flat:
            axes.axis("off")
        for axes, i in zip(grid.flat, shown, strict=False):
            _draw(axes, story, i)
        _label(figure, story, len(story.legend))
        figure.subplots_adjust(hspace=CAPTION / panel, wspace=0)
        figure.savefig(path, metadata={"Date": None} if path.suffix.lower() == ".svg" else None)
        plt.close(figure)
    return len(shown)


def draw_animation(path: Path, story: Story) -> int:
    """Write a GIF with a frame for each step, the last one for longer. Returns the number of steps in it."""
    shown = chosen(len(story.pictures), MOST_FRAMES)
    size = FRAME, FRAME * _aspect(story) + CAPTION + TITLE + LEGEND
    figure, axes = plt.subplots(figsize=size, dpi=90)
    _label(figure, story, ENTRIES)

    def frame(i: int) -> list[Axes]:
        axes.clear()
        _draw(axes, story, i)
        return [axes]

    animation = FuncAnimation(figure, frame, shown + shown[-1:] * LAST_FRAMES)
    animation.save(path, writer=PillowWriter(fps=FRAMES_A_SECOND))  # type: ignore[arg-type]  # takes fractions
    plt.close(figure)
    return len(shown)


def _label(figure: Figure, story: Story, columns: int) -> None:
    """The title above and the legend below, and room for both."""
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.01, right=0.99, bottom=LEGEND / height, top=1 - (TITLE + CAPTION) / height)
    figure.suptitle(story.title, fontsize=13, y=1 - TITLE / 2 / height, va="center", parse_math=False)
    patches = [Patch(color=story.styles[style].colour, label=meaning) for style, meaning in story.legend.items()]
    figure.legend(handles=patches, loc="lower left", ncols=columns, fontsize=8, frameon=False)


def _aspect(story: Story) -> float:
    """A picture's height over its width."""
    (left, bottom), (right, top) = story.low, story.high
    return (top - bottom) / (right - left)


def _draw(axes: Axes, story: Story, number: int) -> None:
    picture = story.pictures[number]
    for layer, mark in enumerate((*story.backdrop, *picture.marks), start=1):
        _draw_mark(axes, mark, story.styles[mark.style], layer)
    axes.set_title(f"{number + 1}/{len(story.pictures)}  {picture.caption}", fontsize=9, loc="left", parse_math=False)
    (left, bottom), (right, top) = story.low, story.high
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.axis("off")


def _draw_mark(axes: Axes, mark: Mark, style: Style, layer: int) -> None:
    xs, ys = zip(*mark.positions, strict=True)
    colour = style.colour
    match style.kind:
        case "line":
            dashes = ":" if style.dashed else "-"
            axes.plot(xs, ys, dashes, color=colour, linewidth=style.width, solid_capstyle="butt", zorder=layer)
        case "area":
            axes.fill(xs, ys, facecolor=colour, alpha=style.opacity, zorder=layer)
            axes.plot((*xs, xs[0]), (*ys, ys[0]), color=colour, linewidth=style.width, zorder=layer)
        case "dots":
            axes.plot(xs, ys, "o", color=colour, markersize=style.width, zorder=layer)
        case "crosses":
            axes.plot(xs, ys, "o", color="white", markersize=style.width, zorder=layer)
            axes.plot(xs, ys, "x", color=colour, markersize=style.width, markeredgewidth=1.8, zorder=layer)
        case "number":
            label = axes.annotate(mark.text, mark.positions[0], (6, 5), textcoords="offset points", zorder=layer)
            label.set(color=colour, fontsize=style.width)
