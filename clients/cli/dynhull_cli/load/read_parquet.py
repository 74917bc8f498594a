"""Points of a Parquet file."""

from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..csv_points import coordinate, coordinate_columns
from .chunks import CHUNK_ROWS, Chunk, Chunks, picked

BUFFER_BYTES = 2**20  # without one, and with pre_buffer, whole row groups are in memory


def read_parquet(name: str, file: IO[bytes], x: str | None, y: str | None) -> Chunks:
    """Chunks of points from the columns of x and y, read a few rows at a time."""
    if not file.seekable():
        raise ValueError(f"{name} is a pipe, and Parquet is read from its end: write it to a file first")
    try:
        parquet = pq.ParquetFile(file, pre_buffer=False, buffer_size=BUFFER_BYTES)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{name} is no Parquet file: {error}") from None
    schema = parquet.schema_arrow
    columns = coordinate_columns(name, schema.names, x, y)
    for column in columns:
        kind = schema.field(column).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
            raise ValueError(f"{name}: column {column} holds {kind}, not numbers")
    first = 1
    for batch in parquet.iter_batches(CHUNK_ROWS, columns=list(columns)):
        yield _chunk([batch[column] for column in columns], columns, first)
        first += len(batch)


def _chunk(arrays: list[Any], columns: tuple[str, str], first: int) -> Chunk:
    points = np.stack([each.cast(pa.float64()).to_numpy(zero_copy_only=False) for each in arrays], axis=1)
    if np.isfinite(points).all():
        return Chunk(points + 0.0)

    def position(row: tuple[Any, ...]) -> tuple[float, float]:
        x, y = map(coordinate, (None if value is None else str(value) for value in row), columns)
        return x, y

    rows = zip(*(each.to_pylist() for each in arrays), strict=True)
    return picked(((f"row {i}", row) for i, row in enumerate(rows, start=first)), position)
