"""Points from GeoJSON, geometries of other libraries and data frames. Imports none of these libraries."""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

COLUMN_NAMES = (
    ("x", "y"),
    ("lon", "lat"),
    ("lng", "lat"),
    ("long", "lat"),
    ("longitude", "latitude"),
    ("easting", "northing"),
)
"""Names of columns that hold coordinates, x before y, in lower case."""
LARGEST_EXACT_INTEGER = 2**53
SHAPELY_POINT = 0
READ_OTHERWISE = {"pandas", "polars"}


def coordinates_of(source: Any, name: str, *, on_globe: bool | None = False) -> Any:
    """The (n, 2) coordinates in a source of points; any other object unchanged.

    * an object with `__geo_interface__`, such as shapely's geometries, or GeoJSON as a dictionary: every vertex once
    * a list, array or GeoSeries of such objects, or a GeoDataFrame
    * an array or a stream of Arrow (PyCapsule interface): points of GeoArrow, WKB; of a table, the column of that type
    * a frame (pandas, polars, pyarrow; polars' lazy frames and series of structs): its two columns with names such as
      x and y, or lon and lat, in any order; the two columns of a frame that has no others

    Where a source names its coordinate reference system, and `on_globe` says what the points are for: a warning for
    degrees that are for a plane.

    Raises:
        ValueError: a geometry is missing or empty, or a frame has no or several such pairs of columns; or coordinates
            for the globe are no degrees.
    """
    source = _polars_frame(source)
    if isinstance(source, list | tuple) or (isinstance(source, np.ndarray) and source.ndim):
        return _of_geometries(source, name) if len(source) and is_geometry(source[0]) else source
    series: Any = getattr(source, "geometry", None) if is_geometry(source) else None
    if hasattr(series, "to_numpy"):  # of a GeoSeries or a GeoDataFrame
        _require_frame(getattr(series, "crs", None), name, on_globe)
        return _of_geometries(series.to_numpy(), name)
    if _is_arrow(source):
        from ._arrow import geometries_of

        found = geometries_of(source, name)
        if found is not None:
            _require_frame(found.system, name, on_globe)
            return found.coordinates if found.geometries is None else _of_geometries(found.geometries, name)
    if hasattr(source, "columns"):
        return _of_frame(source, name)
    return list(_positions(geojson_of(source), name)) if is_geometry(source) else source


def _polars_frame(source: Any) -> Any:
    """A frame for what is one in polars by another name; anything else unchanged."""
    polars = sys.modules.get("polars")
    if polars is None:
        return source
    if isinstance(source, polars.LazyFrame):
        return source.collect()
    # numpy would take the fields of a struct by their place: latitude, longitude as x, y
    return source.struct.unnest() if isinstance(source, polars.Series) and source.dtype == polars.Struct else source


def _require_frame(system: Any, name: str, on_globe: bool | None) -> None:
    if on_globe is not None and system is not None:
        from .crs import require_frame

        require_frame(system, name, on_globe=on_globe)


def _is_arrow(source: Any) -> bool:
    """Whether it offers Arrow, and is of no package whose objects are read otherwise. Asks the class."""
    kind = type(source)
    offers = hasattr(kind, "__arrow_c_array__") or hasattr(kind, "__arrow_c_stream__")
    return offers and kind.__module__.partition(".")[0] not in READ_OTHERWISE


def is_geometry(value: Any) -> bool:
    """Whether it is GeoJSON or makes some. Asks the class: a large GeoSeries takes a minute to make its GeoJSON."""
    return hasattr(type(value), "__geo_interface__") or (isinstance(value, Mapping) and "type" in value)


def geojson_of(value: Any) -> Mapping[str, Any]:
    geojson: Mapping[str, Any] = value if isinstance(value, Mapping) else value.__geo_interface__
    return geojson


