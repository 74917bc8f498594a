"""Points of GeoJSON, and of JSON line by line."""

import json
import math
from typing import IO, Any

import ijson

from ..csv_points import coordinate_columns
from .chunks import CHUNK_ROWS, Chunks, cut, picked

LONGEST_TEXT = 200


def read_geojson(name: str, file: IO[bytes], _x: str | None, _y: str | None) -> Chunks:
    """Chunks of the Point features of a FeatureCollection, which is never in memory as a whole."""
    features = enumerate(ijson.items(file, "features.item", use_float=True), start=1)
    try:
        for rows in cut(((f"feature {i}", feature) for i, feature in features), CHUNK_ROWS):
            yield picked(rows, _of_feature, _text)
    except ijson.JSONError as error:
        raise ValueError(f"{name} is no GeoJSON: {error}") from None


def read_ndjson(name: str, file: IO[bytes], x: str | None, y: str | None) -> Chunks:
    """Chunks of points, one a line: an object with members x and y, an array of two, or a GeoJSON feature."""
    columns = None if x is None or y is None else (x, y)

    def position(line: bytes) -> tuple[float, float]:
        nonlocal columns
        value = json.loads(line)
        if isinstance(value, list):
            return _of_array(value)
        if not isinstance(value, dict):
            raise ValueError("neither an object nor an array")
        if value.get("type") == "Feature":
            return _of_feature(value)
        if columns is None:
            columns = coordinate_columns(name, list(value), x, y)
        return _number(value.get(columns[0]), columns[0]), _number(value.get(columns[1]), columns[1])

    lines = ((f"line {i}", line) for i, line in enumerate(file, start=1) if not line.isspace())
    for rows in cut(lines, CHUNK_ROWS):
        yield picked(rows, position, lambda line: line.decode(errors="replace").strip())


def _of_feature(feature: Any) -> tuple[float, float]:
    geometry = (feature.get("geometry") if isinstance(feature, dict) else None) or {}
    if geometry.get("type") != "Point":
        raise ValueError(f"its geometry is {geometry.get('type', 'nothing')}, not a Point")
    return _of_array(geometry.get("coordinates"))


def _of_array(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) < 2:
        raise ValueError("not two coordinates")
    return _number(value[0], "x"), _number(value[1], "y")


def _number(value: Any, column: str) -> float:
    if value is None:
        raise ValueError(f"{column} is missing")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{column} is {_text(value)}, not a number")
    if not math.isfinite(value):
        raise ValueError(f"{column} is {value}, not finite")
    return value + 0.0


def _text(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= LONGEST_TEXT else f"{text[:LONGEST_TEXT]}..."
