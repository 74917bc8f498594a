"""Which points are certainly in an area that never changes, and which certainly not: many of them at once.

A grid lies over the area. A cell is near the boundary if a point of it may be on the other side of it, or within the
margin; all points of another cell are on the same side, which one of them tells, exactly. Coordinates are rounded where
points are put into cells: by much less than what a cell is away from the boundary that is not near it.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dynhull import FenceIndex, KeyedHull
from dynhull.arrays import Points

from ..model.config import CircleArea, FenceConfig, PolygonArea
from .globe import rings_of
from .subjects import lay

Sides = npt.NDArray[np.int8]
Coordinates = npt.NDArray[np.float64]
OUT, IN, NEAR, GONE = range(4)

CELLS, BORDER = 1024, 4  # of each axis; those on each side of it that are away from the area
# Points of the boundary are at most half a cell from the next: what is between them is in the same cells or in those
# beside these.
STEPS, BESIDE = 2, 1
MOST_STEPS = 2**22
LEAST_CELL = 2.0**-38  # of the greatest coordinate
AREA = 0


class Cells:
    """The cells of an area.

    Args:
        config: a fence with an area of its own, in the plane.
        boundary: points of the boundary, none farther than half a cell from the next.
        low: the least coordinates of the grid.
        size: the width and the height of a cell.
    """

    def __init__(self, config: FenceConfig, boundary: Points, low: Points, size: Points) -> None:
        self._config = config
        self._low, self._size = low, size
        near = np.zeros((CELLS, CELLS), np.int64)
        columns, rows = self._places(boundary[:, 0], boundary[:, 1])
        near[rows, columns] = 1
        spread = BESIDE + np.ceil(config.margin / size).astype(int)
        self._sides = self._judged(_within(near, spread))
        clear = (self._sides != OUT).astype(np.int64)
        self._clear = ~_within(clear, np.array([BESIDE, BESIDE]))

    def sides(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> Sides:
        """The side of each point: IN or OUT; NEAR where a margin may decide; GONE for NaN."""
        columns, rows = self._places(x, y)
        found: Sides = self._sides.take(rows * CELLS + columns)
        there = np.flatnonzero(found == NEAR)
        if len(there):
            found[there] = self._exact(np.column_stack([x[there], y[there]]))
        found[np.isnan(x)] = GONE
        return found

    def stays(
        self, x: tuple[Coordinates, Coordinates], y: tuple[Coordinates, Coordinates], *, crosses: bool
    ) -> npt.NDArray[np.bool_]:
        """Of boxes, given their least and greatest coordinates, whether all points of each are on the same side.

        Where subjects that pass through the area matter, not even the ways between these may meet it.
        """
        low, high = self._places(x[0], y[0]), self._places(x[1], y[1])
        found = ~np.isnan(x[0] + y[0])
        for first, last in zip(low, high, strict=True):
            found &= last - first <= BESIDE  # so that all of its cells are those of its corners
        cells = [rows * CELLS + columns for columns in (low[0], high[0]) for rows in (low[1], high[1])]
        side = self._sides.take(cells[0])
        found &= side != NEAR
        for cell in cells:
            found &= self._sides.take(cell) == side
            if crosses:
                found &= (side == IN) | self._clear.take(cell)
        return found

    def passes(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """(n - 1,) whether the straight way between points that are both outside may meet the area."""
        columns, rows = self._places(x, y)
        clear = self._clear[rows, columns][:-1]
        clear &= (np.abs(np.diff(columns)) <= BESIDE) & (np.abs(np.diff(rows)) <= BESIDE)
        for places in (columns, rows):
            for end in (0, CELLS - 1):
                clear |= (places[:-1] == end) & (places[1:] == end)
        return ~clear

    def _places(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.int32], ...]:
        """The columns and the rows of points, the outermost ones of those outside and of NaN."""
        found = []
        for values, low, size in zip((x, y), self._low.tolist(), self._size.tolist(), strict=True):
            places = (values - low) * (1 / size)
            np.fmin(np.fmax(places, 0.0, out=places), CELLS - 1.0, out=places)
            found.append(places.astype(np.int32))
        return tuple(found)

    def _judged(self, near: npt.NDArray[np.bool_]) -> Sides:
        """The side of each cell; in a row of cells that are not near, one tells it for all until the next that is."""
        begins = ~near
        begins[:, 1:] &= near[:, :-1]
        rows, columns = np.nonzero(begins)
        middles = self._low + (np.column_stack([columns, rows]) + 0.5) * self._size
        runs = np.cumsum(begins.ravel()).reshape(near.shape)
        sides = np.append(np.int8(NEAR), self._exact(middles))[runs].astype(np.int8)
        sides[near] = NEAR
        return sides

    def _exact(self, points: Points) -> Sides:
        """The side of each point, as fences decide it: IN the area, OUT of it and farther than the margin, or NEAR."""
        numbers = np.arange(len(points), dtype=np.uint64)
        index = FenceIndex(KeyedHull.from_entities(numbers, points, None, "int"))
        lay(index, AREA, self._config, None)
        found = np.full(len(points), OUT, np.int8)
        if self._config.margin:
            lay(index, AREA, self._config, None, numbers)  # as if all were inside: those leave that are farther
            left = index.take()
            found[:] = NEAR
            found[left.keys[left.changes == -1].astype(np.intp)] = OUT
            index.drop(AREA)
            lay(index, AREA, self._config, None)
        inside = index.inside(AREA)
        assert isinstance(inside, np.ndarray)
        found[inside.astype(np.intp)] = IN
        return found


def cells_of(config: FenceConfig) -> Cells | None:
    """The cells of the area of a fence in the plane; None if it is a hull, or too small or too long for them."""
    if isinstance(config.area, CircleArea):
        center, radius = np.array([config.area.x, config.area.y]), config.area.radius
        corners = np.array([center - radius, center + radius])
    elif isinstance(config.area, PolygonArea):
        rings = [np.asarray(ring) for polygon in rings_of(config.area, None) for ring in polygon]
        corners = np.concatenate(rings)
    else:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = corners.min(axis=0) - config.margin, corners.max(axis=0) + config.margin
        size = (high - low) / (CELLS - 2 * BORDER)
        low = low - BORDER * size
        greatest = max(np.abs(corners).max(), config.margin)
    if not (np.isfinite(size).all() and (size > greatest * LEAST_CELL).all()):
        return None
    boundary = _around(center, radius, size) if isinstance(config.area, CircleArea) else _along(rings, size)
    return None if boundary is None else Cells(config, boundary, low, size)


def _around(center: Points, radius: float, size: Points) -> Points | None:
    count = STEPS * math.ceil(math.tau * radius / size.min()) + STEPS
    if count > MOST_STEPS:
        return None
    angles = np.linspace(0, math.tau, count)
    return center + radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _along(rings: Sequence[Points], size: Points) -> Points | None:
    """Points of all edges of rings."""
    starts = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    counts = STEPS * np.ceil(np.abs((ends - starts) / size).max(axis=1)).astype(np.int64) + 1
    if counts.sum() > MOST_STEPS:
        return None
    places = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (places / np.repeat(counts, counts))[:, np.newaxis]
    points: Points = np.repeat(starts, counts, axis=0) * (1 - share) + np.repeat(ends, counts, axis=0) * share
    return points


def _within(marks: npt.NDArray[np.int64], spread: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which cells have a mark in the rectangle around them: so many columns and rows on each side."""
    for axis, reach in ((1, int(spread[0])), (0, int(spread[1]))):
        summed = np.insert(np.cumsum(marks, axis=axis), 0, 0, axis=axis)
        places = np.arange(CELLS)
        last, first = np.minimum(places + reach + 1, CELLS), np.maximum(places - reach, 0)
        marks = ((summed.take(last, axis=axis) - summed.take(first, axis=axis)) > 0).astype(np.int64)
    return marks > 0
