"""Points of a Parquet or GeoParquet file."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..reading.columns import column_index, coordinate_columns
from ..reading.labels import Labels
from ..reading.values import coordinate
from .chunks import CHUNK_ROWS, Chunk, Chunks, Numbers, Position, Rows, picked
from .geometry import positions
from .source import Source
from .wkb import decode

BUFFER_BYTES = 2**20  # without one, and with pre_buffer, whole row groups are in memory
GEO_KEY = b"geo"  # of the schema's metadata, by the GeoParquet specification
WKB_POINTS = np.dtype([("order", "u1"), ("type", "<u4"), ("xy", "<f8", (2,))])
LITTLE_ENDIAN, POINT = 1, 1
ROW = "row"


def read_parquet(source: Source) -> Chunks:
    """Chunks of points, a few rows at a time, from the columns of x and y or from GeoParquet's geometry column."""
    if not source.file.seekable():
        raise ValueError(f"{source.name} is a pipe, and Parquet is read from its end: write it to a file first")
    try:
        parquet = pq.ParquetFile(source.file, pre_buffer=False, buffer_size=BUFFER_BYTES)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{source.name} is not a Parquet file: {error}") from None
    geometry = None if source.options.x or source.options.y else _geometry_column(source.name, parquet.schema_arrow)
    if geometry is None:
        yield from _of_columns(source, parquet)
    else:
        source.notes.append(f"{source.name}: points from the geometry column {geometry}")
        if _in_degrees(parquet.schema_arrow, geometry):
            source.in_degrees()
        yield from _of_geometries(source, parquet, geometry)


def _of_columns(source: Source, parquet: Any) -> Chunks:
    schema = parquet.schema_arrow
    names = [schema.names[i] for i in coordinate_columns(source.name, schema.names, source.options.x, source.options.y)]
    source.axes.extend(names)
    for name in names:
        kind = schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
            raise ValueError(f"{source.name}: column {name} holds {kind}, not numbers")
    first = 1
    more, labels = _label_columns(source, schema.names)
    for batch in parquet.iter_batches(CHUNK_ROWS, columns=[*names, *filter(None, more)]):
        yield _chunk([batch[name] for name in names], names, first, _labels_of(batch, more, labels))
        first += len(batch)


def _label_columns(
    source: Source, names: list[str]
) -> tuple[list[str | None], Callable[[Any, Any, Any], Labels] | None]:
    """The columns of the labels, None where there is none, and what reads them."""
    columns = [
        None if name is None else names[column_index(source.name, names, option, name)]
        for option, name in source.options.labels
    ]
    return columns, source.label_reader()


def _labels_of(
    batch: Any, columns: list[str | None], read: Callable[[Any, Any, Any], Labels] | None
) -> Callable[[int], Labels] | None:
    """Reads the labels of a row of the batch, given by its number."""
    if read is None:
        return None
    values = [[None] * len(batch) if name is None else batch[name].to_pylist() for name in columns]
    return lambda row: read(*(column[row] for column in values))


def _chunk(arrays: list[Any], names: list[str], first: int, labels: Callable[[int], Labels] | None) -> Chunk:
    points = np.stack([each.cast(pa.float64()).to_numpy(zero_copy_only=False) for each in arrays], axis=1)
    if labels is None and np.isfinite(points).all():
        return Chunk(Rows(points + 0.0, _numbers(first, len(points)), ROW))
    rows = list(zip(*(each.to_pylist() for each in arrays), strict=True))

    def position(row: int) -> list[Position]:
        x, y = map(coordinate, (None if value is None else str(value) for value in rows[row]), names)
        return [(x, y)]

    return picked(ROW, enumerate(range(len(rows)), first), position, lambda row: str(rows[row]), labels)


def _geometry_column(name: str, schema: Any) -> str | None:
    """The primary geometry column of GeoParquet, None for other files; ValueError for an unsupported encoding."""
    if GEO_KEY not in (schema.metadata or {}):
        return None
    geo = json.loads(schema.metadata[GEO_KEY])
    column = str(geo["primary_column"])
    encoding = geo["columns"][column]["encoding"]
    if encoding not in ("WKB", "point"):
        raise ValueError(f"{name}: the geometry column {column} is encoded as {encoding}; WKB and point can be read")
    return column


def _in_degrees(schema: Any, column: str) -> bool:
    """Whether the geometries are longitudes and latitudes: the default of GeoParquet, or by PROJJSON."""
    crs = json.loads(schema.metadata[GEO_KEY])["columns"][column].get("crs", {"type": "GeographicCRS"})
    return isinstance(crs, dict) and crs.get("type") == "GeographicCRS"


def _of_geometries(source: Source, parquet: Any, column: str) -> Chunks:
    first = 1
    more, read = _label_columns(source, parquet.schema_arrow.names)
    for batch in parquet.iter_batches(CHUNK_ROWS, columns=[column, *filter(None, more)]):
        array, labels = batch[column], _labels_of(batch, more, read)
        if pa.types.is_struct(array.type):
            yield _chunk([pc.struct_field(array, axis) for axis in ("x", "y")], ["x", "y"], first, labels)
        else:
            yield _of_binaries(array.to_pylist(), first, source.options.vertices, labels)
        first += len(batch)


def _of_binaries(
    rows: list[bytes | None], first: int, every_vertex: bool, labels: Callable[[int], Labels] | None
) -> Chunk:
    points = None if labels is not None else _wkb_points(rows)
    if points is not None:
        return Chunk(Rows(points, _numbers(first, len(points)), ROW))

    def of_row(row: int) -> list[Position]:
        data = rows[row]
        return positions(None if data is None else decode(data), every_vertex)

    return picked(ROW, enumerate(range(len(rows)), first), of_row, lambda row: _hex(rows[row]), labels)


def _wkb_points(rows: list[bytes | None]) -> Any:
    """The points where all rows are plain little-endian ones, which is the usual case; otherwise None."""
    if any(row is None or len(row) != WKB_POINTS.itemsize for row in rows):
        return None
    found = np.frombuffer(b"".join(filter(None, rows)), WKB_POINTS)
    usual = (found["order"] == LITTLE_ENDIAN).all() and (found["type"] == POINT).all()
    return found["xy"] + 0.0 if usual and np.isfinite(found["xy"]).all() else None


def _numbers(first: int, count: int) -> Numbers:
    return np.arange(first, first + count)


def _hex(data: bytes | None) -> str:
    return "" if data is None else data.hex()
