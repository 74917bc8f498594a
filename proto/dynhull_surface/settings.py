"""The settings of hulls and of fences, each described once.

Command line, gateway, SDK and pages make their options, bodies and texts of these descriptions. Names, areas, subjects
and the rules of a quarantine have another form in each of them: they are fields without a description.
"""

from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Literal

from .described import Flag, setting

Keyed = Literal["str", "int"]
Clock = Literal["server", "data"]
Ahead = Literal["refuse", "clamp"]
Ordering = Literal["arrival", "event_time"]
Boundary = Literal["closed", "open"]
Initial = Literal["snapshot", "events", "none"]

MOST_SHARDS = 1024
DEEPEST_LAYER = 1000
WINDOW = "max_age", "max_points"
A_HULL = "an area that is a hull"


@dataclass(frozen=True, slots=True, init=False, eq=False, repr=False)  # nobody makes one
class HullSettings:
    """The settings of a hull, fixed from its creation."""

    name: str
    keyed: Keyed | None = setting(
        None,
        "identity",
        "Kind of the keys. Default: the points of the hull have none.",
        words={"str": "STRING_KEYS", "int": "INTEGER_KEYS"},
    )
    ordering: Ordering = setting(
        "arrival",
        "ordering",
        "Which of two positions of a key is the later one: the one that arrives last (arrival), or the one with the "
        "later event time (event_time): an older one then changes nothing.",
        needs=("keyed",),
        flag=Flag("--event-order", "event_time", "Of two positions of a key, keep the one with the later event time."),
    )
    max_age: timedelta | None = setting(None, "window.max_age", "Age at which points leave. Default: never.")
    max_points: int | None = setting(
        None,
        "window.max_points",
        "Number of points beyond which the oldest leave. Default: no such limit. For a limit that refuses, see "
        "`point_limit`.",
        least=1,
    )
    clock: Clock = setting(
        "server",
        "window.clock",
        "Clock that decides what is too old: the server's, or data for the greatest event time so far.",
        needs=WINDOW,
    )
    max_skew: timedelta | None = setting(
        None,
        "window.max_skew",
        "How far an event time may be ahead of the server's clock. Default: any distance.",
        needs=(*WINDOW, "ordering"),
    )
    ahead: Ahead = setting(
        "refuse",
        "window.ahead",
        "What happens to event times further ahead: refuse the batch, or clamp the time to the latest allowed.",
        needs=(*WINDOW, "max_skew"),
        flag=Flag("--clamp", "clamp", "Reduce event times further ahead to the latest allowed."),
    )
    point_limit: int | None = setting(
        None,
        "max_points",
        "Number of points beyond which a batch is refused. Default: the server's own limit.",
        least=1,
    )
    geographic: bool = setting(
        False,
        "frame",
        "Whether points are longitudes and latitudes in degrees, rather than points of a plane.",
        words={True: "GEOGRAPHIC"},
    )
    center: tuple[float, float] | None = setting(
        None,
        "center",
        "Longitude and latitude of the centre of a geographic hull, whose points are all within 85 degrees of it. "
        "Default: the mean direction of its first points.",
        needs=("geographic",),
        also="--centre",
    )
    quarantine: Any = None
    shards: int | None = setting(
        None,
        "shards",
        "Number of shards among which the server divides the points, for a hull that is too much for one process. "
        "Some settings and questions are refused then. Default: it is not divided.",
        least=1,
        greatest=MOST_SHARDS,
    )


@dataclass(frozen=True, slots=True, init=False, eq=False, repr=False)  # nobody makes one
class FenceSettings:
    """What a fence compares, and when it makes events."""

    name: str
    area: Any
    subjects: Any
    other_hull: str | None
    expected: Any
    boundary: Boundary = setting(
        "closed", "boundary", "Whether a subject on the boundary is inside (closed) or outside (open)."
    )
    margin: float = setting(
        0.0,
        "margin",
        "How far outside of the area a subject that is inside has to be to leave. On the globe metres, at most 250000.",
        least=0,
    )
    initial: Initial = setting(
        "snapshot",
        "initial",
        "What the fence says about subjects that are inside at first: one event with all of them (snapshot), an enter "
        "of each (events), or none.",
        at_creation=True,
    )
    crosses: bool = setting(
        False,
        "report_crosses",
        "Whether a subject that is outside before and after, but whose straight way between meets the area, makes an "
        "event.",
    )
    dwell: timedelta | None = setting(
        None,
        "dwell",
        "Time after which a subject that is still inside makes an event. Default: it makes none.",
        least=0,
    )
    confirmations: int = setting(
        0,
        "confirmations",
        "Number of consecutive reports that must agree before a subject enters or leaves.",
        least=0,
    )
    min_dwell: timedelta | None = setting(
        None,
        "min_dwell",
        "How long a subject must be on the other side before it enters or leaves. Default: no time.",
        least=0,
    )
    by_accuracy: bool = setting(
        False,
        "by_accuracy",
        "Whether a subject whose position has an accuracy enters or leaves only once it is on the other side by more "
        "than that.",
    )
    expected_by: str | None = setting(
        None,
        "expected_by",
        "With `expected`: time of day by which these keys should be inside, a time zone and perhaps days, as in "
        '"18:00 Europe/Berlin mon-fri". Each that is not makes an event.',
    )
    expected_within: timedelta | None = setting(
        None,
        "expected_within",
        "With `expected`: time after which one of these keys that is outside makes an event.",
    )
    near: float = setting(
        0.0, "near_distance", "With `other_hull`: the hulls are near while their distance is at most this.", least=0
    )
    without_self: bool = setting(
        False,
        "hull_area.without_self",
        "Whether each subject that is a point of the area's hull is compared with the hull of the others. The area is "
        "then the subjects' own hull, and there is a `margin`.",
        of=A_HULL,
    )
    layer: int = setting(
        1,
        "hull_area.layer",
        "Convex layer of the area's hull; 1 is the hull itself. Each batch of that hull then finds the layer anew.",
        least=1,
        greatest=DEEPEST_LAYER,
        of=A_HULL,
    )
    max_events: int = setting(0, "max_events", "Number of events to keep; 0 for the limit of the server.", least=0)
    max_event_age: timedelta | None = setting(
        None, "max_event_age", "How long events are kept. Default: no limit of the fence.", least=0
    )
