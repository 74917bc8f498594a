"""Rows that a server refuses: which of a batch they are, and why."""

from time import time
from typing import TYPE_CHECKING

import numpy as np

from dynhull.globe import REACH, Gnomonic

from ..fields import of_row
from ..reading.times import shown_time
from .chunks import Points, Rows

if TYPE_CHECKING:
    from dynhull_client import HullInfo, InvalidRequestError

Center = tuple[float, float]
Refused = dict[int, str]
"""The reasons, by row."""

TOO_FAR = "degrees from the centre"
TOO_FAR_AHEAD = "further ahead of the server's clock"
CHOSEN = ", the mean direction of the first points"
MICROSECONDS = 1_000_000


def refused_rows(rows: Rows, error: "InvalidRequestError", center: Center | None) -> Refused:
    """The rows of a refused batch that are at fault: the one that the error names, and others with the same fault.

    `center` is that of a hull on the globe; None if it has none, or is a plane.
    """
    assert error.row is not None  # a row is at fault
    refused: Refused = {}
    if TOO_FAR in str(error):
        refused = Reach(center).beyond(rows)
    elif TOO_FAR_AHEAD in str(error) and rows.times is not None:
        first, problem = rows.times[error.row], str(error).partition(f"{error.value}: ")[2]
        later = (row for row, each in enumerate(rows.times) if each >= first)
        refused = {row: f"time is {shown_time(rows.times[row])}: {problem}" for row in later}
    return {error.row: of_row(error)} | refused


class Expected:
    """What a server would refuse of batches that are not sent.

    Args:
        info: the hull; None if it is to be created.
        on_globe: whether it is on the globe.
    """

    def __init__(self, info: "HullInfo | None", *, on_globe: bool) -> None:
        self._reach = Reach(None if info is None else info.center) if on_globe else None
        window = None if info is None else info.window
        refuses = window is not None and window.max_skew is not None and window.ahead == "refuse"
        self._skew = window.max_skew if window is not None and refuses else None

    def refused(self, rows: Rows) -> Refused:
        """The rows of the next batch that it would refuse."""
        refused = {} if self._reach is None else self._reach.beyond(rows)
        if self._skew is not None and rows.times is not None:
            latest = int(time() * MICROSECONDS) + round(self._skew.total_seconds() * MICROSECONDS)
            problem = f"{TOO_FAR_AHEAD} than this hull allows, if that is as this one: the latest time is"
            refused |= {
                row: f"time is {shown_time(each)}: {problem} {shown_time(latest)}"
                for row, each in enumerate(rows.times)
                if each > latest
            }
        return refused


class Reach:
    """The places that a hull on the globe takes.

    Args:
        center: of the hull; None if the first rows choose it, as they do in the server.
    """

    def __init__(self, center: Center | None) -> None:
        self._frame = None if center is None else Gnomonic(center)
        self._chosen = "" if center is not None else CHOSEN

    def beyond(self, rows: Rows) -> Refused:
        """The rows that are too far from the centre. If it is not known yet, the others choose it."""
        frame = self._frame
        if frame is None:
            frame = self._frame = _chosen(rows.points)
        _, near = frame.project(rows.points)
        return {row: self._problem(frame, rows.points[row]) for row in np.flatnonzero(~near).tolist()}

    def _problem(self, frame: Gnomonic, place: Points) -> str:
        lon, lat = place.tolist()
        far = f"{frame.angle((lon, lat)):.6f} {TOO_FAR} {frame.center}{self._chosen}"
        return f"point is ({lon}, {lat}): {far}; a hull reaches {REACH:g} degrees"


def _chosen(places: Points) -> Gnomonic:
    """The projection about the mean of places, without those that are too far from it."""
    while True:
        frame = Gnomonic.about(places)
        _, near = frame.project(places)
        if near.all():
            return frame
        near[0] |= not near.any()  # places all around: a single one is near itself
        places = places[near]
