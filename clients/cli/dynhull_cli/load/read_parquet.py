"""Points of a Parquet or GeoParquet file."""

import json
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..reading.columns import coordinate_columns
from .arrow_rows import ArrowTable
from .chunks import CHUNK_ROWS, Chunks
from .source import Source

BUFFER_BYTES = 2**20  # without one, and with pre_buffer, whole row groups are in memory
GEO_KEY = b"geo"  # of the schema's metadata, by the GeoParquet specification


def read_parquet(source: Source) -> Chunks:
    """Chunks of points, a few rows at a time, from the columns of x and y or from GeoParquet's geometry column."""
    if not source.file.seekable():
        raise ValueError(f"{source.name} is a pipe, and Parquet is read from its end: write it to a file first")
    try:
        parquet = pq.ParquetFile(source.file, pre_buffer=False, buffer_size=BUFFER_BYTES)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{source.name} is not a Parquet file: {error}") from None
    geometry = None if source.options.x or source.options.y else _geometry_column(source.name, parquet.schema_arrow)
    table = ArrowTable(
        source, parquet.schema_arrow.names, lambda columns: parquet.iter_batches(CHUNK_ROWS, columns=columns)
    )
    if geometry is None:
        yield from table.of_columns(*_coordinates(source, parquet.schema_arrow))
    else:
        source.notes.append(f"{source.name}: points from the geometry column {geometry}")
        if _in_degrees(parquet.schema_arrow, geometry):
            source.in_degrees()
        yield from table.of_geometries(geometry)


def _coordinates(source: Source, schema: Any) -> list[str]:
    """The columns of x and y; ValueError where they are not there, or hold something else than numbers."""
    names = [schema.names[i] for i in coordinate_columns(source.name, schema.names, source.options.x, source.options.y)]
    for name in names:
        kind = schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
            raise ValueError(f"{source.name}: column {name} holds {kind}, not numbers")
    return names


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
