"""Points in a CSV file with a header: columns chosen by name, bad rows counted and shown."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path

SHOWN_BAD_ROWS = 5
PAIRS = [("x", "y"), ("lon", "lat"), ("longitude", "latitude")]

Row = tuple[str, str, tuple[float, float]]  # time, name, position


def read_points(
    path: Path, x: str | None, y: str | None, identity: str | None = None, time: str | None = None
) -> tuple[list[Row], list[str]]:
    """Read a CSV file.

    Args:
        path: the file; its first line names the columns.
        x: the column of x; without `x` and `y`, the first of the pairs x and y, lon and lat, longitude and latitude.
        y: the column of y.
        identity: the column of each point's name; without, the name is the number of its line.
        time: the column of each point's time; without, the time is empty.

    Returns:
        The rows, and lines of text about them: how many, and which were left out because they have no finite
        coordinates, no name or no time.

    Raises:
        ValueError: the file has no header, not the columns asked for, or no points.
        OSError: the file cannot be read.
    """
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file)
        columns = reader.fieldnames or []
        if not columns:
            raise ValueError(f"{path} is empty: it needs a header line with the names of its columns")
        x, y = coordinate_columns(path, columns, x, y)
        for option, name in (("--id", identity), ("--time", time)):
            _require(path, columns, option, name)
        rows, bad = _read(reader, x, y, identity, time)
    notes = [f"{path}: {len(rows):,} points from columns {x} and {y}"]
    notes += bad_rows_left_out(bad[:SHOWN_BAD_ROWS], len(bad))
    if not rows:
        raise ValueError("\n".join([f"{path} has no points", *notes[1:]]))
    return rows, notes


def bad_rows_left_out(first: Sequence[str], count: int) -> list[str]:
    """Lines about so many bad rows, of which the first are shown; none where there are none."""
    if not count:
        return []
    more = [f"  ... and {count - len(first):,} more"] if count > len(first) else []
    return [f"{count:,} bad rows left out:", *(f"  {each}" for each in first), *more]


def coordinate_columns(path: Path | str, columns: Sequence[str], x: str | None, y: str | None) -> tuple[str, str]:
    """The columns of x and y among those there are; ValueError tells what to do where they are not."""
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


def _require(path: Path | str, columns: Sequence[str], option: str, name: str | None) -> None:
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
            position = coordinate(record[x], x), coordinate(record[y], y)
            for column in (identity, time):
                if column is not None and not record[column]:
                    raise ValueError(f"{column} is missing")
        except ValueError as reason:
            bad.append(f"line {line}: {reason}")
            continue
        name = str(record[identity]) if identity else str(line)
        rows.append((str(record[time]) if time else "", name, position))
    return rows, bad


def coordinate(text: str | None, column: str) -> float:
    """A finite number; ValueError tells why there is none."""
    if not text:
        raise ValueError(f"{column} is missing")
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{column} is {text!r}, not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{column} is {text!r}, not finite")
    return value + 0.0
