"""Points of a CSV file."""

import numpy as np

from ..columns import coordinate, decimal_mark, plain
from ..csv_table import CsvFormat, CsvTable, UnclearTableError, csv_table, numbered
from .chunks import CHUNK_ROWS, Chunk, Chunks, Position, cut, picked
from .options import Format
from .source import Source


def read_csv(source: Source) -> Chunks:
    """Chunks of points from the columns of x and y."""
    options = source.options
    delimiter = "tab" if source.format is Format.TSV else options.delimiter
    given = CsvFormat(options.x, options.y, delimiter, options.header, options.encoding)
    try:
        with csv_table(source.name, source.file, given) as table:
            source.notes.extend(table.notes)
            yield from _chunks(table, options.decimal)
    except UnclearTableError as error:
        raise ValueError(f"{error}; {error.advice}") from None


def _chunks(table: CsvTable, decimal: str | None) -> Chunks:
    line = table.first_line
    for rows in cut(table.rows, CHUNK_ROWS):
        if decimal is None:
            texts = (row[place] for row in rows for place in (table.x, table.y) if place < len(row))
            decimal = decimal_mark(texts, table.delimiter)
        yield _chunk(rows, line, table, decimal)
        line = table.next_line()


def _chunk(rows: list[list[str]], line: int, table: CsvTable, decimal: str) -> Chunk:
    """The points of rows that begin on that line."""
    places = table.x, table.y
    try:
        texts = [[row[place] for row in rows] for place in places]
        # One check for all: a number with _ or with the other decimal mark is looked at below, row by row.
        plain("".join(map("".join, texts)), decimal)
        if decimal != ".":
            texts = [[text.replace(decimal, ".") for text in column] for column in texts]
        points = np.array([[float(text) for text in column] for column in texts]).T
    except (ValueError, IndexError):
        points = np.full((1, 2), np.nan)
    if np.isfinite(points).all():
        return Chunk(points + 0.0)

    def positions(row: list[str]) -> list[Position]:
        x, y = (coordinate(row[place] if place < len(row) else None, table.names[place], decimal) for place in places)
        return [(x, y)]

    return picked(((f"line {at}", row) for at, row in numbered(rows, line)), positions, ",".join)
