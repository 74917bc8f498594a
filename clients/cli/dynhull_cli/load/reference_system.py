"""Whether the geometries of an input are longitudes and latitudes."""

from typing import Any

from .source import Source

DEGREES = "CRS84", ":4326"  # how the names of the usual systems end


def note_reference_system(source: Source, system: Any, what: str) -> None:
    """Note whether geometries are degrees, by the coordinate reference system that `what` of the input names.

    `system` is whatever pyproj reads: a name such as EPSG:4326, WKT or PROJJSON; None where none is named.
    """
    if system is None:
        source.notes.append(f"{source.name}: {what} names no coordinate reference system: --geographic reads degrees")
        return
    geographic, name = _described(system)
    if geographic is None:
        source.notes.append(f"{source.name}: {what} is in {name}, which is unknown: --geographic reads degrees")
    elif geographic:
        source.in_degrees()
    else:
        source.notes.append(f"{source.name}: its coordinates are not degrees: its crs is {name}")


def _described(system: Any) -> tuple[bool | None, str]:
    """Whether a coordinate reference system is in degrees, None if it is unknown, and its name."""
    try:
        import pyproj
    except ModuleNotFoundError:  # it is in the extra `gis`
        if isinstance(system, dict):
            return system.get("type") == "GeographicCRS", str(system.get("name", "one without a name"))
        return True if str(system).endswith(DEGREES) else None, str(system)
    try:
        found = pyproj.CRS.from_user_input(system)
    except pyproj.exceptions.CRSError:
        name = system.get("name", "one without a name") if isinstance(system, dict) else system
        return None, str(name)
    return found.is_geographic, found.name
