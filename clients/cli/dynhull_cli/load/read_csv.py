"""Points of a CSV file with a header."""

import csv
import io
from itertools import accumulate
from typing import IO

import numpy as np

from ..csv_points import coordinate, coordinate_columns
from .chunks import CHUNK_ROWS, Chunk, Chunks, cut, picked


def read_csv(name: str, file: IO[bytes], x: str | None, y: str | None) -> Chunks:
    """Chunks of points from the columns of x and y; ValueError where the header does not have them."""
    text = io.TextIOWrapper(file, "utf-8-sig", errors="replace", newline="")
    reader = csv.reader(text)
    try:
        header = next(reader, [])
        if not header:
            raise ValueError(f"{name} is empty: it needs a header line with the names of its columns")
        columns = coordinate_columns(name, header, x, y)
        places = header.index(columns[0]), header.index(columns[1])
        line = reader.line_num + 1
        for rows in cut(reader, CHUNK_ROWS):
            yield _chunk(rows, line, places, columns)
            line = reader.line_num + 1
    except csv.Error as error:
        raise ValueError(f"{name}, line {reader.line_num}: {error}") from None
    finally:
        text.detach()


def _chunk(rows: list[list[str]], line: int, places: tuple[int, int], columns: tuple[str, str]) -> Chunk:
    """The points of rows, the first of which is on that line."""
    try:
        points = np.array([[float(row[place]) for row in rows] for place in places]).T
    except (ValueError, IndexError):
        points = np.full((1, 2), np.nan)
    if np.isfinite(points).all():
        return Chunk(points + 0.0)

    def position(row: list[str]) -> tuple[float, float]:
        texts = (row[place] if place < len(row) else None for place in places)
        x, y = map(coordinate, texts, columns)
        return x, y

    # One by one takes several times as long. A row may go over several lines, and one without columns is none.
    lines = accumulate((1 + sum(text.count("\n") for text in row) for row in rows), initial=line)
    return picked(((f"line {first}", row) for first, row in zip(lines, rows, strict=False) if row), position, ",".join)
