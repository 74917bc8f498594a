"""Areas of fences as Well-known Text, which shapely reads."""

import re
from typing import Any

START = re.compile(r"\s*(MULTI)?POLYGON\s*(ZM|Z|M)?\s*(\(|EMPTY\b)", re.IGNORECASE)
WORDS = "POLYGON", "MULTIPOLYGON", "Z", "M", "ZM", "EMPTY"
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
EXAMPLE = "POLYGON ((0 0, 4 0, 4 3, 0 0))"


def is_wkt(text: str) -> bool:
    """Whether text begins as polygons do; no name of a hull has parentheses."""
    return START.match(text) is not None


def polygons_of(text: str, source: str) -> Any:
    """The polygons as a geometry of shapely. ValueError says what is wrong with `source`, and where."""
    try:
        import shapely
    except ImportError:
        raise ImportError(f"{source} is WKT, which shapely reads: pip install shapely") from None
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
        if not NUMBER.fullmatch(word[0]) and word[0].upper() not in WORDS:
            return f"character {word.start() + 1}: {word[0]!r} is not a number"
    return f"corners are X Y with commas between them, as in {EXAMPLE}"
