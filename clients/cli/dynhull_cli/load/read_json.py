"""Points of JSON: GeoJSON, an array of rows, or one row per line."""

import io
import json
import re
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import IO, Any, Protocol

import ijson

from ..peek import peek
from ..plural import plural
from ..reading.columns import coordinate_columns, geometry_column
from ..reading.labels import Labels
from ..reading.text import KEPT_BYTES, PART, require_decoded
from ..reading.values import coordinate, json_text
from .chunks import CHUNK_ROWS, LINE, Chunks, Position, cut, picked
from .geometry import position, positions
from .geometry_column import GeometryColumn
from .reference_system import note_reference_system
from .source import Source

PREFIX = 4096  # bytes, which show the kind of JSON
RECORD_SEPARATOR = b"\x1e"  # before each line of a GeoJSON text sequence (RFC 8142)
CRS = b'"crs"'  # the member that named a coordinate reference system before RFC 7946; null for an unknown one
DEGREES = {"properties": {"name": "OGC:CRS84"}}  # without such a member
ALONE = re.compile(rb'"type"\s*:\s*"(Feature|(Multi)?(Point|LineString|Polygon)|GeometryCollection)"')


def read_json(source: Source) -> Chunks:
    """Chunks of points of any of the three kinds."""
    text = source.utf8()
    start = peek(text, PREFIX).lstrip()
    if start.startswith(b"["):
        yield from _read_items(source, text, "item", "item", _row_reader(source))
    elif _is_row(start.partition(b"\n")[0]):
        yield from _read_lines(source, text)
    elif b'"features"' not in start and ALONE.search(start):
        yield from _read_items(source, text, "", "feature", _row_reader(source))
    elif source.size is None:
        yield from _read_pipe(source, text, start)
    else:
        _note(source, _member_of(source))
        yield from _read_collection(source, source.utf8())


def _note(source: Source, crs: Any) -> None:
    """Note what the member `crs` of GeoJSON says."""
    name = crs.get("properties", {}).get("name") if isinstance(crs, dict) else crs
    note_reference_system(source, name, "its crs")


def _member_of(source: Source) -> Any:
    """The member `crs` of a whole file, at whose end it may be; the file is at its beginning again."""
    source.file.seek(0)
    text, seen = source.utf8(), b""
    while CRS not in seen and (part := text.read(PART)):
        seen = seen[-len(CRS) :] + part
    source.file.seek(0)
    if CRS not in seen:
        return DEGREES
    found = _first(source.utf8())  # looks which of the members called crs is that of the document
    source.file.seek(0)
    return found


def _first(text: IO[bytes]) -> Any:
    """The first member `crs` of a document, as far as that is there."""
    try:
        return next(ijson.items(text, "crs"), DEGREES)
    except ijson.JSONError:  # is reported with its place when the features are read
        return DEGREES


class Readable(Protocol):
    """What ijson reads from."""

    def read(self, size: int = -1, /) -> bytes:
        """At most that many bytes; none at the end."""


class _Tail:
    """Input whose end is kept."""

    def __init__(self, text: Readable) -> None:
        self._text = text
        self.end = b""

    def read(self, size: int = -1, /) -> bytes:
        """As of the input."""
        part = self._text.read(size)
        self.end = (self.end + part)[-PREFIX:]
        return part


def _read_pipe(source: Source, text: IO[bytes], start: bytes) -> Chunks:
    """Chunks of points of a FeatureCollection that is read once; ValueError if the member `crs` at its end is news."""
    _note(source, _first(io.BytesIO(start)))
    tail = _Tail(text)
    yield from _read_collection(source, tail)
    before, _, end = tail.end.rpartition(CRS)
    try:
        found = json.loads(b"{" + CRS + end)["crs"] if before else DEGREES
    except ValueError:  # it is a member of something else
        return
    known = source.geographic()
    on_globe = source.degrees if known is None else known
    _note(source, found)
    if on_globe and source.elsewhere:
        raise ValueError(
            f"{source.name} says at its end that its crs is {source.elsewhere[0]}, and its coordinates were taken for "
            "degrees: write it to a file first, or give --plane"
        )


def _read_collection(source: Source, text: Readable) -> Chunks:
    """Chunks of points of the features of a FeatureCollection, which is never in memory as a whole."""
    empty = True
    for chunk in _read_items(
        source, text, "features.item", "feature", lambda value: _of_feature(value, source.options.vertices)
    ):
        empty = False
        yield chunk
    if empty:
        raise ValueError(f"{source.name} has no points: it is a JSON object without features")


def read_ndjson(source: Source) -> Chunks:
    """Chunks of points, one row per line."""
    return _read_lines(source, source.utf8(keep=True))


def _read_lines(source: Source, text: IO[bytes]) -> Chunks:
    read = _row_reader(source)
    lines = ((i, line) for i, line in enumerate(text, start=1) if not line.isspace())
    parsed = ((i, _Line(line)) for i, line in lines)
    labels = _labels(source)
    for rows in cut(parsed, CHUNK_ROWS):
        yield picked(
            LINE,
            rows,
            lambda line: read(line.value),
            lambda line: line.text,
            None if labels is None else lambda line: labels(line.value),
        )


