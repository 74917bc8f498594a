"""Polygons of the command line: GeoJSON and WKT."""

import json
import re
from pathlib import Path
from typing import Any

from ..reading.text import UndecodableError, Utf8, lines_of, standard_input

WKT_NAMES = ("POLYGON", "MULTIPOLYGON")
WKT_WORDS = (*WKT_NAMES, "Z", "M", "ZM", "EMPTY")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
EXAMPLE = "POLYGON ((0 0, 4 0, 4 3, 0 0))"


def read_polygon(text: str) -> Any:
    """The polygons of a file of GeoJSON or WKT, of standard input for "-", or of WKT itself.

    ValueError says what is wrong with them.
    """
    if text.lstrip().upper().startswith(WKT_NAMES):
        return _of_wkt(text, "--polygon")
    source = "standard input" if text == "-" else text
    content = _read(text)
    if content.lstrip().upper().startswith(WKT_NAMES):
        return _of_wkt(content, source)
    try:
        geojson = json.loads(content)
    except ValueError as error:
        raise ValueError(f"{source} is neither GeoJSON nor WKT: {error}") from None
    if not isinstance(geojson, dict):
        raise ValueError(f"{source} is not GeoJSON: it must be an object with a type")
    return geojson


def _read(name: str) -> str:
    if name == "-":
        return standard_input().read()
    with Path(name).open("rb") as file:
        try:
            return lines_of(Utf8(name, file)).read()
        except UndecodableError as error:
            raise ValueError(f"{error}: convert the file, for example with iconv -f CP1252 -t UTF-8") from None


def _of_wkt(text: str, source: str) -> Any:
    import shapely

    try:
        return shapely.from_wkt(text)
    except shapely.errors.ShapelyError as error:
        kind, _, problem = str(error).partition(": ")
        raise ValueError(f"{source} is not WKT: {_slip(text) if kind == 'ParseException' else problem}") from None


def _slip(text: str) -> str:
    """What is wrong with a text that GEOS cannot parse, whose own words do not say where."""
    depth = 0
    for place, character in enumerate(text, 1):
        depth += {"(": 1, ")": -1}.get(character, 0)
        if depth < 0:
            return f"character {place} is a ) without its ("
    if depth:
        return f"{depth} ) missing at the end, after character {len(text)}"
    for word in re.finditer(r"[^\s(),]+", text):
        if not NUMBER.fullmatch(word[0]) and word[0].upper() not in WKT_WORDS:
            return f"character {word.start() + 1}: {word[0]!r} is not a number"
    return f"corners are X Y with commas between them, as in {EXAMPLE}"
