"""Rows of bodies: points and keys as newline-delimited JSON, CSV and GeoJSON."""

import csv
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
from typing import Annotated, Any, Literal, NamedTuple, NotRequired

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import from_json
from typing_extensions import TypedDict

from .invalid import detail, path_in
from .problems import cut, pointer, shown
from .schemas import Key, Number, Point, Time

FORBID = ConfigDict(extra="forbid")
KEY_AND_TIME = "key", "time"
COLUMNS = "x", "y"


class Row(NamedTuple):
    """A point, a key, or both."""

    key: str | int | None
    point: Sequence[float] | None
    time: datetime | None


class RowError(Exception):
    """A row cannot be read. `row` is counted from the first one of the same call, `field` and `value` are at fault."""

    def __init__(self, row: int, detail: str, field: str | None = None, value: str | None = None) -> None:
        super().__init__(detail)
        self.row = row
        self.detail = detail
        self.field = field
        self.value = value


class XY(TypedDict):
    """A row with x and y."""

    __pydantic_config__ = FORBID  # type: ignore[misc]
    key: NotRequired[Key]
    time: NotRequired[Time]
    x: Number
    y: Number


class LonLat(TypedDict):
    """A row with lon and lat."""

    __pydantic_config__ = FORBID  # type: ignore[misc]
    key: NotRequired[Key]
    time: NotRequired[Time]
    lon: Number
    lat: Number


class KeyOnly(TypedDict):
    """A row that names a key to remove."""

    __pydantic_config__ = FORBID  # type: ignore[misc]
    key: Key


Reader = Callable[[Sequence[bytes]], list[Row]]
"""Reads some texts of a body, which are complete; RowError names the first that cannot be read."""

POINT = TypeAdapter(Point).validate_json
X_Y = TypeAdapter(XY).validate_json
LON_LAT = TypeAdapter(LonLat).validate_json
KEY_ONLY = TypeAdapter(KeyOnly).validate_json


def ndjson(lines: Sequence[bytes]) -> list[Row]:
    """Lines of [x, y], {"x": ..., "y": ...} or {"lon": ..., "lat": ...}, with "key" and "time" if wanted."""
    rows = []
    line = b""
    try:
        for line in lines:  # the row at fault
            if line.startswith(b"["):
                rows.append(Row(None, POINT(line), None))
            elif b'"lat"' in line:
                place = LON_LAT(line)
                rows.append(Row(place.get("key"), (place["lon"], place["lat"]), place.get("time")))
            else:
                given = X_Y(line)
                rows.append(Row(given.get("key"), (given["x"], given["y"]), given.get("time")))
    except ValidationError as error:
        raise _row_error(len(rows), error) from None
    return rows


def ndjson_to_delete(lines: Sequence[bytes]) -> list[Row]:
    """Lines of points as in `ndjson`, or of {"key": ...}."""
    rows: list[Row] = []
    for line in lines:
        try:
            rows += [Row(KEY_ONLY(line)["key"], None, None)] if b'"key"' in line else ndjson([line])
        except ValidationError as error:
            raise _row_error(len(rows), error) from None
        except RowError as error:
            raise RowError(len(rows), error.detail, error.field, error.value) from None
    return rows


class Csv:
    """Lines of CSV: first the names of the columns, x and y or lon and lat, and key and time if there are any.

    A row is one line, with as many fields as the first. Columns with other names are left out.
    """

    _NAMES = (("x", "y"), ("lon", "lat"), ("longitude", "latitude"))

    def __init__(self, *, delete: bool) -> None:
        self._delete = delete
        self._columns: dict[str, int] | None = None
        self._fields = 0

    def __call__(self, lines: Sequence[bytes]) -> list[Row]:
        """The rows of some lines."""
        if self._columns is None:
            if not lines:
                return []
            (first,) = _cells(lines[:1])
            self._columns = self._named([each.strip().lower() for each in first])
            self._fields = len(first)
            lines = lines[1:]
        columns = self._columns
        rows: list[Row] = []
        for row in _cells(lines):
            if len(row) != self._fields:
                detail = f"{len(row)} fields in a table of {self._fields} columns"
                raise RowError(len(rows), detail, None, cut(",".join(row)))
            rows.append(_typed({name: row[column] for name, column in columns.items()}, len(rows)))
        return rows

    def _named(self, header: list[str]) -> dict[str, int]:
        twice = next((name for name in header if header.count(name) > 1), None)
        if twice is not None:
            raise RowError(0, f"the first line names the column {twice!r} twice", "header", cut(",".join(header)))
        columns: dict[str, int] = {name: header.index(name) for name in KEY_AND_TIME if name in header}
        pair = next((pair for pair in self._NAMES if set(pair) <= set(header)), None)
        if pair is not None:
            columns |= {"x": header.index(pair[0]), "y": header.index(pair[1])}
        elif not (self._delete and "key" in columns):
            detail = "the first line must name the columns, separated by commas: x,y or lon,lat, and key, time"
            raise RowError(0, detail, "header", cut(",".join(header)))
        return columns


class PointGeometry(BaseModel):
    """A position."""

    type: Literal["Point"]
    coordinates: Point | tuple[Number, Number, Number]


class MultiPointGeometry(BaseModel):
    """Positions."""

    type: Literal["MultiPoint"]
    coordinates: list[Point | tuple[Number, Number, Number]]


Geometry = Annotated[PointGeometry | MultiPointGeometry, Field(discriminator="type")]


