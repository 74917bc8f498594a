"""Points that are longitudes and latitudes; the others are bad rows."""

from dataclasses import replace

import numpy as np

from ..columns import GREATEST_LATITUDE, GREATEST_LONGITUDE, why_no_place
from .chunks import BadRow, Chunk


def places_only(chunk: Chunk, before: int) -> Chunk:
    """The chunk without points that are no places; `before` is the number of points before it."""
    points = chunk.rows.points
    wrong = (np.abs(points) > (GREATEST_LONGITUDE, GREATEST_LATITUDE)).any(axis=1)
    if not wrong.any():
        return chunk
    bad = []
    for row in np.flatnonzero(wrong).tolist():
        lon, lat = points[row].tolist()
        bad.append(BadRow(f"point {before + row + 1}", why_no_place(lon, lat) or "", f"{lon},{lat}"))
    return replace(chunk, rows=chunk.rows.at(np.flatnonzero(~wrong).tolist()), bad=[*chunk.bad, *bad])
