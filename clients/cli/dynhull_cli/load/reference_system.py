"""Whether the geometries of an input are longitudes and latitudes."""

from typing import Any

from dynhull.crs import described

from .source import Source


def note_reference_system(source: Source, system: Any, what: str) -> None:
    """Note whether geometries are degrees, by the coordinate reference system that `what` of the input names.

    `system` is whatever pyproj reads: a name such as EPSG:4326, WKT or PROJJSON; None where none is named.

    ValueError if it is unknown, unless the options say whether these are degrees.
    """
    if system is None:
        source.notes.append(f"{source.name}: {what} names no coordinate reference system: --geographic reads degrees")
        return
    found = described(system)
    if found.degrees:
        source.in_degrees()
    elif found.degrees is False:
        source.not_in_degrees(found.name)
    elif source.asked is None and source.geographic() is not False:
        raise ValueError(
            f"{source.name}: {what} is in {found.name}, which is not known to be degrees: --geographic takes it for "
            "degrees of longitude and latitude, --plane for x and y"
        )