def _read_items(source: Source, text: Readable, path: str, unit: str, read: Callable[[Any], list[Position]]) -> Chunks:
    labels = _labels(source)
    for rows in cut(_numbered_items(source.name, text, path, unit), CHUNK_ROWS):
        yield picked(unit, rows, read, json_text, labels)


def _numbered_items(name: str, text: Readable, path: str, unit: str) -> Iterator[tuple[int, Any]]:
    """The items with their numbers from 1; ValueError on one line where the file is not JSON.

    Integers of any size are exact, other numbers are Decimals.
    """
    read = 0
    try:
        for read, item in enumerate(ijson.items(text, path), start=1):
            yield read, item
    except ijson.JSONError as error:
        lines = "; if each line is a row or a feature, add --format ndjson" if "trailing garbage" in str(error) else ""
        raise ValueError(f"{name} is not valid JSON after {plural(read, unit)}: {_cause(error)}{lines}") from None


def _cause(error: ijson.JSONError) -> str:
    """The message of ijson's parser on one line: what is wrong, and the text before and after it."""
    message = error.args[0]
    problem, *context = (message.decode(errors="replace") if isinstance(message, bytes) else message).splitlines()
    near = context[0].strip() if context else ""
    return problem.partition(": ")[2].rstrip(".") + (f", near {near}" if near else "")


class _Line:
    """A line of JSON, parsed when its value is first asked for."""

    def __init__(self, line: bytes) -> None:
        self._line = line.removeprefix(RECORD_SEPARATOR)

    @cached_property
    def value(self) -> Any:
        text = self._line.decode(errors=KEPT_BYTES)
        require_decoded(text)
        try:
            return json.loads(text)
        except json.JSONDecodeError as error:
            raise ValueError(f"not valid JSON at column {error.pos + 1}: {error.msg}") from None

    @property
    def text(self) -> str:
        return self._line.decode(errors=KEPT_BYTES).strip()


def _labels(source: Source) -> Callable[[Any], Labels] | None:
    """Reads the labels of a row from its members or, of a feature, from its id and properties."""
    read = source.label_reader()
    if read is None:
        return None
    names = [name for _, name in source.options.labels]

    def labels(value: Any) -> Labels:
        if not isinstance(value, dict):
            raise ValueError("an array has no key and no time")
        if value.get("type") == "Feature":
            value = {"id": value.get("id"), **(value.get("properties") or {})}
        return read(*(None if name is None else value.get(name) for name in names))

    return labels


def _row_reader(source: Source) -> Callable[[Any], list[Position]]:
    """Reads a row: an array of two numbers, a GeoJSON feature or geometry, or an object with members of x and y.

    Or an object with a member that is a geometry: GeoJSON, WKT or WKB.

    The first object decides which members these are.
    """
    x, y = source.options.x, source.options.y
    members = None if x is None or y is None else (x, y)
    source.axes.extend(members or ())
    noted: list[Any] = []
    geometries: tuple[str, GeometryColumn] | None = None

    def read(value: Any) -> list[Position]:
        nonlocal members, geometries
        if isinstance(value, list):
            return [position(value)]
        if not isinstance(value, dict):
            raise ValueError("neither an object nor an array")
        feature = value.get("type") == "Feature"
        if feature or "coordinates" in value or "geometries" in value:
            if members is None and (crs := value.get("crs", DEGREES)) not in noted:
                if noted:
                    raise ValueError("its crs is another one than that of the first row")
                _note(source, crs)
                noted.append(crs)
            return positions(value.get("geometry") if feature else value, source.options.vertices)
        if members is None and geometries is None:
            name = geometry_column(source.name, list(value), x, y, source.options.geometry)
            if name is not None:
                source.notes.append(f"{source.name}: points from the geometries in {name}")
                geometries = name, GeometryColumn(source, name, system_known=False)
        if geometries is not None:
            name, column = geometries
            return column.positions(value.get(name))
        if members is None:
            names = list(value)
            i, j = coordinate_columns(source.name, names, x, y)
            members = names[i], names[j]
            if not source.axes:
                source.axes.extend(members)
        return [(coordinate(value.get(members[0]), members[0]), coordinate(value.get(members[1]), members[1]))]

    return read


def _of_feature(feature: Any, every_vertex: bool) -> list[Position]:
    return positions(feature.get("geometry") if isinstance(feature, dict) else None, every_vertex)


def _is_row(line: bytes) -> bool:
    """Whether a line is a JSON value by itself, and not a whole FeatureCollection."""
    try:
        value = json.loads(line.removeprefix(RECORD_SEPARATOR))
    except ValueError:
        return False
    return not (isinstance(value, dict) and value.get("type") == "FeatureCollection")
