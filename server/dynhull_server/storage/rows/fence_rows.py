"""The rows of fences and their consumers."""

import base64
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

from ...state.alarms.rule import AlarmRule
from ...state.fences.model.config import Area, CircleArea, FenceConfig, HullArea, PolygonArea
from ...state.fences.model.records import NO_WAITS, Consumer, FenceRow, Waits
from .encoding import checksum
from .tables import COLUMNS, Reader

Values = tuple[int, str, str, float, str, int]


@dataclass(frozen=True, slots=True)
class FoundFence:
    """The row of a fence as found in a database.

    Attributes:
        number: its number.
        name: its name.
        row: the fence, None if the row is damaged.
        checksum: the checksum stored with it.
    """

    number: int
    name: str
    row: FenceRow | None
    checksum: int


def values(row: FenceRow) -> Values:
    """The values of the columns, with their checksum."""
    config = settings_text(row)
    return (
        row.number,
        row.name,
        row.uid,
        row.created,
        config,
        _checksum(row.number, row.name, row.uid, row.created, config),
    )


def consumer_values(fence: int, consumer: Consumer) -> tuple[int, str, int, int, int]:
    """The values of the columns, with their checksum."""
    stored = checksum(consumer.name.encode(), fence, consumer.acknowledged, consumer.lost)
    return fence, consumer.name, consumer.acknowledged, consumer.lost, stored


def settings_text(row: FenceRow) -> str:
    """Settings as JSON, without those that have their default value; rings of polygons in base 64."""
    config = row.config
    given: dict[str, Any] = {
        each.name: getattr(config, each.name)
        for each in fields(config)
        if each.name != "area" and getattr(config, each.name) != each.default
    }
    given["area"] = _area_as_json(config.area)
    if row.waits != NO_WAITS:
        given["waits"] = row.waits
    return json.dumps(given, sort_keys=True)


def settings_from(text: str) -> tuple[FenceConfig, Waits]:
    """The inverse of `settings_text`; ValueError, TypeError, KeyError or AttributeError for other texts."""
    given = json.loads(text)
    waits = Waits(*given.pop("waits", NO_WAITS))
    if "expected" in given:
        given["expected"] = tuple(given["expected"])
    return FenceConfig(**{**given, "area": _area_from_json(given["area"])}), waits


def found_fences(reader: Reader) -> Iterator[FoundFence]:
    """The fences of a database."""
    for number, name, uid, created, config, stored in reader.every("fences", ", ".join(COLUMNS["fences"])):
        try:
            row = FenceRow(number, name, uid, created, *settings_from(config))
            whole = _checksum(number, name, uid, created, config) == stored
        except (ValueError, TypeError, KeyError, AttributeError, struct.error):
            whole = False
        yield FoundFence(number, str(name), row if whole else None, stored)


def _area_as_json(area: Area) -> dict[str, Any]:
    if isinstance(area, PolygonArea):
        rings = [[base64.b64encode(ring).decode() for ring in polygon] for polygon in area.polygons]
        return {"polygons": rings}
    if isinstance(area, HullArea):
        if area.layer > 1:  # no "hull": servers that know no layers are not to take it for the hull itself
            return {"layer": area.layer, "of": area.name}
        return {"hull": area.name, "without_self": area.without_self}
    if isinstance(area, AlarmRule):
        return {"when": area.when, "clear": area.clear, "hold": area.hold}
    return {"circle": [area.x, area.y, area.radius]}


def _area_from_json(found: dict[str, Any]) -> Area:
    if "polygons" in found:
        rings = (tuple(base64.b64decode(ring, validate=True) for ring in polygon) for polygon in found["polygons"])
        return PolygonArea(tuple(rings))
    if "hull" in found:
        return HullArea(found["hull"], found["without_self"])
    if "layer" in found:
        return HullArea(found["of"], layer=found["layer"])
    if "when" in found:
        return AlarmRule(found["when"], found["clear"], found["hold"])
    return CircleArea(*found["circle"])


def _checksum(number: int, name: str, uid: str, created: float, config: str) -> int:
    return checksum(f"{name}\n{uid}\n{config}".encode() + struct.pack("<d", created), number)
