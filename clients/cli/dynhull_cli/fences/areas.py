"""Polygons of the command line: GeoJSON and WKT."""

import json
import sys
from pathlib import Path
from typing import Any

WKT_NAMES = ("POLYGON", "MULTIPOLYGON")


def read_polygon(text: str) -> Any:
    """The polygons of a file of GeoJSON or WKT, of standard input for "-", or of WKT itself.

    ValueError says what is wrong with them.
    """
    if text.lstrip().upper().startswith(WKT_NAMES):
        return _of_wkt(text, "--polygon")
    source = "standard input" if text == "-" else text
    content = sys.stdin.read() if text == "-" else Path(text).read_text("utf-8")
    if content.lstrip().upper().startswith(WKT_NAMES):
        return _of_wkt(content, source)
    try:
        geojson = json.loads(content)
    except ValueError as error:
        raise ValueError(f"{source} is neither GeoJSON nor WKT: {error}") from None
    if not isinstance(geojson, dict):
        raise ValueError(f"{source} is not GeoJSON: it must be an object with a type")
    return geojson


def _of_wkt(text: str, source: str) -> Any:
    import shapely

    try:
        return shapely.from_wkt(text)
    except shapely.errors.ShapelyError as error:
        raise ValueError(f"{source} is not WKT: {error}") from None
