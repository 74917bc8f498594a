"""Rows of bodies: points and keys as newline-delimited JSON, CSV and GeoJSON."""

import csv
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, NamedTuple, NotRequired

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import from_json, to_json
from typing_extensions import TypedDict

from dynhull_cli.reading.columns import NOT_AVAILABLE, UNKNOWN_LATITUDE, available, pair_of
from dynhull_cli.reading.labels import LabelReader, key_of
from dynhull_cli.reading.values import LARGEST_EXACT, BadValueError, coordinate, number

from .invalid import detail, path_in
from .problems import cut, pointer, shown
from .schemas import Key, Number, Point

LABELS = "key", "time", "expires", "accuracy"
COLUMNS = "x", "y"


class Row(NamedTuple):
    """A point, a key, or both; times are in microseconds since 1970."""

    key: str | int | None
    point: Sequence[float] | None
    time: int | None = None
    expires: int | None = None
    accuracy: float | None = None


class RowError(Exception):
    """A row cannot be read. `row` is counted from the first one of the same call, `field` and `value` are at fault."""

    def __init__(self, row: int, detail: str, field: str | None = None, value: str | None = None) -> None:
        super().__init__(detail)
        self.row = row
        self.detail = detail
        self.field = field
        self.value = value


class Found(NamedTuple):
    """The rows of some texts: None for each that cannot be taken, and why."""

    rows: list[Row | None]
    bad: list[RowError]

    def add_bad(self, detail: str, field: str | None, value: str | None, part: int = 0) -> None:
        """Add a row that cannot be read. `part`: of several rows in it, the one at fault."""
        self.bad.append(RowError(len(self.rows) + part, detail, field, value))
        self.rows.append(None)

    def refuse(self, row: int, detail: str, field: str | None, value: str | None = None) -> None:
        """Make a row that was read a bad one."""
        self.bad.append(RowError(row, detail, field, value))
        self.rows[row] = None


Reader = Callable[[Sequence[bytes]], Found]
"""Reads some texts of a body, which are complete. RowError if nothing of the body can be read."""


class XY(TypedDict):
    """A row with x and y."""

    __pydantic_config__ = ConfigDict(extra="ignore")  # type: ignore[misc]
    x: Number
    y: Number
    key: NotRequired[Key]
    time: NotRequired[Any]
    expires: NotRequired[Any]
    accuracy: NotRequired[Any]


class LonLat(TypedDict):
    """A row with lon and lat."""

    __pydantic_config__ = ConfigDict(extra="ignore")  # type: ignore[misc]
    lon: Number
    lat: Number
    key: NotRequired[Key]
    time: NotRequired[Any]
    expires: NotRequired[Any]
    accuracy: NotRequired[Any]


POINT = TypeAdapter(Point).validate_json
X_Y = TypeAdapter(XY).validate_json
LON_LAT = TypeAdapter(LonLat).validate_json


class Ndjson:
    """Lines of JSON: arrays of x and y, objects, or points and features of GeoJSON.

    Objects have coordinates with any of the names that columns have, and "key", "time", "expires" and "accuracy" if
    wanted. Other members are left out. With `delete`, a key alone is a row.
    """

    def __init__(self, labels: LabelReader, *, delete: bool) -> None:
        self._labels = labels
        self._delete = delete
        self._geojson = GeoJson(labels)

    def __call__(self, lines: Sequence[bytes]) -> Found:
        """The rows of some lines."""
        found = Found([], [])
        for line in lines:
            try:  # the usual rows, without a look at each value
                if line.startswith(b"["):
                    found.rows.append(Row(None, _exact(POINT(line))))
                    continue
                given: Any
                if b'"x"' in line:
                    given = X_Y(line)
                    point = given["x"], given["y"]
                else:
                    given = LON_LAT(line)
                    point = given["lon"], given["lat"]
                    if point[1] == UNKNOWN_LATITUDE:
                        raise BadValueError("lat", NOT_AVAILABLE, point[1])
                others: tuple[Any, ...] = ()
                if "time" in given or "expires" in given or "accuracy" in given:
                    others = self._labels.others(*(given.get(name) for name in LABELS[1:]))
                found.rows.append(Row(given.get("key"), _exact(point), *others))
                continue
            except (ValidationError, BadValueError):
                pass
            self._read(line, found)
        return found

    def _read(self, line: bytes, found: Found) -> None:
        """Read any line."""
        try:
            value = from_json(line, allow_inf_nan=False)
        except ValueError as error:
            found.add_bad(f"not JSON: {error}", None, _text(line))
            return
        if isinstance(value, dict) and ("coordinates" in value or "geometry" in value or "features" in value):
            self._geojson.read(line, found)
            return
        try:
            found.rows.append(self._row(value))
        except BadValueError as error:
            found.add_bad(error.problem, error.name, None if error.value is None else shown(error.value))
        except (ValueError, TypeError) as error:
            found.add_bad(str(error), None, _text(line))

    def _row(self, value: Any) -> Row:
        if isinstance(value, list) and len(value) >= len(COLUMNS):
            return Row(None, [number(each, name) for each, name in zip(value, COLUMNS, strict=False)])
        if not isinstance(value, dict):
            raise ValueError("must be an object, or an array of two numbers")
        labels = self._labels(*(value.get(name) for name in LABELS))
        key, others = labels[0], labels[1:]
        names = pair_of(value)
        if names is None and self._delete and key is not None:
            return Row(key, None)
        x, y = names or COLUMNS
        return Row(key, available((x, y), coordinate(value.get(x), x), coordinate(value.get(y), y)), *others)


