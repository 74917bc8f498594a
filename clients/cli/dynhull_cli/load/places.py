"""Points that are longitudes and latitudes; the others are bad rows."""

from dataclasses import replace

import numpy as np

from ..reading.columns import GREATEST_LATITUDE, GREATEST_LONGITUDE, UNKNOWN_LATITUDE, why_no_place
from .chunks import Chunk


def places_only(chunk: Chunk, *, on_globe: bool) -> Chunk:
    """The chunk without points that are no places: in a plane, degrees can have any size."""
    rows, points = chunk.rows, chunk.rows.points
    if on_globe:
        wrong = (np.abs(points) > (GREATEST_LONGITUDE, GREATEST_LATITUDE)).any(axis=1)
    else:
        wrong = points[:, 1] == UNKNOWN_LATITUDE
    if not wrong.any():
        return chunk
    bad = [rows.bad(row, why_no_place(*points[row].tolist()) or "") for row in np.flatnonzero(wrong).tolist()]
    return replace(chunk, rows=rows.at(np.flatnonzero(~wrong).tolist()), bad=[*chunk.bad, *bad])