def _of_geometries(geometries: Sequence[Any] | npt.NDArray[Any], name: str) -> Any:
    shapely = sys.modules.get("shapely")
    if shapely is not None:
        array = np.empty(len(geometries), np.object_)
        array[:] = geometries
        if shapely.is_geometry(array).all() and (shapely.get_type_id(array) == SHAPELY_POINT).all():
            empty = np.flatnonzero(shapely.is_empty(array))
            if empty.size:
                raise ValueError(f"{name} row {empty[0]} is an empty Point: it has no coordinates")
            return shapely.get_coordinates(array)
    found: list[Sequence[float]] = []
    for row, geometry in enumerate(geometries):
        if not is_geometry(geometry):
            raise ValueError(f"{name} row {row} is {geometry!r}: must be a geometry, as row 0 is")
        found.extend(_positions(geojson_of(geometry), f"{name} row {row}"))
    return found


def _positions(geojson: Mapping[str, Any], name: str) -> Iterator[Sequence[float]]:
    """Every vertex once: rings repeat their first one at the end."""
    kind = geojson.get("type")
    coordinates: Any = geojson.get("coordinates")
    match kind:
        case "FeatureCollection":
            for row, feature in enumerate(geojson["features"]):
                yield from _positions(feature, f"{name} row {row}")
        case "Feature" if geojson["geometry"] is None:
            raise ValueError(f"{name} is a Feature without geometry: leave it out")
        case "Feature":
            yield from _positions(geojson["geometry"], name)
        case "GeometryCollection":
            for geometry in geojson["geometries"]:
                yield from _positions(geometry, name)
        case "Point" if not coordinates:
            raise ValueError(f"{name} is an empty Point: it has no coordinates")
        case "Point":
            yield coordinates[:2]
        case "MultiPoint" | "LineString":
            yield from _plane(coordinates)
        case "MultiLineString":
            for line in coordinates:
                yield from _plane(line)
        case "LinearRing":
            yield from _plane(coordinates[:-1])
        case "Polygon":
            for ring in coordinates:
                yield from _plane(ring[:-1])
        case "MultiPolygon":
            for polygon in coordinates:
                for ring in polygon:
                    yield from _plane(ring[:-1])
        case _:
            raise ValueError(f"{name} is of the type {kind!r}: not a GeoJSON geometry")


def _plane(positions: Iterable[Sequence[float]]) -> Iterator[Sequence[float]]:
    return (position[:2] for position in positions)  # a third number is a height


def _of_frame(frame: Any, name: str) -> npt.NDArray[Any]:
    columns = list(getattr(frame, "column_names", frame.columns))
    chosen = coordinate_columns(columns)
    if chosen is None:
        listed = ", ".join(map(str, columns))
        example = [str(column) for column in columns[:2]]
        raise ValueError(f"{name} has the columns {listed}: choose two, x first, as in frame[{example}]")
    x, y = (_exact(np.asarray(frame[column])) for column in chosen)
    if x.dtype != y.dtype:  # numpy would round large integers to join them with floats
        x, y = x.astype(np.object_), y.astype(np.object_)
    return np.column_stack((x, y))


def coordinate_columns(columns: Sequence[Any]) -> tuple[Any, Any] | None:
    """The two columns of a frame that hold coordinates, x first, by their names; None if they do not say which."""
    lower = [str(column).lower() for column in columns]
    pairs = [pair for pair in COLUMN_NAMES if all(lower.count(each) == 1 for each in pair)]
    if len(pairs) == 1:
        x, y = (columns[lower.index(each)] for each in pairs[0])
        return x, y
    if len(columns) == 2 and not _other_way_round(lower):
        return columns[0], columns[1]
    return None


def _other_way_round(names: Sequence[str]) -> bool:
    """Whether two columns have one name, or one has a name for the other coordinate."""
    first, second = names
    xs, ys = zip(*COLUMN_NAMES, strict=True)
    return first == second or first in ys or second in xs


def _exact(column: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Integers as doubles if that changes none of them."""
    if column.dtype.kind not in "iu" or not column.size:
        return column
    exact = int(column.min()) >= -LARGEST_EXACT_INTEGER and int(column.max()) <= LARGEST_EXACT_INTEGER
    return column.astype(np.float64) if exact else column
