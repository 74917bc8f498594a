"""Points from Arrow, by its interface for Python (PyCapsule): the types of GeoArrow, and columns that look like them.

The only part of the library that needs pyarrow, and shapely for well-known binary and text.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

STREAM = "__arrow_c_stream__"
GEOARROW = "geoarrow."
EXTENSION, METADATA = b"ARROW:extension:name", b"ARROW:extension:metadata"
AXES = ["x", "y"]


class Geometries(NamedTuple):
    """What a source of Arrow holds.

    Attributes:
        coordinates: (n, 2) coordinates; None for geometries.
        geometries: those of shapely; None for coordinates.
        system: the coordinate reference system that the source names; None without one.
    """

    coordinates: Any
    geometries: Any
    system: Any


def geometries_of(source: Any, name: str) -> Geometries | None:
    """The points or geometries of a source of Arrow; None if it has none, such as a table of numbers.

    Raises:
        ValueError: a geometry is null, or of a type of GeoArrow that is not read.
        ImportError: pyarrow or shapely is not installed.
    """
    try:
        import pyarrow as pa
    except ModuleNotFoundError:
        raise ImportError("points of Arrow need pyarrow: pip install 'dynhull[files]'") from None

    field, array = _imported(pa, source)
    if pa.types.is_struct(field.type) and not _has_axes(field.type):  # a table
        columns = [column for column in field.type if _extension(pa, column)[0].startswith(GEOARROW)]
        if not columns:
            return None
        field, name = columns[0], f"{name} column {columns[0].name}"
        array = pa.chunked_array([chunk.field(field.name) for chunk in array.chunks], type=field.type)
    extension, system = _extension(pa, field)
    if isinstance(field.type, pa.ExtensionType):
        array = pa.chunked_array([chunk.storage for chunk in array.chunks], type=field.type.storage_type)
    kind = array.type
    if array.null_count and (extension or not pa.types.is_string(kind)):
        raise ValueError(f"{name} row {array.is_null().to_pylist().index(True)} is null: leave it out")
    if pa.types.is_struct(kind):
        axes = [_numbers([chunk.field(axis) for chunk in array.chunks]) for axis in AXES]
        return Geometries(np.column_stack(axes), None, system)
    if pa.types.is_fixed_size_list(kind) and pa.types.is_floating(kind.value_type) and kind.list_size >= len(AXES):
        flat = _numbers([chunk.flatten() for chunk in array.chunks])
        return Geometries(flat.reshape(-1, kind.list_size)[:, : len(AXES)], None, system)
    if pa.types.is_binary(kind) or pa.types.is_large_binary(kind):
        return Geometries(None, _decoded("from_wkb", array, f"{name} are not well-known binary"), system)
    if extension == f"{GEOARROW}wkt":
        return Geometries(None, _decoded("from_wkt", array, f"{name} are not well-known text"), system)
    if extension.startswith(GEOARROW):
        raise ValueError(f"{name} are {extension}: points, WKB and WKT of GeoArrow are read")
    return None


def _imported(pa: Any, source: Any) -> tuple[Any, Any]:
    """The field, with what it says of its type, and the chunks of a source."""
    if hasattr(source, STREAM):
        array = pa.chunked_array(source)
        return pa.field("", array.type), array
    schema, _ = source.__arrow_c_array__()
    field = pa.Field._import_from_c_capsule(schema)  # an array of an unknown extension type has only its storage
    return field, pa.chunked_array([pa.array(source)], type=None)


def _has_axes(kind: Any) -> bool:
    return all(kind.get_field_index(axis) >= 0 for axis in AXES)


def _extension(pa: Any, field: Any) -> tuple[str, Any]:
    """The name of an extension type, empty for others, and the coordinate reference system in its description."""
    if isinstance(field.type, pa.ExtensionType):
        name, described = field.type.extension_name, field.type.__arrow_ext_serialize__()
    else:
        metadata = field.metadata or {}
        name, described = metadata.get(EXTENSION, b"").decode(), metadata.get(METADATA, b"")
    return name, json.loads(described or b"{}").get("crs") if name.startswith(GEOARROW) else None


def _numbers(arrays: list[Any]) -> Any:
    parts = [each.to_numpy(zero_copy_only=False) for each in arrays]
    return np.concatenate(parts) if parts else np.empty(0)


def _decoded(decode: str, array: Any, problem: str) -> Any:
    """Geometries of shapely, from a column of bytes or texts."""
    try:
        import shapely
    except ModuleNotFoundError:
        raise ImportError("geometries of Arrow need shapely: pip install 'dynhull[files]'") from None
    try:
        return getattr(shapely, decode)(array.to_pylist())
    except shapely.errors.ShapelyError as error:
        raise ValueError(f"{problem}: {error}") from None
