"""The points of a CSV file that fits into memory, with their names and times."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .csv_table import CsvFormat, CsvTable, csv_table, numbered
from .plural import plural
from .reading.columns import are_degrees, column_index, decimal_mark, why_no_place
from .reading.values import coordinate

SHOWN_BAD_ROWS = 5

Row = tuple[str, str, tuple[float, float]]  # time, name, position


@dataclass(frozen=True, slots=True)
class PointFile:
    """The points of a CSV file.

    Attributes:
        rows: its rows.
        axes: the names of the columns of x and y.
        geographic: whether these are longitudes and latitudes.
        notes: lines of text: the number of rows, and the rows left out because they lack finite coordinates, a name or
            a time.
    """

    rows: list[Row]
    axes: tuple[str, str]
    geographic: bool
    notes: list[str]


def read_points(
    path: Path,
    x: str | None,
    y: str | None,
    identity: str | None = None,
    time: str | None = None,
    *,
    geographic: bool | None = False,
) -> PointFile:
    """Read a CSV file.

    Args:
        path: the file.
        x: the column of x, by name or by number from 1; by default the first known pair of names, such as lon and lat.
        y: the column of y.
        identity: the column of each point's name; None to name points by the number of their line.
        time: the column of each point's time; None for empty times.
        geographic: whether points are longitudes and latitudes; None if the names of the columns say so.

    Raises:
        ValueError: the file does not have the columns, or no points.
        OSError: the file cannot be read.
    """
    with path.open("rb") as file, csv_table(str(path), file, CsvFormat(x, y)) as table:
        labels = [
            None if column is None else column_index(path, table.names, option, column)
            for option, column in (("--time", time), ("--id", identity))
        ]
        axes = table.names[table.x], table.names[table.y]
        on_globe = are_degrees(*axes) if geographic is None else geographic
        rows, bad = _read(table, *labels, on_globe=on_globe)
    left_out = bad_rows_left_out(path, bad[:SHOWN_BAD_ROWS], len(bad))
    if not rows:
        raise ValueError("\n".join([f"{path} has no points", *left_out]))
    found = f"{path}: {plural(len(rows), 'point')} from columns {axes[0]} and {axes[1]}"
    return PointFile(rows, axes, on_globe, [*table.notes, found, *left_out])


def bad_rows_left_out(name: Path | str, first: Sequence[str], count: int) -> list[str]:
    """Lines about `count` bad rows of an input, with the first ones; none where `count` is 0."""
    if not count:
        return []
    more = [f"  ... and {count - len(first):,} more"] if count > len(first) else []
    return [f"{name}: {plural(count, 'bad row')} left out:", *(f"  {each}" for each in first), *more]


def _read(table: CsvTable, time: int | None, identity: int | None, *, on_globe: bool) -> tuple[list[Row], list[str]]:
    """Good rows, and a reason for each bad one."""
    records = [(line, row, dict(enumerate(row))) for line, row in numbered(table.rows, table.first_line)]
    places = table.x, table.y
    mark = decimal_mark((fields.get(place, "") for *_, fields in records for place in places), table.delimiter)
    rows, bad = [], []
    for line, row, fields in records:
        try:
            table.require_whole(row)
            x, y = (coordinate(fields.get(place), table.names[place], mark) for place in places)
            if on_globe and (problem := why_no_place(x, y)):
                raise ValueError(problem)
            when, name = (_label(fields, table.names, place) for place in (time, identity))
        except ValueError as reason:
            bad.append(f"line {line}: {reason}")
            continue
        rows.append((when, name or str(line), (x, y)))
    return rows, bad


def _label(fields: dict[int, str], names: list[str], place: int | None) -> str:
    """The text in a column; empty without a column."""
    if place is None:
        return ""
    if not fields.get(place):
        raise ValueError(f"{names[place]} is missing")
    return fields[place]
