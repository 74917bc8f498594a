"""Polygons of the command line: GeoJSON and WKT."""

import json
from pathlib import Path
from typing import Any

from dynhull_client.wkt import is_wkt, polygons_of

from ..reading.text import UndecodableError, Utf8, lines_of, standard_input


def read_polygon(text: str) -> Any:
    """The polygons of a file of GeoJSON or WKT, of standard input for "-", or of WKT itself.

    ValueError says what is wrong with them.
    """
    if is_wkt(text):
        return polygons_of(text, "--polygon")
    source = "standard input" if text == "-" else text
    content = _read(text)
    if is_wkt(content):
        return polygons_of(content, source)
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
