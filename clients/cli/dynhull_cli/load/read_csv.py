"""Points of a CSV file."""

from collections.abc import Callable

import numpy as np

from ..csv_table import CsvFormat, CsvTable, UnclearTableError, csv_table, numbered
from ..reading.columns import column_index, decimal_mark
from ..reading.labels import Labels
from ..reading.values import LARGEST_EXACT, coordinate, plain
from .chunks import CHUNK_ROWS, LINE, Chunk, Chunks, Numbers, Points, Position, Rows, cut, picked
from .geometry_column import GeometryColumn
from .options import Format
from .source import Source

OfRow = Callable[[list[str]], Labels]
"""Reads the labels of a row."""


def read_csv(source: Source) -> Chunks:
    """Chunks of points from the columns of x and y, or from a column of geometries."""
    options = source.options
    delimiter = "tab" if source.format is Format.TSV else options.delimiter
    encoding = options.encoding, source.keep_bytes
    given = CsvFormat(options.x, options.y, delimiter, options.header, *encoding, True, options.geometry)
    try:
        with csv_table(source.name, source.file, given) as table:
            source.notes.extend(table.notes)
            labels = _labels(source, table)
            if table.geometry is not None:
                yield from _of_geometries(source, table, table.geometry, labels)
                return
            source.axes.extend((table.names[table.x], table.names[table.y]))
            yield from _chunks(table, options.decimal, labels)
    except UnclearTableError as error:
        raise ValueError(f"{error}; {error.advice}") from None


def _labels(source: Source, table: CsvTable) -> OfRow | None:
    """Reads the labels of a row; None if there are no columns of them."""
    read = source.label_reader()
    if read is None:
        return None
    places = [
        None if column is None else column_index(source.name, table.names, option, column)
        for option, column in source.options.labels
    ]

    def labels(row: list[str]) -> Labels:
        return read(*(None if place is None or place >= len(row) else row[place] for place in places))

    return labels


def _of_geometries(source: Source, table: CsvTable, place: int, labels: OfRow | None) -> Chunks:
    name = table.names[place]
    source.notes.append(f"{source.name}: points from the geometry column {name}")
    geometries = GeometryColumn(source, name, system_known=False)

    def positions(row: list[str]) -> list[Position]:
        table.require_whole(row)
        return geometries.positions(row[place] if place < len(row) else None)

    line = table.first_line
    for rows in cut(table.rows, CHUNK_ROWS):
        following = table.next_line()
        points = None
        if labels is None and not table.text.kept and {*map(len, rows)} == {len(table.names)}:
            points = geometries.points([row[place] for row in rows])
        if points is None:
            yield picked(LINE, numbered(rows, line), positions, ",".join, labels)
        else:
            yield Chunk(Rows(points, _lines(rows, line, following), LINE))
        line = following


def _chunks(table: CsvTable, decimal: str | None, labels: OfRow | None) -> Chunks:
    line = table.first_line
    for rows in cut(table.rows, CHUNK_ROWS):
        if decimal is None:
            texts = (row[place] for row in rows for place in (table.x, table.y) if place < len(row))
            decimal = decimal_mark(texts, table.delimiter)
        following = table.next_line()
        yield _chunk(rows, line, following, table, decimal, labels)
        line = following


def _chunk(
    rows: list[list[str]],
    line: int,
    following: int,
    table: CsvTable,
    decimal: str,
    labels: OfRow | None,
) -> Chunk:
    """The points of rows that begin on that line; `following` is the one after them."""
    places = table.x, table.y
    points = None if labels is not None or table.text.kept else _all_points(rows, places, decimal, len(table.names))
    if points is not None:
        return Chunk(Rows(points, _lines(rows, line, following), LINE))

    def positions(row: list[str]) -> list[Position]:
        table.require_whole(row)
        x, y = (coordinate(row[place] if place < len(row) else None, table.names[place], decimal) for place in places)
        return [(x, y)]

    return picked(LINE, numbered(rows, line), positions, ",".join, labels)


def _lines(rows: list[list[str]], line: int, following: int) -> Numbers:
    """The lines of rows that begin on that line; `following` is the one after them."""
    one_each = following - line == len(rows)
    return np.array(range(line, following) if one_each else [at for at, _ in numbered(rows, line)], np.int64)


def _all_points(rows: list[list[str]], places: tuple[int, int], decimal: str, columns: int) -> Points | None:
    """The points of the rows, which is the usual case; None if one needs a look: not two numbers, large, too long."""
    if max(map(len, rows)) > columns:
        return None
    try:
        texts = [[row[place] for row in rows] for place in places]
        # One check for all: a number with _ or with the other decimal mark is looked at below, row by row.
        plain("".join(map("".join, texts)), decimal)
        if decimal != ".":
            texts = [[text.replace(decimal, ".") for text in column] for column in texts]
        points = np.array([[float(text) for text in column] for column in texts]).T
    except (ValueError, IndexError):
        return None
    return points + 0.0 if (np.abs(points) < LARGEST_EXACT).all() else None