class FeatureProperties(BaseModel):
    """The property that is read."""

    time: AwareDatetime | None = None


class PointFeature(BaseModel):
    """A feature; its id is the key."""

    type: Literal["Feature"]
    id: Key | None = None
    geometry: Geometry
    properties: FeatureProperties | None = None


class PointCollection(BaseModel):
    """Features."""

    type: Literal["FeatureCollection"]
    features: list[PointFeature]


Geo = Annotated[PointCollection | PointFeature | PointGeometry | MultiPointGeometry, Field(discriminator="type")]
GEOJSON: TypeAdapter[Geo] = TypeAdapter(Geo)


def geojson(texts: Sequence[bytes]) -> list[Row]:
    """Texts of GeoJSON: points and multipoints, features of these, or a collection."""
    rows: list[Row] = []
    for text in texts:
        try:
            rows += _of_geojson(GEOJSON.validate_json(text))
        except ValidationError as error:
            raise _geojson_error(len(rows), text, error) from None
    return rows


def _of_geojson(geo: Geo) -> Iterator[Row]:
    match geo:
        case PointCollection():
            for feature in geo.features:
                yield from _of_geojson(feature)
        case PointFeature():
            time = None if geo.properties is None else geo.properties.time
            for row in _of_geojson(geo.geometry):
                yield Row(geo.id, row.point, time)
        case PointGeometry():
            yield Row(None, (geo.coordinates[0], geo.coordinates[1]), None)
        case MultiPointGeometry():
            yield from (Row(None, (x, y), None) for x, y, *_ in geo.coordinates)


def with_keys(rows: Iterable[Row], kind: str | None) -> list[Row]:
    """The rows with keys of a kind, "str" or "int"; None for without."""
    return [row._replace(key=_key(row.key, kind, number)) for number, row in enumerate(rows)]


def _key(key: str | int | None, kind: str | None, row: int) -> str | int | None:
    if key is None or kind is None:
        return None
    if kind == "str":
        return str(key)
    if isinstance(key, str) and not INTEGER.fullmatch(key):
        raise RowError(row, "must be an integer", "key", shown(key))
    return int(key)


def _cells(lines: Sequence[bytes]) -> Iterator[list[str]]:
    number = 0
    try:
        for line in lines:
            yield from csv.reader([line.decode()], strict=True)
            number += 1
    except UnicodeDecodeError as error:
        raise RowError(number, f"not UTF-8: {error.reason}", None, _text(error.object)) from None
    except csv.Error as error:
        raise RowError(number, f"not CSV: {error}", None, _text(lines[number])) from None


def _typed(found: dict[str, str], row: int) -> Row:
    point = None
    if "x" in found:
        point = (_coordinate(found["x"], "x", row), _coordinate(found["y"], "y", row))
    time = found.get("time") or None
    try:
        when = None if time is None else TIME.validate_python(time)
    except ValidationError as error:
        raise RowError(row, detail(error.errors()[0]), "time", cut(time or "")) from None
    return Row(found.get("key"), point, when)


def _coordinate(text: str, field: str, row: int) -> float:
    if "_" in text:  # notation of Python: 1_000
        raise RowError(row, "must be a valid number", field, cut(text))
    try:
        return COORDINATE.validate_python(text)
    except ValidationError as error:
        raise RowError(row, detail(error.errors()[0]), field, cut(text)) from None


INTEGER = re.compile(r"\s*[+-]?[0-9]{1,4300}\s*")  # as many digits as the interpreter reads
COORDINATE: TypeAdapter[float] = TypeAdapter(Annotated[float, Field(allow_inf_nan=False)])
TIME: TypeAdapter[datetime] = TypeAdapter(Time)


def _row_error(row: int, error: ValidationError) -> RowError:
    """The first error of a line of JSON, with the name of the column."""
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return RowError(row, detail(first), None, _text(first["input"]))
    place = next(iter(first["loc"]), None)
    field = COLUMNS[place] if isinstance(place, int) and place < len(COLUMNS) else place
    value = None if first["type"] == "missing" else shown(first["input"])
    return RowError(row, detail(first), None if field is None else str(field), value)


def _geojson_error(row: int, text: bytes, error: ValidationError) -> RowError:
    """The first error of a text of GeoJSON, with a JSON pointer to it; `row`: the number of the text's first row."""
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return RowError(row, detail(first), None, _text(text))
    body = from_json(text)
    path = path_in(body, first["loc"], absent=first["type"] == "missing")
    value = None if first["type"] == "missing" else shown(first["input"])
    return RowError(row + _rows_before(body, path), detail(first), pointer(path) or None, value)


def _rows_before(body: Any, path: Sequence[str | int]) -> int:
    """The rows of GeoJSON before the place that a path leads to: a multipoint has several."""
    match path:
        case ["features", int(number), *rest]:
            return sum(map(_size, body["features"][:number])) + _rows_before(body["features"][number], rest)
        case ["geometry", *rest]:
            return _rows_before(body["geometry"], rest)
        case ["coordinates", int(number), *_] if body.get("type") == "MultiPoint":
            return number
    return 0


def _size(feature: Any) -> int:
    """The rows of a feature that can be read."""
    geometry = feature["geometry"]
    return len(geometry["coordinates"]) if geometry["type"] == "MultiPoint" else 1


def _text(line: Any) -> str:
    return cut(line.decode(errors="replace") if isinstance(line, bytes) else str(line))
