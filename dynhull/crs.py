"""Whether coordinates are longitudes and latitudes, by the coordinate reference system (CRS) that their source names.

pyproj reads its name or description where it is installed; without it, the usual names and codes are known.

>>> from dynhull.crs import described
>>> described("urn:ogc:def:crs:EPSG::4269")
System(name='NAD83', degrees=True)
"""

import re
import sys
import warnings
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["System", "described"]

HERE = str(Path(__file__).parent)
EPSG = re.compile(r"(?:epsg|srs/epsg\.xml)[:/#](?:[\d.]*[:/])?(\d+)", re.IGNORECASE)
CRS84 = re.compile(r"(?:.*[:/])?crs(84h?|83|27)", re.IGNORECASE)  # of the OGC: longitude and latitude
UNNAMED = "one without a name"
GEOGRAPHIC = {
    4326: "WGS 84",
    4979: "WGS 84",
    4258: "ETRS89",
    4269: "NAD83",
    4267: "NAD27",
    4617: "NAD83(CSRS)",
    6318: "NAD83(2011)",
    4674: "SIRGAS2000",
    4283: "GDA94",
    7844: "GDA2020",
    4167: "NZGD2000",
    4490: "CGCS2000",
    4612: "JGD2000",
    6668: "JGD2011",
    4277: "OSGB36",
    4314: "DHDN",
    4171: "RGF93 v1",
    4230: "ED50",
}
PROJECTED = {
    3857: "WGS 84 / Pseudo-Mercator",
    3035: "ETRS89-extended / LAEA Europe",
    2154: "RGF93 v1 / Lambert-93",
    27700: "OSGB36 / British National Grid",
    5070: "NAD83 / Conus Albers",
    **{32600 + zone: f"WGS 84 / UTM zone {zone}N" for zone in range(1, 61)},
    **{32700 + zone: f"WGS 84 / UTM zone {zone}S" for zone in range(1, 61)},
    **{25800 + zone: f"ETRS89 / UTM zone {zone}N" for zone in range(28, 39)},
    **{26900 + zone: f"NAD83 / UTM zone {zone}N" for zone in range(1, 24)},
}


class System(NamedTuple):
    """A coordinate reference system.

    Attributes:
        name: its name.
        degrees: whether its coordinates are longitudes and latitudes in degrees, from Greenwich; None if that is not
            known, or if they are such in another unit or from another meridian.
    """

    name: str
    degrees: bool | None


def described(system: Any) -> System:
    """What a coordinate reference system is: one of pyproj, or whatever that reads, such as EPSG:4326 or PROJJSON."""
    if not hasattr(system, "is_geographic"):
        if isinstance(system, str) and CRS84.fullmatch(system.strip()):
            return System(system.strip(), degrees=True)
        try:
            import pyproj
        except ModuleNotFoundError:
            return _well_known(system)
        try:
            code = EPSG.search(system) if isinstance(system, str) else None
            system = pyproj.CRS.from_user_input(system if code is None else f"EPSG:{code[1]}")
        except pyproj.exceptions.CRSError:
            return _well_known(system)  # such as PROJJSON of another version
    if not system.is_geographic:
        return System(system.name, degrees=False)
    usual = all(axis.unit_name in ("degree", "metre") for axis in system.axis_info)
    return System(system.name, True if usual and not getattr(system.prime_meridian, "longitude", 0) else None)


def require_frame(system: Any, name: str, *, on_globe: bool) -> None:
    """Warn of degrees in a plane; ValueError for coordinates on the globe that are something else.

    Args:
        system: of the points; None if it is not known.
        name: of the points, for messages.
        on_globe: whether they are for the globe.
    """
    if system is None:
        return
    found = described(system)
    if on_globe and not found.degrees:
        raise ValueError(f"{name} are in {found.name}, not in degrees of longitude and latitude: use to_crs(4326)")
    if not on_globe and found.degrees:
        message = (
            f"{name} are longitudes and latitudes ({found.name}), taken for x and y of a plane: lengths are in "
            "degrees. GeoHull takes them as places on the globe; to_crs projects them into a plane"
        )
        warnings.warn(message, UserWarning, stacklevel=_callers_level())


def _well_known(system: Any) -> System:
    """What is known of a system without pyproj."""
    if isinstance(system, dict):  # PROJJSON
        if parts := system.get("components"):
            return _well_known(parts[0])._replace(name=_name(system))
        kind = system.get("type")
        usual = not system.get("prime_meridian", {}).get("longitude") and "grad" not in str(system)
        return System(_name(system), {"GeographicCRS": usual or None, "ProjectedCRS": False}.get(str(kind)))
    code = EPSG.search(str(system))
    number = int(code[1]) if code is not None else system
    if number in GEOGRAPHIC:
        return System(GEOGRAPHIC[number], degrees=True)
    return System(PROJECTED.get(number, _name(system)), degrees=False if number in PROJECTED else None)


def _name(system: Any) -> str:
    return str(system.get("name", UNNAMED)) if isinstance(system, dict) else str(system)


def _callers_level() -> int:
    """The level of the frame that has called the library, for the warning to name its line."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(HERE):
        frame, level = frame.f_back, level + 1
    return level