class Csv:
    """Lines of CSV: first the names of the columns: coordinates, and key, time, expires, accuracy if there are any.

    A row is one line, with as many fields as the first. Columns with other names are left out.
    """

    def __init__(self, labels: LabelReader, *, delete: bool) -> None:
        self._labels = labels
        self._delete = delete
        self._fields = 0
        self._point: tuple[tuple[str, int], tuple[str, int]] | None = None
        self._places: list[int | None] = []
        self._labelled = False

    def __call__(self, lines: Sequence[bytes]) -> Found:
        """The rows of some lines."""
        found = Found([], [])
        if not self._fields and lines:
            self._name(_cells(lines[0]))
            lines = lines[1:]
        for line in lines:
            try:
                cells = _cells(line)
                if len(cells) != self._fields:
                    raise RowError(0, f"{len(cells)} fields in a table of {self._fields} columns", None, _text(line))
                found.rows.append(self._row(cells))
            except BadValueError as error:
                found.add_bad(error.problem, error.name, None if error.value is None else cut(str(error.value)))
            except RowError as error:
                found.add_bad(error.detail, error.field, error.value)
            except (ValueError, TypeError) as error:
                found.add_bad(str(error), None, _text(line))
        return found

    def _row(self, cells: list[str]) -> Row:
        point = None
        if self._point is not None:
            (x, first), (y, second) = self._point
            point = available((x, y), coordinate(cells[first], x), coordinate(cells[second], y))
        if not self._labelled:
            return Row(None, point)
        labels = self._labels(*(None if place is None else cells[place] for place in self._places))
        return Row(labels[0], point, *labels[1:])

    def _name(self, first: list[str]) -> None:
        header = [each.strip().lower() for each in first]
        twice = next((name for name in header if header.count(name) > 1), None)
        if twice is not None:
            raise RowError(0, f"the first line names the column {twice!r} twice", "header", cut(",".join(header)))
        self._fields = len(header)
        self._places = [header.index(name) if name in header else None for name in LABELS]
        self._labelled = any(place is not None for place in self._places)
        names = pair_of(header)
        if names is not None:
            x, y = names
            self._point = (x, header.index(x)), (y, header.index(y))
        elif not (self._delete and "key" in header):
            labels = ", ".join(LABELS)
            detail = f"the first line must name the columns, separated by commas: x,y or lon,lat, and {labels}"
            raise RowError(0, detail, "header", cut(",".join(header)))


class PointGeometry(BaseModel):
    """A position."""

    type: Literal["Point"]
    coordinates: Point | tuple[Number, Number, Number]


class MultiPointGeometry(BaseModel):
    """Positions."""

    type: Literal["MultiPoint"]
    coordinates: list[Point | tuple[Number, Number, Number]]


Geometry = Annotated[PointGeometry | MultiPointGeometry, Field(discriminator="type")]


class PointFeature(BaseModel):
    """A feature; its id is the key, and its properties have the times and the accuracy."""

    type: Literal["Feature"]
    id: Key | None = None
    geometry: Geometry
    properties: dict[str, Any] | None = None


