"""The points of a CSV file, as a scene."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dynhull.globe import Gnomonic

from ..csv_points import PointFile, Row, read_points
from ..reading.columns import are_degrees
from .scene import Frame, Points

if TYPE_CHECKING:
    from datetime import timedelta

MILESTONES = 24
SQUARE_KILOMETRE = 1e6  # square metres


class Table:
    """Rows of a CSV file, in batches.

    With a time column, there is one batch for each value, in order: as numbers if all are numbers, otherwise as text.
    Without, the file is cut into `batches` equal parts. With an id column, a row whose id was seen before moves that
    point; without, every row adds a point. Rows without finite coordinates are counted and shown.

    Args:
        path: the file.
        x: the column of x.
        y: the column of y.
        identity: the column of ids.
        time: the column of times.
        batches: the number of parts without times.
        geographic: whether the points are on the globe; None if the names of the columns say so.
        keyed: whether points have keys also without ids: their lines.

    Raises:
        ValueError: the file does not have the columns, or no points, or some are too far apart for a hull on the globe.
    """

    max_age: "timedelta | None" = None
    counted = "points"
    step = "batches"
    circles: dict[str, tuple[float, float, float]] = {}  # noqa: RUF012  (nobody changes it)
    rivals: tuple[str, str] | None = None

    def __init__(
        self,
        path: Path,
        x: str | None,
        y: str | None,
        identity: str | None,
        time: str | None,
        batches: int,
        *,
        geographic: bool | None = None,
        keyed: bool = False,
    ) -> None:
        self.title = path.name
        self.hull_name = "points"
        file = read_points(path, x, y, identity, time, geographic=geographic)
        self.center = _center(file) if file.geographic else None
        self.length_unit, self.area_unit, self.area_scale = "units", "square units", 1.0
        if file.geographic:
            self.length_unit, self.area_unit, self.area_scale = "km", "km²", 1 / SQUARE_KILOMETRE
        self.notes = [*file.notes, *_frame(file)]
        self._batches = _by_time(file.rows) if time else _equal_parts(file.rows, batches)
        self.keyed = keyed or identity is not None
        self.length = len(self._batches)
        self.background = np.empty((0, 2))

    def frames(self) -> Iterator[Frame]:
        """One frame per batch."""
        there: dict[str, tuple[float, float]] = {}
        every = max(1, math.ceil(self.length / MILESTONES))
        for i, (clock, rows) in enumerate(self._batches):
            put = {name: position for _, name, position in rows}
            there |= put
            names = list(there) if self.keyed else [f"row {name}" for name in there]
            milestone = i % every == 0 or i == self.length - 1
            keys = list(put) if self.keyed else []
            yield Frame(clock, _array(put.values()), _array(there.values()), names, milestone, keys)


def _center(file: PointFile) -> tuple[float, float]:
    """The direction of the mean of all points, for which a hull on the globe must reach them all."""
    places = _array(position for *_, position in file.rows)
    frame = Gnomonic.about(places)
    try:
        frame.project_all(places)
    except ValueError as error:
        raise ValueError(f"{error}. --plane takes degrees for points of a plane") from None
    return frame.center


def _frame(file: PointFile) -> list[str]:
    """A line about the frame; none where nobody would expect the globe."""
    columns = " and ".join(file.axes)
    if file.geographic:
        return [f"on the globe: {columns} are degrees; --plane takes them for a plane"]
    if are_degrees(*file.axes):
        return [f"in the plane: {columns} are x and y, and areas square degrees"]
    return []


def _by_time(rows: Iterable[Row]) -> list[tuple[str, list[Row]]]:
    rows = list(rows)
    try:
        numbers = {time: float(time) for time, _, _ in rows}
        rows.sort(key=lambda row: numbers[row[0]])
    except ValueError:
        rows.sort(key=lambda row: row[0])
    return [(time, list(group)) for time, group in groupby(rows, key=lambda row: row[0])]


def _equal_parts(rows: Sequence[Row], batches: int) -> list[tuple[str, list[Row]]]:
    size = math.ceil(len(rows) / batches)
    parts = [list(rows[i : i + size]) for i in range(0, len(rows), size)]
    return [(f"line {part[-1][1]}", part) for part in parts]


def _array(points: Iterable[tuple[float, float]]) -> Points:
    rows = list(points)
    return np.array(rows, dtype=np.float64).reshape(len(rows), 2)
