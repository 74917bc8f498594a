"""Well-known binary (OGC 06-103r4, chapter 8, and EWKB's flags) as GeoJSON geometries."""

import struct
from typing import Any

KINDS = ["Point", "LineString", "Polygon", "MultiPoint", "MultiLineString", "MultiPolygon", "GeometryCollection"]
HAS_Z, HAS_M, HAS_SRID = 0x80000000, 0x40000000, 0x20000000
FLAGS = HAS_Z | HAS_M | HAS_SRID
SRID_BYTES = 4


def decode(data: bytes) -> dict[str, Any]:
    """The geometry, with x and y only; ValueError if the bytes are not a geometry."""
    try:
        return _Reader(data).geometry()
    except (struct.error, IndexError):
        raise ValueError("its geometry is not well-known binary") from None


def srid_of(data: bytes) -> int | None:
    """The SRID of EWKB; None without one."""
    order = "<" if data[:1] != b"\0" else ">"
    try:
        code, srid = struct.unpack_from(f"{order}II", data, 1)
    except struct.error:
        return None
    return srid if code & HAS_SRID else None


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0
        self._order = "<"

    def geometry(self) -> dict[str, Any]:
        self._order = "<" if self._take("B") else ">"
        code = self._take("I")
        if code & HAS_SRID:
            self._at += SRID_BYTES
        dimension, kind = divmod(code & ~FLAGS, 1000)
        flagged = bool(code & HAS_Z) + bool(code & HAS_M)
        more = flagged or (0, 1, 1, 2)[dimension]  # ISO: Z is 1000, M is 2000, both are 3000
        name = KINDS[kind - 1] if kind else KINDS[len(KINDS)]
        match name:
            case "Point":
                return {"type": name, "coordinates": self._vertices(1, more)[0]}
            case "LineString":
                return {"type": name, "coordinates": self._vertices(self._take("I"), more)}
            case "Polygon":
                rings = [self._vertices(self._take("I"), more) for _ in range(self._take("I"))]
                return {"type": name, "coordinates": rings}
            case "GeometryCollection":
                return {"type": name, "geometries": self._parts()}
            case _:
                return {"type": name, "coordinates": [part["coordinates"] for part in self._parts()]}

    def _parts(self) -> list[dict[str, Any]]:
        return [self.geometry() for _ in range(self._take("I"))]

    def _take(self, kind: str) -> int:
        (value,) = struct.unpack_from(self._order + kind, self._data, self._at)
        self._at += struct.calcsize(self._order + kind)
        return int(value)

    def _vertices(self, count: int, more: int) -> list[list[float]]:
        size = 2 + more
        numbers = struct.unpack_from(f"{self._order}{count * size}d", self._data, self._at)
        self._at += 8 * len(numbers)
        return [list(numbers[i : i + 2]) for i in range(0, len(numbers), size)]
