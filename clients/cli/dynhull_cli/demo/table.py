"""Anybody's points: a CSV file with a header, columns chosen by name."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from .scene import Frame, Points

SHOWN_BAD_ROWS = 5
MILESTONES = 24
PAIRS = [("x", "y"), ("lon", "lat"), ("longitude", "latitude")]

Row = tuple[str, str, tuple[float, float]]  # time, name, position


class Table:
    """Rows of a CSV file, in batches.

    With a time column, one batch for each of its values, in their order (as numbers where all of them are, otherwise as
    text); without, the file is cut into `batches` equal parts. With an id column, a row whose id was seen before moves
    that point; without, every row adds a point. Rows that have no finite coordinates are counted and shown.
    """

    counted = "points"
    step = "batches"
    length_unit = "units"
    area_unit = "square units"

    def __init__(
        self, path: Path, x: str | None, y: str | None, identity: str | None, time: str | None, batches: int
    ) -> None:
        self.title = path.name
        self.hull_name = "points"
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            columns = reader.fieldnames or []
            if not columns:
                raise ValueError(f"{path} is empty: it needs a header line with the names of its columns")
            x, y = _coordinate_columns(path, columns, x, y)
            for option, name in (("--id", identity), ("--time", time)):
                _require(path, columns, option, name)
            rows, bad = _read(reader, x, y, identity, time)
        self.notes = [f"{path}: {len(rows):,} points from columns {x} and {y}"]
        if bad:
            self.notes.append(f"{len(bad):,} bad rows left out:")
            self.notes += [f"  {reason}" for reason in bad[:SHOWN_BAD_ROWS]]
            if len(bad) > SHOWN_BAD_ROWS:
                self.notes.append(f"  ... and {len(bad) - SHOWN_BAD_ROWS:,} more")
        if not rows:
            raise ValueError("\n".join([f"{path} has no points", *self.notes[1:]]))
        self._batches = _by_time(rows) if time else _equal_parts(rows, batches)
        self._moves = identity is not None
        self.length = len(self._batches)
        self.background = np.empty((0, 2))

    def frames(self) -> Iterator[Frame]:
        """A frame a batch."""
        there: dict[str, tuple[float, float]] = {}
        every = max(1, math.ceil(self.length / MILESTONES))
        for i, (clock, rows) in enumerate(self._batches):
            deleted, inserted = [], []
            for name, position in {name: position for _, name, position in rows}.items():
                if name in there:
                    deleted.append(there[name])
                inserted.append(position)
                there[name] = position
            names = list(there) if self._moves else [f"row {name}" for name in there]
            milestone = i % every == 0 or i == self.length - 1
            yield Frame(clock, _array(deleted), _array(inserted), _array(there.values()), names, milestone)


def _coordinate_columns(path: Path, columns: Sequence[str], x: str | None, y: str | None) -> tuple[str, str]:
    if x is None and y is None:
        lowered = {column.lower(): column for column in columns}
        for pair in PAIRS:
            if lowered.keys() >= set(pair):
                return lowered[pair[0]], lowered[pair[1]]
    for option, name in (("--x", x), ("--y", y)):
        if name is None:
            raise ValueError(f"{path}: name its {option[2:]} column with {option}; it has {', '.join(columns)}")
        _require(path, columns, option, name)
    assert x is not None
    assert y is not None
    return x, y


def _require(path: Path, columns: Sequence[str], option: str, name: str | None) -> None:
    if name is not None and name not in columns:
        raise ValueError(f"{path} has no column {name!r} ({option}); it has {', '.join(columns)}")


def _read(
    reader: "csv.DictReader[str]", x: str, y: str, identity: str | None, time: str | None
) -> tuple[list[Row], list[str]]:
    """Good rows, and a reason for each bad one."""
    rows, bad = [], []
    for record in reader:
        line = reader.line_num
        try:
            position = _coordinate(record, x), _coordinate(record, y)
            for column in (identity, time):
                if column is not None and not record[column]:
                    raise ValueError(f"{column} is missing")
        except ValueError as reason:
            bad.append(f"line {line}: {reason}")
            continue
        name = str(record[identity]) if identity else str(line)
        rows.append((str(record[time]) if time else "", name, position))
    return rows, bad


def _coordinate(record: dict[str, str], column: str) -> float:
    text = record[column]
    if not text:
        raise ValueError(f"{column} is missing")
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{column} is {text!r}, not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{column} is {text!r}, not finite")
    return value + 0.0


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
