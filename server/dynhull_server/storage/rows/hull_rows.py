"""The rows of hulls, in each format."""

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import lru_cache
from typing import Any, NamedTuple

from ...state.records import DEFAULT, HullRow, HullSettings, QuarantineRules, Window
from .encoding import checksum
from .tables import FORMAT, Reader

# The settings that are objects of their own.
NESTED: dict[str, type[Window | QuarantineRules]] = {"window": Window, "quarantine": QuarantineRules}

Values = tuple[int, str, str, float, str, int]

# Ten thousand hulls have few different settings, and share the objects.
SETTINGS_KEPT = 256


class FoundHull(NamedTuple):
    """The row of a hull as found in a database.

    Attributes:
        row: the hull; without its settings if the row is damaged.
        checksum: the checksum stored with it.
        whole: whether the row is intact.
        settings: the text of its settings, in formats that have one.
    """

    row: HullRow
    checksum: int
    whole: bool
    settings: str | None = None


def values(row: HullRow) -> Values:
    """The values of the columns, with their checksum."""
    settings = settings_text(row.settings)
    return row.number, row.name, row.uid, row.created, settings, row_checksum(row, settings)


def row_checksum(row: HullRow, settings: str) -> int:
    """The checksum of a row in the present format, whose settings have this text."""
    return _checksum(row.number, row.name, row.uid, row.created, settings)


def settings_text(settings: HullSettings) -> str:
    """Settings as JSON, without those that have their default value."""
    if settings == DEFAULT:  # as of most hulls
        return "{}"
    given = _given(settings)
    for name in NESTED:
        if (nested := getattr(settings, name)) is not None:
            given[name] = _given(nested)
    return json.dumps(given, sort_keys=True)


@lru_cache(SETTINGS_KEPT)
def settings_from(text: str) -> HullSettings:
    """The inverse of `settings_text`; ValueError or TypeError for other texts."""
    given = json.loads(text)
    center = given.pop("center", None)
    nested: dict[str, Any] = {name: kind(**given.pop(name)) for name, kind in NESTED.items() if name in given}
    return HullSettings(**given, **nested, center=None if center is None else tuple(center))


def found_hulls(reader: Reader, version: int) -> Iterator[FoundHull]:
    """The hulls of a database of that format."""
    columns, read = FORMATS[version]
    for number, name, *more in reader.every("hulls", columns):
        try:
            yield read(number, name, *more)
        except (ValueError, TypeError, KeyError, AttributeError, struct.error):
            yield FoundHull(HullRow(number, str(name), "", 0.0), 0, whole=False)


def _of_format_1(number: int, name: str, created: float, config: bytes) -> FoundHull:
    found = json.loads(config)
    row = HullRow(number, name, found["uid"], created, HullSettings(max_points=found["config"]["max_points"]))
    return FoundHull(row, 0, whole=True)


def _of_format_2(number: int, name: str, uid: str, created: float, most: int, stored: int) -> FoundHull:
    expected = checksum(f"{name}\n{uid}".encode() + struct.pack("<d", created), number, most)
    return FoundHull(HullRow(number, name, uid, created, HullSettings(max_points=most)), stored, stored == expected)


def _of_format_3(number: int, name: str, uid: str, created: float, settings: str, stored: int) -> FoundHull:
    whole = _checksum(number, name, uid, created, settings) == stored
    return FoundHull(HullRow(number, name, uid, created, settings_from(settings)), stored, whole, settings)


FORMATS: dict[int, tuple[str, Callable[..., FoundHull]]] = {
    1: ("id, name, created, config", _of_format_1),
    2: ("id, name, uid, created, max_points, checksum", _of_format_2),
    **dict.fromkeys(range(3, FORMAT + 1), ("id, name, uid, created, settings, checksum", _of_format_3)),
}


def _checksum(number: int, name: str, uid: str, created: float, settings: str) -> int:
    return checksum(f"{name}\n{uid}\n{settings}".encode() + struct.pack("<d", created), number)


def _given(settings: HullSettings | Window | QuarantineRules) -> dict[str, Any]:
    return {
        each.name: getattr(settings, each.name)
        for each in fields(settings)
        if getattr(settings, each.name) != each.default
    }
