"""Points of a Parquet or GeoParquet file."""

import json
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..reading.columns import coordinate_columns, geometry_column
from .arrow_rows import ArrowTable
from .chunks import CHUNK_ROWS, Chunks
from .reference_system import note_reference_system
from .source import Source

BUFFER_BYTES = 2**20  # without one, and with pre_buffer, whole row groups are in memory
GEO_KEY = b"geo"  # of the schema's metadata, by the GeoParquet specification
LOGICAL_TYPES = "Geometry", "Geography"  # of Parquet, since 2025
EXTENSION, EXTENSION_METADATA = b"ARROW:extension:name", b"ARROW:extension:metadata"
GEOARROW = "geoarrow."
DEGREES = "OGC:CRS84"  # the default of GeoParquet and of Parquet's own types


def read_parquet(source: Source) -> Chunks:
    """Chunks of points, a few rows at a time, from the columns of x and y or from a column of geometries."""
    if not source.file.seekable():
        raise ValueError(f"{source.name} is a pipe, and Parquet is read from its end: write it to a file first")
    try:
        parquet = pq.ParquetFile(source.file, pre_buffer=False, buffer_size=BUFFER_BYTES)
    except pa.ArrowInvalid as error:
        raise ValueError(f"{source.name} is not a Parquet file: {error}") from None
    names = parquet.schema_arrow.names
    table = ArrowTable(source, names, lambda columns: parquet.iter_batches(CHUNK_ROWS, columns=columns))
    options = source.options
    systems = {} if options.x or options.y else _of_geoparquet(source.name, parquet) or _of_types(parquet)
    column = options.geometry or next(iter(systems), None)
    column = geometry_column(source.name, names, options.x, options.y, column)
    if column is None:
        yield from table.of_columns(*_coordinates(source, parquet.schema_arrow))
        return
    source.notes.append(f"{source.name}: points from the geometry column {column}")
    system = systems.get(column)
    if system is not None:
        note_reference_system(source, system, f"the column {column}")
    yield from table.of_geometries(column, system_known=system is not None)


def _coordinates(source: Source, schema: Any) -> list[str]:
    """The columns of x and y; ValueError where they are not there, or hold something else than numbers."""
    names = [schema.names[i] for i in coordinate_columns(source.name, schema.names, source.options.x, source.options.y)]
    for name in names:
        kind = schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
            raise ValueError(f"{source.name}: column {name} holds {kind}, not numbers")
    return names


def _of_geoparquet(name: str, parquet: Any) -> dict[str, Any]:
    """The primary geometry column of GeoParquet with its coordinate reference system; empty for other files.

    ValueError for an unsupported encoding.
    """
    metadata = parquet.schema_arrow.metadata or {}
    if GEO_KEY not in metadata:
        return {}
    geo = json.loads(metadata[GEO_KEY])
    column = str(geo["primary_column"])
    described = geo["columns"][column]
    encoding = described["encoding"]
    if encoding not in ("WKB", "point"):
        raise ValueError(f"{name}: the geometry column {column} is encoded as {encoding}; WKB and point can be read")
    return {column: described.get("crs", DEGREES)}


def _of_types(parquet: Any) -> dict[str, Any]:
    """The columns that are geometries by their types, each with its coordinate reference system, None without one."""
    found = {}
    for field in parquet.schema_arrow:
        extension, described = _extension(field)
        if extension.startswith(GEOARROW):
            found[field.name] = json.loads(described or b"{}").get("crs")
    for index in range(len(parquet.schema)):
        column = parquet.schema.column(index)
        kind = json.loads(column.logical_type.to_json())
        if kind["Type"] in LOGICAL_TYPES:
            found[column.path] = _system(kind.get("crs", DEGREES), parquet.metadata.metadata or {})
    return found


def _extension(field: Any) -> tuple[str, bytes]:
    """The name and the description of an extension type, whether or not this process has a class of it."""
    if isinstance(field.type, pa.ExtensionType):
        return field.type.extension_name, field.type.__arrow_ext_serialize__()
    metadata = field.metadata or {}
    return metadata.get(EXTENSION, b"").decode(), metadata.get(EXTENSION_METADATA, b"")


def _system(name: str, metadata: dict[bytes, bytes]) -> Any:
    """The coordinate reference system of a type of Parquet: PROJJSON beside it, an SRID, or a name."""
    kind, _, value = name.partition(":")
    match kind:
        case "projjson":
            return json.loads(metadata.get(value.encode(), b"null"))
        case "srid":
            return f"EPSG:{value}"
        case _:
            return name
