"""The settings of a fence."""

from dataclasses import dataclass
from typing import Literal

from ...alarms.rule import AlarmRule

Initial = Literal["snapshot", "events", "none"]
SubjectKind = Literal["hull", "prefix", "other"]
CORNER_BYTES = 16
Ring = bytes  # the corners as pairs of little-endian doubles


@dataclass(frozen=True, slots=True)
class HullArea:
    """A live hull as an area, or one of its convex layers, from 1.

    With `without_self` each subject is compared with the hull of the others.
    """

    name: str
    without_self: bool = False
    layer: int = 1


@dataclass(frozen=True, slots=True)
class PolygonArea:
    """Polygons joined by "or", each an exterior ring and holes."""

    polygons: tuple[tuple[Ring, ...], ...]


@dataclass(frozen=True, slots=True)
class CircleArea:
    """A disk."""

    x: float
    y: float
    radius: float


# With an AlarmRule the fence is an alarm, and nobody is compared with an area.
Area = HullArea | PolygonArea | CircleArea | AlarmRule


@dataclass(frozen=True, slots=True)
class FenceConfig:
    """The settings of a fence; durations and times are in microseconds, 0 for none.

    Attributes:
        area: what subjects are compared with.
        kind: who is compared: the keys of a hull ("hull"), those of all keyed hulls with a prefix ("prefix"), or a hull
            as a whole ("other"). Of an alarm, a hull as a whole ("other") or all with a prefix.
        subjects: the name of the hull, or the prefix.
        closed: whether the boundary belongs to the area.
        margin: how far outside of the area a subject that is inside has to be to leave.
        near: with an other hull, the distance up to which the hulls are near.
        initial: what a new fence says about the subjects that are inside already.
        crosses: whether a subject that passes through the area makes an event.
        dwell: the time inside after which a subject makes an event.
        confirmations: the number of consecutive reports that must agree before a subject enters or leaves.
        min_dwell: how long a subject must be on the other side before it enters or leaves.
        by_accuracy: whether a subject enters or leaves only once it is on the other side by more than the accuracy of
            its position.
        expected: the keys that should be inside.
        expected_by: the time of day by which they should be, as it is written; empty for none.
        expected_within: or the time outside after which they are missing.
        max_events: the number of events to keep, 0 for the limit of the server.
        max_event_age: how long events are kept.
    """

    area: Area
    kind: SubjectKind
    subjects: str
    closed: bool = True
    margin: float = 0.0
    near: float = 0.0
    initial: Initial = "snapshot"
    crosses: bool = False
    dwell: int = 0
    confirmations: int = 0
    min_dwell: int = 0
    max_events: int = 0
    max_event_age: int = 0
    by_accuracy: bool = False
    expected: tuple[str | int, ...] = ()
    expected_by: str = ""
    expected_within: int = 0

    @property
    def rule(self) -> AlarmRule | None:
        """The rule of an alarm, None for a fence."""
        return self.area if isinstance(self.area, AlarmRule) else None

    @property
    def delays(self) -> bool:
        """Whether a change of side becomes an event only later."""
        return self.confirms or self.by_accuracy

    @property
    def confirms(self) -> bool:
        """Whether it becomes one only when later reports agree, or after some time."""
        return bool(self.confirmations or self.min_dwell)

    @property
    def of_others(self) -> bool:
        """Whether each subject is compared with the hull of the others."""
        return isinstance(self.area, HullArea) and self.area.without_self

    @property
    def area_hull(self) -> str | None:
        """The name of the hull that is the area, or which the rule of an alarm names; None for others."""
        if isinstance(self.area, AlarmRule):
            return self.area.other
        return self.area.name if isinstance(self.area, HullArea) else None

    @property
    def area_layer(self) -> int:
        """The convex layer of the hull that is the area; 1 for other areas."""
        return self.area.layer if isinstance(self.area, HullArea) else 1

    @property
    def corners(self) -> int:
        """The number of corners of its polygons, with repeated ones."""
        rings = (
            (ring for polygon in self.area.polygons for ring in polygon) if isinstance(self.area, PolygonArea) else ()
        )
        return sum(map(len, rings)) // CORNER_BYTES

    def compares(self, name: str) -> bool:
        """Whether the keys of a hull of that name are subjects, or those of an alarm the hull as a whole."""
        if self.kind != "prefix":
            return self.kind == "hull" and name == self.subjects
        return name.startswith(self.subjects) and (self.rule is None or name != self.rule.other)

    def concerns(self, name: str) -> bool:
        """Whether the fence depends on a hull of that name."""
        return name == self.area_hull or self.compares(name) or (self.kind == "other" and name == self.subjects)
