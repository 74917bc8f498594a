"""The input of a demo: points that appear, move and disappear, frame by frame."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Protocol

from dynhull.arrays import Points as Points


@dataclass(frozen=True, slots=True)
class Frame:
    """One batch of changes, and all points after it.

    Attributes:
        clock: the time of the frame, or other text that orders the frames.
        points: (k, 2) points to put or to insert.
        positions: (n, 2) all points after the batch.
        names: n names, one for each position.
        milestone: whether to print a line about it.
        keys: k keys, in a scene with keys.
        removed: keys to remove.
        time: the time of the frame, where it is one.
    """

    clock: str
    points: Points
    positions: Points
    names: list[str]
    milestone: bool
    keys: Sequence[str] = ()
    removed: Sequence[str] = ()
    time: datetime | None = None

    def names_at(self, vertices: Points) -> list[str]:
        """The name of a point at each of (h, 2) vertices, with the number of others there."""
        there: dict[tuple[float, ...], list[str]] = {}
        for position, name in zip(self.positions.tolist(), self.names, strict=True):
            there.setdefault(tuple(position), []).append(name)
        found = [there[tuple(vertex)] for vertex in vertices.tolist()]
        return [first if not others else f"{first} +{len(others)}" for first, *others in found]


class Scene(Protocol):
    """Frames, and the words for them.

    Attributes:
        title: the heading, also of the picture.
        hull_name: the hull's name on the server.
        keyed: whether points have keys.
        max_age: the age at which points leave the hull by themselves; None for never.
        counted: what the points are, in the plural.
        step: what a frame is, in the plural.
        length_unit: the unit of coordinates, as an adjective of an axis.
        area_unit: the unit of an area.
        area_scale: the number of these in a unit of the server.
        center: the longitude and latitude of the centre of a geographic hull; None for a plane.
        length: the number of frames.
        notes: lines about the input, such as what was left out; printed first.
        background: (m, 2) points that never move, drawn faintly.
        circles: the centre and radius of fences that the keys enter and leave, by name; none without keys. On the
            globe radii are metres.
        rivals: two groups of keys, whose hulls are watched for meeting; a key begins with the name of its group and a
            space. None for no groups.
    """

    title: str
    hull_name: str
    keyed: bool
    max_age: timedelta | None
    counted: str
    step: str
    length_unit: str
    area_unit: str
    area_scale: float
    center: tuple[float, float] | None
    length: int
    notes: list[str]
    background: Points
    circles: dict[str, tuple[float, float, float]]
    rivals: tuple[str, str] | None

    def frames(self) -> Iterator[Frame]:
        """The frames in order, each once."""
        ...
