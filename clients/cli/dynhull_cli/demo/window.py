"""The positions of a scene within a sliding window."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from ..durations import shown
from .scene import Frame, Scene


class RecentPositions:
    """All positions that the points of a scene had within `max_age`, as points without keys.

    The frames of the scene have times. Time passes with the data: while no point is there, none becomes older.
    """

    keyed = False
    circles: dict[str, tuple[float, float, float]] = {}  # noqa: RUF012  (nobody changes it)
    rivals: tuple[str, str] | None = None

    def __init__(self, scene: Scene, max_age: timedelta) -> None:
        self.title = f"{scene.title}: positions of the last {shown(max_age)}"
        self.hull_name = f"{scene.hull_name}/window"
        self.max_age: timedelta | None = max_age
        self.counted = "positions"
        self.step = scene.step
        self.length_unit = scene.length_unit
        self.area_unit = scene.area_unit
        self.area_scale = scene.area_scale
        self.center = scene.center
        self.length = scene.length
        self.notes = scene.notes
        self.background = scene.background
        self._scene = scene
        self._age = max_age

    def frames(self) -> Iterator[Frame]:
        """The frames of the scene, with the positions in the window."""
        recent: deque[Frame] = deque()
        for frame in self._scene.frames():
            if len(frame.points):
                recent.append(frame)
                while _time(recent[0]) <= _time(frame) - self._age:
                    recent.popleft()
            names = [name for each in recent for name in each.names]
            positions = np.concatenate([np.empty((0, 2)), *(each.positions for each in recent)])
            yield replace(frame, positions=positions, names=names, keys=(), removed=())


def _time(frame: Frame) -> datetime:
    if frame.time is None:
        raise ValueError("a window needs frames with times")
    return frame.time