class PointCollection(BaseModel):
    """Features."""

    type: Literal["FeatureCollection"]
    features: list[PointFeature]


Geo = Annotated[PointCollection | PointFeature | PointGeometry | MultiPointGeometry, Field(discriminator="type")]
GEOJSON: TypeAdapter[Geo] = TypeAdapter(Geo)


class GeoJson:
    """Texts of GeoJSON: points and multipoints, features of these, or a collection."""

    def __init__(self, labels: LabelReader) -> None:
        self._labels = labels

    def __call__(self, texts: Sequence[bytes]) -> Found:
        """The rows of some texts."""
        found = Found([], [])
        for text in texts:
            self.read(text, found)
        return found

    def read(self, text: bytes, found: Found, within: tuple[str | int, ...] = ()) -> None:
        """Add the rows of one text. `within`: the way to it in the body."""
        try:
            geo = GEOJSON.validate_json(text)
        except ValidationError as error:
            self._refuse(text, error, found, within)
            return
        if not isinstance(geo, PointCollection):
            self._add(geo, found, within)
            return
        for index, feature in enumerate(geo.features):
            self._add(feature, found, ("features", index))

    def _add(self, geo: Any, found: Found, within: tuple[str | int, ...]) -> None:
        key: str | int | None = None
        others: Sequence[Any] = ()
        if isinstance(geo, PointFeature):
            properties = geo.properties or {}
            try:
                key, *others = self._labels(geo.id, *(properties.get(name) for name in LABELS[1:]))
            except BadValueError as error:
                found.add_bad(error.problem, pointer((*within, "properties", error.name)), shown(error.value))
                return
            geo = geo.geometry
        positions = [geo.coordinates] if isinstance(geo, PointGeometry) else geo.coordinates
        found.rows.extend(Row(key, (x, y), *others) for x, y, *_ in positions)

    def _refuse(self, text: bytes, error: ValidationError, found: Found, within: tuple[str | int, ...]) -> None:
        """Add what is wrong with a text; of a collection with features, one by one."""
        first = error.errors()[0]
        if first["type"] == "json_invalid":
            found.add_bad(detail(first), None, _text(text))
            return
        body = from_json(text)
        path = path_in(body, first["loc"], absent=first["type"] == "missing")
        if path[:1] == ["features"] and len(path) > 1:
            for index, feature in enumerate(body["features"]):
                self.read(to_json(feature), found, ("features", index))
            return
        value = None if first["type"] == "missing" else shown(first["input"])
        found.add_bad(detail(first), pointer((*within, *path)) or None, value, _part(body, path))


def with_keys(found: Found, kind: Literal["str", "int"] | None) -> Found:
    """The rows with keys of a kind, "str" or "int"; None for without."""
    for place, row in enumerate(found.rows):
        if row is not None and row.key is not None:
            try:
                found.rows[place] = row._replace(key=None if kind is None else key_of(row.key, "key", kind))
            except ValueError:
                found.refuse(place, "must be an integer", "key", shown(row.key))
    found.bad.sort(key=lambda error: error.row)
    return found


def _exact(point: Sequence[float]) -> Sequence[float]:
    """The point; BadValueError if it may have been an integer that is no double."""
    if all(-LARGEST_EXACT < each < LARGEST_EXACT for each in point):
        return point
    raise BadValueError("point", "needs a look")


def _cells(line: bytes) -> list[str]:
    try:
        return next(csv.reader([line.decode()], strict=True, skipinitialspace=True), [])
    except UnicodeDecodeError as error:
        byte = f"the byte 0x{line[error.start]:02x} is not UTF-8"
        raise RowError(0, byte, None, _text(line)) from None
    except csv.Error as error:
        raise RowError(0, f"not CSV: {error}", None, _text(line)) from None


def _part(body: Any, path: Sequence[str | int]) -> int:
    """The position of a multipoint to which a path through a feature leads."""
    match path:
        case ["geometry", *rest]:
            return _part(body["geometry"], rest)
        case ["coordinates", int(number), *_] if body.get("type") == "MultiPoint":
            return number
    return 0


def _text(line: Any) -> str:
    return cut(line.decode(errors="backslashreplace") if isinstance(line, bytes) else str(line))
