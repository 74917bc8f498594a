"""Steps drawn with matplotlib: a sheet of panels (PNG) or an animation (GIF)."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes

from .steps import Point, Step, chosen

MOST_PANELS, COLUMNS = 40, 4
MOST_FRAMES = 300
MOST_NUMBERS = 30  # points that get the number of their place in the order
FRAMES_A_SECOND, LAST_FRAMES = 1.25, 4

CHAIN, POINT, DISCARDED, GROUP = "#000000", "#707070", "#B8B8B8", "#C9B458"
SIGNS = {1: "#0072B2", 0: "#8E6BBF", -1: "#D55E00"}

Places = dict[Point, tuple[float, float]]


def places(points: Sequence[Point]) -> Places:
    """Where to draw each point: moved and scaled, by the same factor each way, into the square [-1, 1]²; O(n).

    Exact until the last step, so that neither the largest nor the smallest doubles overflow or vanish on the way.
    """
    if not points:
        return {}
    xs, ys = ([Fraction(value) for value in values] for values in zip(*points, strict=True))
    half = max(max(xs) - min(xs), max(ys) - min(ys)) / 2 or Fraction(1)
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return {p: (float((u - x) / half), float((v - y) / half)) for p, u, v in zip(points, xs, ys, strict=True)}


def draw_sheet(path: Path, title: str, points: Sequence[Point], steps: Sequence[Step]) -> int:
    """Write a PNG with a panel a step. Returns how many steps are on it."""
    shown = chosen(len(steps), MOST_PANELS)
    rows = -(-len(shown) // COLUMNS)
    figure, grid = plt.subplots(
        rows, COLUMNS, figsize=(3 * COLUMNS, 3.4 * rows + 0.5), dpi=100, squeeze=False, layout="constrained"
    )
    where = places(points)
    for axes in grid.flat:
        axes.axis("off")
    for axes, i in zip(grid.flat, shown, strict=False):
        _draw(axes, where, steps[i], f"{i + 1}/{len(steps)}")
    figure.suptitle(title, fontsize=13)
    figure.savefig(path)
    plt.close(figure)
    return len(shown)


def draw_animation(path: Path, title: str, points: Sequence[Point], steps: Sequence[Step]) -> int:
    """Write a GIF with a frame a step, the last for longer. Returns how many steps are in it."""
    shown = chosen(len(steps), MOST_FRAMES)
    figure, axes = plt.subplots(figsize=(5, 5.8), dpi=90, layout="constrained")
    figure.suptitle(title, fontsize=12)
    where = places(points)

    def frame(i: int) -> list[Axes]:
        axes.clear()
        _draw(axes, where, steps[i], f"{i + 1}/{len(steps)}")
        return [axes]

    animation = FuncAnimation(figure, frame, shown + shown[-1:] * LAST_FRAMES)
    animation.save(path, writer=PillowWriter(fps=FRAMES_A_SECOND))  # type: ignore[arg-type]  # takes fractions
    plt.close(figure)
    return len(shown)


def _draw(axes: Axes, where: Places, step: Step, number: str) -> None:
    for group in step.groups:
        xs, ys = zip(*(where[p] for p in (*group, group[0])), strict=True)
        axes.fill(xs, ys, facecolor=GROUP, edgecolor=GROUP, alpha=0.25)
        axes.plot(xs, ys, color=GROUP, linewidth=1)
    if step.hull:
        xs, ys = zip(*(where[p] for p in (*step.hull, step.hull[0])), strict=True)
        axes.fill(xs, ys, facecolor=SIGNS[1], alpha=0.12)
        axes.plot(xs, ys, color=SIGNS[1], linewidth=2, marker="o")
    discarded = set(step.discarded)
    _dots(axes, where, [p for p in where if p not in discarded], color=POINT, s=16, zorder=1)
    _dots(axes, where, step.discarded, color=DISCARDED, marker="x", s=34, linewidths=1.8)
    for chain in step.finished:
        _line(axes, where, chain, color=POINT, linewidth=1.5)
    _line(axes, where, step.chain, color=CHAIN, linewidth=1.8, marker="o", markersize=5)
    for tangent in step.tangents:
        _line(axes, where, (step.triple[0], tangent), color=GROUP, linewidth=1.3, linestyle=":")
    if step.triple:
        _line(axes, where, step.triple, color=SIGNS[step.sign], linewidth=2.6)
        _dots(axes, where, step.triple, color=SIGNS[step.sign], s=52, zorder=3)
    if 0 < len(step.order) <= MOST_NUMBERS:
        for place, point in enumerate(step.order, start=1):
            axes.annotate(str(place), where[point], (6, 5), textcoords="offset points", fontsize=8, zorder=4)
    axes.set_title(f"{number}  {step.caption}", fontsize=9, loc="left")
    axes.set(xlim=(-1.15, 1.15), ylim=(-1.15, 1.15), aspect="equal")
    axes.axis("off")


def _line(axes: Axes, where: Places, points: Sequence[Point], **style: Any) -> None:
    if points:
        xs, ys = zip(*(where[p] for p in points), strict=True)
        axes.plot(xs, ys, **style)


def _dots(axes: Axes, where: Places, points: Sequence[Point], **style: Any) -> None:
    if points:
        xs, ys = zip(*(where[p] for p in points), strict=True)
        axes.scatter(xs, ys, **style)
