"""A hull at one revision, as it is drawn and described."""

import math

import numpy as np

from dynhull_client import Deleted, DynhullError, Event, HullCopy, Progress, Sampled

from .degrees import SQUARE_KILOMETRE, Center, outline, poles, shown
from .drawing import Drawing
from .outline import Box, apart, box_around, drawn

SAMPLE_SIZE = 2_000
# A few points are sampled as often as the hull is drawn; among many, no viewer misses one that is late.
FEW_POINTS_SECONDS, MANY_POINTS_SECONDS = 0.1, 2.0

NO_POINTS = HullCopy().vertices


class HullState:
    """What is known of a hull: now, or as it was.

    Attributes:
        name: the name of the hull.
        followed: whether an event has arrived since the hull was last missing.
        revision: its revision.
        points: its number of points, with multiplicity.
        vertices: its number of vertices.
        area: its area, of a geographic hull in square metres; NaN before it is known.
        bounds: the smallest box around it; None while it is empty or unknown.
        center: the centre of a geographic hull; None for a plane, or while there is none.
        poles: the poles in it, such as "south".
        rate: batches per second, over the last second; NaN where that is not known.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.rate = math.nan
        self.reset()

    def reset(self) -> None:
        """Nothing is known of it."""
        self.followed = False
        self.revision = 0
        self.points = 0
        self.vertices = 0
        self.area = math.nan
        self.bounds: Box | None = None
        self.center: Center | None = None
        self.poles: list[str] = []
        self._outline = Drawing("vertices", self.name, 0, NO_POINTS)
        self._inner = Drawing("points", self.name, 0, NO_POINTS)

    @property
    def trouble(self) -> DynhullError | None:
        """Why it is not known at the moment; None where it is."""
        return None

    @property
    def shown_area(self) -> float:
        """The area as it is shown: of a geographic hull in square kilometres."""
        return self.area if self.center is None else self.area / SQUARE_KILOMETRE

    @property
    def sample_pause(self) -> float:
        """The least pause between samples of its points, in seconds."""
        return FEW_POINTS_SECONDS if self.points <= SAMPLE_SIZE else MANY_POINTS_SECONDS

    def drawings(self) -> tuple[Drawing, Drawing]:
        """The vertices, and a sample of the other points."""
        return self._outline, self._inner

    def take(self, event: Event, copy: HullCopy) -> None:
        """Take an event that has its measures, and the copy that it has updated."""
        self.followed = True
        self.revision, self.points = event.revision, event.points
        if isinstance(event, Progress | Deleted):
            return
        assert event.measures is not None  # requested by measures=True
        self.vertices = len(copy.vertices)
        self.area = event.measures.area
        self.center = copy.center
        rows = drawn(self.vertices)
        corners = shown(copy.vertices[rows], self.center)
        self.bounds, self.poles, rings = None, [], None
        if self.vertices and self.center is None:
            self.bounds = event.measures.bounds
        elif self.vertices:
            rings = outline(copy.vertices[rows], self.center)
            self.bounds, self.poles = box_around(np.concatenate(rings)), poles(rings)
        keys = None if copy.vertex_keys is None else copy.vertex_keys[rows]
        self._outline = Drawing("vertices", self.name, event.revision, corners, keys, rings)

    def take_sample(self, sampled: Sampled) -> None:
        """Take some of its points; those that are vertices are drawn as such."""
        points = shown(sampled.points, self.center)
        inner = apart(points, self._outline.points)
        keys = None if sampled.keys is None else [sampled.keys[row] for row in np.flatnonzero(inner)]
        self._inner = Drawing("points", self.name, sampled.revision, points[inner], keys)
