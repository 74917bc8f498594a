"""Points that are longitudes and latitudes; the others are bad rows."""

from dataclasses import replace

import numpy as np

from .chunks import BadRow, Chunk

GREATEST = 360.0, 90.0


def places_only(chunk: Chunk, before: int) -> Chunk:
    """The chunk without points that are no places; `before` is the number of points before it."""
    points = chunk.rows.points
    wrong = (np.abs(points) > GREATEST).any(axis=1)
    if not wrong.any():
        return chunk
    bad = [
        BadRow(f"point {before + row + 1}", _problem(*points[row].tolist()), f"{points[row, 0]},{points[row, 1]}")
        for row in np.flatnonzero(wrong).tolist()
    ]
    return replace(chunk, rows=chunk.rows.at(np.flatnonzero(~wrong).tolist()), bad=[*chunk.bad, *bad])


def _problem(lon: float, lat: float) -> str:
    if abs(lat) > GREATEST[1]:
        hint = "; the longitude comes first" if abs(lon) <= GREATEST[1] else ""
        return f"the latitude is {lat}, not from -90 to 90 degrees{hint}"
    return f"the longitude is {lon}, not from -360 to 360 degrees"
