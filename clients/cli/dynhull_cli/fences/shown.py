"""Fences and their events as JSON and as text."""

from datetime import timedelta
from typing import Any

from dynhull_client import Circle, Fence, FenceEvent, HullClient, Prefix
from dynhull_surface.described import Setting, described
from dynhull_surface.settings import FenceSettings

from ..durations import shown
from ..json_lines import members
from ..keyed_rows import known_hull
from ..plural import plural

LISTS = "snapshot", "closed"  # events that list who is inside
MAY_BE_EMPTY = "fence", "uid", "sequence", "key", "distance", "inside"  # what zero or nobody is a value of


def fence_members(fence: Fence) -> dict[str, Any]:
    """A fence as members of JSON; members without a value are null."""
    subjects = {"prefix": fence.subjects.text} if isinstance(fence.subjects, Prefix) else fence.subjects
    return members(fence) | {"area": _area_json(fence), "subjects": subjects}


def event_members(event: FenceEvent) -> dict[str, Any]:
    """An event as members of JSON: those that it has."""
    found = members(event) | {"cause": sorted(event.cause), "after": None}
    found["inside"] = event.inside if event.type in LISTS else None
    if not event.fence:  # after the fact
        found |= {"fence": None, "uid": None}
    return {name: value for name, value in found.items() if value or (value is not None and name in MAY_BE_EMPTY)}


def is_geographic(client: HullClient, fence: Fence) -> bool | None:
    """Whether a fence that compares keys is on the globe; None while its prefix has no hull with keys."""
    if isinstance(fence.subjects, Prefix):
        hull = next((each for each in client.list_hulls(fence.subjects.text) if each.keyed), None)
    else:
        hull = None if fence.subjects is None else known_hull(client, fence.subjects)
    return None if hull is None else hull.geographic


def unit_of(client: HullClient, fence: Fence) -> str:
    """The unit of the lengths of a circle on the globe; empty in the plane, whose unit nobody knows."""
    return " m" if isinstance(fence.area, Circle) and is_geographic(client, fence) else ""


def area_text(fence: Fence, unit: str = "") -> str:
    """The area in a few words; `unit` is that of lengths, behind a space: kilometres are said of many metres."""
    if isinstance(fence.area, str):
        return f"hull {fence.area}"
    if isinstance(fence.area, Circle):
        radius = f"{fence.area.r / 1000:g} km" if unit == " m" and fence.area.r >= 1000 else f"{fence.area.r:g}{unit}"
        return f"circle around ({fence.area.x:g}, {fence.area.y:g}), radius {radius}"
    corners = sum(len(each.exterior) + sum(map(len, each.holes)) for each in fence.area)
    holes = sum(len(each.holes) for each in fence.area)
    several = f"{len(fence.area)} polygons" if len(fence.area) > 1 else "polygon"
    return ", ".join([several, plural(corners, "corner"), *([plural(holes, "hole")] if holes else [])])


def subjects_text(fence: Fence) -> str:
    """The subjects in a few words."""
    if isinstance(fence.subjects, Prefix):
        return f"{fence.subjects.text}*"
    return fence.subjects if fence.subjects is not None else f"hull {fence.other_hull}"


def settings_text(fence: Fence) -> str:
    """The settings that are not the usual ones."""
    found = ((each, getattr(fence, each.name)) for each in described(FenceSettings) if not each.at_creation)
    texts = [_setting_text(each, value) for each, value in found if value != each.usual]
    return ", ".join([*texts, *([f"expects {plural(len(fence.expected), 'key')}"] if fence.expected else [])])


def _setting_text(setting: Setting, value: Any) -> str:
    if setting.choices:
        return str(value)
    name = setting.name.replace("_", " ")
    if setting.kind is bool:
        return name
    if setting.kind is str:
        return f"{name} {value}"
    return f"{name} {shown(value) if isinstance(value, timedelta) else format(value, 'g')}"


def event_cells(event: FenceEvent) -> tuple[str, ...]:
    """Sequence, time, type, hull, key, x, y and causes; empty where the event has none."""
    position = ("", "") if event.position is None else (repr(event.position[0]), repr(event.position[1]))
    what = event.key
    if event.type == "lost":
        what = f"{event.first}-{event.last}"
    elif event.type in LISTS:
        what = plural(sum(len(each.keys) for each in event.inside), "key")
    time = "" if event.time is None else event.time.isoformat(timespec="milliseconds")
    causes = ",".join(sorted(event.cause))
    return (str(event.sequence), time, event.type, event.hull, "" if what is None else str(what), *position, causes)


def _area_json(fence: Fence) -> Any:
    if isinstance(fence.area, str):
        return {"hull": fence.area}
    if isinstance(fence.area, Circle):
        return {"circle": [fence.area.x, fence.area.y, fence.area.r]}
    rings = [each.__geo_interface__["coordinates"] for each in fence.area]
    if len(rings) == 1:
        return {"type": "Polygon", "coordinates": rings[0]}
    return {"type": "MultiPolygon", "coordinates": rings}
