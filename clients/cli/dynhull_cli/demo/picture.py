"""The hull at its largest, with the points in it."""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib import pyplot as plt

from .map import drawing_of
from .replay import ReplayStep
from .scene import Scene

HULL_COLOUR, POINT_COLOUR, GROUND_COLOUR = "#0072B2", "#D55E00", "#B8B8B8"
FENCE_COLOUR = "#009E73"
COAST_COLOUR = "#9A9A9A"
TICK_COLOUR = "#707070"
LABEL_OFFSET = 9  # typographic points, away from the hull
FENCE_LABEL = 3  # typographic points, below the fence
MARGIN = 0.1  # of the picture's width and height
WIDTH, TITLE_HEIGHT = 12, 0.8  # inches
FLATTEST = 0.4  # height of the drawing over its width
MOST_LABELS = 24


def draw(path: Path, scene: Scene, step: ReplayStep) -> None:
    """Write a PNG of one frame: background, points, hull, the corners' names."""
    frame, drawing = step.frame, drawing_of(scene)
    vertices, background = drawing.place(step.vertices), drawing.place(scene.background)
    positions = drawing.place(frame.positions)
    outline = drawing.line(step.vertices)
    everything = np.concatenate([outline, background])
    wide, tall = np.ptp(everything, axis=0)
    height = WIDTH * min(max(tall / wide if wide else 1.0, FLATTEST), 1.0) + TITLE_HEIGHT
    figure, axes = plt.subplots(figsize=(WIDTH, height), dpi=130, layout="constrained")
    for coast in drawing.coasts:
        axes.plot(*coast.T, color=COAST_COLOUR, linewidth=0.8, zorder=0.5)
    axes.scatter(
        background[:, 0], background[:, 1], s=8, color=GROUND_COLOUR, label="airports" if len(background) else None
    )
    for name, (x, y, radius) in scene.circles.items():
        circle = drawing.circle(x, y, radius)
        axes.plot(*circle.T, color=FENCE_COLOUR, linewidth=1.2)
        lowest = circle[circle[:, 1].argmin()]
        axes.annotate(name, lowest, (0, -FENCE_LABEL), textcoords="offset points", ha="center", va="top", fontsize=8)
    axes.fill(*outline.T, facecolor=HULL_COLOUR, alpha=0.10)
    axes.plot(*outline.T, color=HULL_COLOUR, linewidth=1.6, label=f"convex hull, {len(vertices)} vertices")
    axes.scatter(
        positions[:, 0],
        positions[:, 1],
        s=12,
        color=POINT_COLOUR,
        label=f"{len(frame.positions):,} {scene.counted}",
        zorder=3,
    )
    axes.scatter(
        vertices[:, 0], vertices[:, 1], s=38, facecolor="white", edgecolor=HULL_COLOUR, linewidth=1.6, zorder=4
    )
    middle = vertices.mean(axis=0)
    if len(vertices) <= MOST_LABELS:
        for vertex, name in zip(vertices, step.corners(), strict=True):
            x, y = LABEL_OFFSET * (vertex - middle) / (np.hypot(*(vertex - middle)) or 1.0)
            side = "left" if x >= 0 else "right"
            axes.annotate(name, vertex, (x, y), textcoords="offset points", ha=side, va="center", fontsize=9)
    axes.set_title(
        f"{scene.title}, {frame.clock}: the hull at its largest, {step.area:,.0f} {scene.area_unit}", loc="left"
    )
    axes.set_aspect("equal", adjustable="box" if drawing.coasts else "datalim")
    axes.margins(MARGIN)
    if drawing.coasts:  # which go on beyond the picture
        low, high = everything.min(axis=0), everything.max(axis=0)
        room = MARGIN * float((high - low).max())
        axes.set_xlim(low[0] - room, high[0] + room)
        axes.set_ylim(low[1] - room, high[1] + room)
    axes.set_xlabel(scene.length_unit, loc="right", color=TICK_COLOUR)
    axes.legend(loc="lower left", frameon=False)
    axes.tick_params(colors=TICK_COLOUR, labelsize=8)
    for spine in axes.spines.values():
        spine.set_visible(False)
    figure.savefig(path)
    plt.close(figure)
