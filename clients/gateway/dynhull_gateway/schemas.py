"""What requests and responses look like: these declarations validate, convert and document.

Numbers are read as the nearest double, as in every JSON; there is no number where a double is infinite or not a number.
"""

from typing import Annotated, Any, Literal
from urllib.parse import unquote

import numpy as np
from fastapi import Body, Header, Path, Query
from pydantic import (
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictStr,
    StringConstraints,
    Tag,
    model_validator,
)
from typing_extensions import TypeAliasType

import dynhull_client as sdk
from dynhull_surface import settings as surface
from dynhull_surface.counts import COUNTS
from dynhull_surface.iso_times import LEAP_SECOND, from_iso

from . import examples
from .answers import Finite, Place, Rows, answering, listed, rows, seconds
from .numbers import LARGEST as LARGEST
from .numbers import SPAN, KeptSpan, Moment, Seconds
from .numbers import Number as Number
from .numbers import Point as Point
from .setting_fields import with_settings

NO_TIME = np.datetime64(0, "us")  # of a key without event time

NAME = r"^[A-Za-z0-9._/-]{1,200}$"
NAMES = "1 to 200 letters a to z and A to Z, digits and ._-/; a slash in a path is written %2F"


def unquoted(value: Any) -> Any:
    """A segment of a path, which is matched as it was sent."""
    return unquote(value, errors="replace") if isinstance(value, str) else value


def _times(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    return [None if np.isnat(each) or each == NO_TIME else f"{each}Z" for each in value]


def _time(value: Any) -> Any:
    if isinstance(value, int | float):
        raise ValueError("must be a time such as 2026-01-31T12:00:00Z")  # pydantic reports ValueErrors
    if isinstance(value, str) and LEAP_SECOND.search(value):
        return from_iso(value)
    return value


Count = Annotated[int, Field(strict=True, ge=0, le=LARGEST)]
Name = Annotated[str, Field(strict=True, pattern=NAME, description=NAMES, examples=["fleet"])]
Key = (
    Annotated[str, Field(strict=True, min_length=1, max_length=255)]
    | Annotated[int, Field(strict=True, ge=0, le=LARGEST)]
)
Accuracy = Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]
Time = Annotated[AwareDatetime, BeforeValidator(_time)]
Points = list[Point]

Pairs = Annotated[list[Annotated[list[Place], Field(min_length=2, max_length=2)]], BeforeValidator(rows)]
Numbers = Annotated[list[float | None], BeforeValidator(rows)]
Integers = Annotated[list[int], BeforeValidator(rows)]
Booleans = Annotated[list[bool], BeforeValidator(rows)]
Keys = Annotated[list[str] | list[int], BeforeValidator(lambda keys: list(rows(keys)))]
Times = Annotated[list[str | None], BeforeValidator(_times)]

Segment = Annotated[str, StringConstraints(pattern=NAME), BeforeValidator(unquoted)]
THE_HULL = f"The hull: {NAMES}."
HullPath = Annotated[Segment, Path(alias="name", description=THE_HULL, examples=["fleet"])]
GlobePath = Annotated[Segment, Path(alias="name", description=THE_HULL, examples=["ships"])]
AlloyPath = Annotated[Segment, Path(alias="name", description=THE_HULL, examples=["alloy"])]
AssetsPath = Annotated[Segment, Path(alias="name", description=THE_HULL, examples=["assets"])]
DividedPath = Annotated[Segment, Path(alias="name", description=THE_HULL, examples=["sensors"])]
AnyHullPath = Annotated[
    Segment,
    Path(
        alias="name",
        description=THE_HULL,
        openapi_examples=examples.hulls("fleet", "ships", "alloy", "assets"),
    ),
]
FencePath = Annotated[Segment, Path(alias="name", description=f"The fence: {NAMES}.", examples=["yard"])]
AlarmPath = Annotated[Segment, Path(alias="name", description=f"The alarm: {NAMES}.", examples=["spread"])]
ConsumerPath = Annotated[
    Segment, Path(alias="consumer", description=f"The durable consumer: {NAMES}.", examples=["billing"])
]
ProducerPath = Annotated[Segment, Path(alias="producer", description=f"The producer: {NAMES}.", examples=["sensor-7"])]
MinRevision = Annotated[
    int, Query(ge=0, le=LARGEST, description="Wait, within the time limit, until the hull has reached this revision.")
]
Prefix = Annotated[str, Query(max_length=200, description="Only names that begin with this.")]
After = Annotated[str, Query(max_length=200, description="Only names after this one: the last of the page before.")]
Limit = Annotated[int, Query(ge=1, le=1000, description="The most that are returned.")]
IDEMPOTENCY_KEY = r'^"?[A-Za-z0-9._/-]{1,200}:[1-9][0-9]{0,18}"?$'
PLACE = r"^[0-9a-f]{1,32}:[0-9]{1,20}$"
STREAM_PATH = r"^/[!-~]*$"
EVENT_ID = r"^[!-~]*$"
LABEL = r"^[A-Za-z0-9._-]{1,64}$"
LABELS = "1 to 64 letters a to z and A to Z, digits and ._-"
# What patterns say, for those who do not match them.
PATTERNS = {
    PLACE: 'must be as the link "next" has it, UID:REVISION',
    NAME: f"must be a name: {NAMES}",
    STREAM_PATH: "must be a path that begins with /, and a query, as they are sent",
    EVENT_ID: "must be the id of an event",
    LABEL: f"must be a name: {LABELS}",
    IDEMPOTENCY_KEY: f"must be PRODUCER:SEQUENCE, such as sensor-7:1: {NAMES.partition(';')[0]}, and an integer from 1",
}
IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        pattern=IDEMPOTENCY_KEY,
        description="PRODUCER:SEQUENCE makes the request safe to repeat: the hull applies each number of a producer "
        "once, whatever the body: what comes with a number that it has is not applied, and counts as `duplicate` or "
        "`repeated`. Of a body of rows, it is the number of the first row, and the rows are counted on from there.",
        examples=["sensor-7:1"],
    ),
]
MaySkip = Annotated[
    bool, Query(description="Whether the numbers of the producer rise and may skip, as the offsets of a log do.")
]


def body(of: examples.Examples) -> Any:
    """A body with examples."""
    return Body(openapi_examples=of)


def example(**fields: Any) -> ConfigDict:
    """The configuration of a body with an example."""
    return ConfigDict(json_schema_extra={"examples": [fields]})


class Request(BaseModel):
    """A body: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid")

    def arguments(self) -> dict[str, Any]:
        """The fields as arguments of the SDK."""
        return {name: getattr(self, name) for name in type(self).model_fields}


class Response(BaseModel):
    """An answer: made of the SDK's values."""

    model_config = ConfigDict(from_attributes=True)


# A moment of the past, as text.

# Hulls


class QuarantineRules(Request):
    """The rules that hold positions of keys out of a hull; null for those that are off."""

    model_config = example(max_speed=1000, confirmations=2)

    max_speed: Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)] | None = Field(
        None, description="Greatest speed, in units of the coordinates a second, or metres a second on the globe."
    )
    max_growth: Annotated[float, Field(strict=True, ge=1, allow_inf_nan=False)] | None = Field(
        None, description="Greatest factor by which one position may enlarge the area of the hull."
    )
    confirmations: Annotated[int, Field(strict=True, ge=0, le=1000)] = Field(
        1, description="Later, consistent positions that let a key in; 0 for none: only by request."
    )


KeptFor = Annotated[
    StrictBool | KeptSpan | None,
    Field(
        description="For how long the past is kept: true for ever, seconds, or text such as 30d; null for not at all."
    ),
]
KeptBytes = Annotated[
    Annotated[int, Field(strict=True, ge=1, lt=2**63)] | None,
    Field(description="In how many bytes the past is kept at most, the oldest going first; null for any number."),
]


class KeptHistory(Request):
    """How much of its past a hull keeps."""

    model_config = example(history="30d")

    history: KeptFor
    history_bytes: KeptBytes = None


class ErasedKeys(Request):
    """Keys to erase from the past of a hull."""

    model_config = example(keys=["LH400"])

    keys: list[Key]


@answering(sdk.Erasure)
class Erasure(Response):
    """Keys were erased from the past of a hull. Which ones is kept nowhere."""


@answering(sdk.History)
class History(Response):
    """What is there of the past of a hull."""

    history: Annotated[Literal[True] | float | None, BeforeValidator(seconds)] = Field(
        description="For how long the past is kept, in seconds; true for ever, null for not at all."
    )


@with_settings(surface.HullSettings)
class NewHull(Request):
    """The settings of a hull, fixed from its creation."""

    name: Name
    quarantine: QuarantineRules | None = Field(None, description="Rules that hold bad positions of keys out.")
    history: KeptFor = None
    history_bytes: KeptBytes = None
    exist_ok: StrictBool = Field(False, description="Return an existing hull with these settings.")

    def arguments(self) -> dict[str, Any]:
        """The fields as arguments of the SDK."""
        quarantine = None if self.quarantine is None else sdk.Quarantine(**self.quarantine.arguments())
        return super().arguments() | {"quarantine": quarantine}


@answering(sdk.Quarantine, finite=True)
class PresentRules(Response):
    """The rules of a quarantine; null for those that are off."""


@answering(sdk.Window)
class Window(Response):
    """A hull's sliding window; without `max_age` and `max_points`, only what event times may be."""


@answering(sdk.HullInfo)
class HullInfo(Response):
    """A hull, its size and its settings."""

    quarantine: PresentRules | None = Field(description="Null for a hull that has never had any rules.")
    restored: bool = Field(description="Whether a backup has brought the hull back, without the batches after it.")


class HullPage(Response):
    """Hulls by name. `next` is the `after` of the next page; null on the last."""

    hulls: list[HullInfo]
    next: str | None


@answering(sdk.Measures)
class Measures(Response):
    """Measures of a hull; null where there is no number. Of a geographic hull in metres and square metres."""


class Hull(Response):
    """A hull at one revision. `vertices` are counter-clockwise; `vertex_keys` null without keys."""

    info: HullInfo
    vertices: Rows
    vertex_keys: list[str] | list[int] | None
    measures: Measures


class Feature(Response):
    """A GeoJSON Feature (RFC 7946)."""

    type: Literal["Feature"]
    id: str | int
    geometry: dict[str, Any] | None
    properties: dict[str, Any]


class MinCircle(Response):
    """The smallest circle around the points."""

    center: Place
    radius: Finite

    @model_validator(mode="before")
    @classmethod
    def _of_pair(cls, value: Any) -> Any:
        return {"center": value[0], "radius": value[1]} if isinstance(value, tuple) else value


@answering(sdk.Measured)
class AllMeasures(Measures):
    """All measures of a hull."""

    min_circle: MinCircle


class Recenter(Request):
    """The new centre; null for the mean direction of the points."""

    center: Point | None = None


class Reshard(Request):
    """The number of shards from now on."""

    shards: Annotated[int, Field(strict=True, ge=1, le=1024)]


@answering(sdk.HeldPosition)
class HeldPosition(Response):
    """A position in quarantine."""

    speed: Finite = Field(description="Null if it is not too fast, or if it moved in no time: see `breaks`.")
    breaks: Annotated[list[Literal["max_speed", "max_growth"]], BeforeValidator(listed)]


class HeldPage(Response):
    """Positions in quarantine by key. `next` is the `after` of the next page; null on the last."""

    held: list[HeldPosition]
    next: str | None


class LastSequence(Response):
    """The number of the last batch of a producer that was applied; 0 if there is none."""

    last_sequence: int


# Changes


class Move(Request):
    """Points and where they move, row by row."""

    origins: Points
    destinations: Points


class Batch(Request):
    """Changes that are applied together or not at all: points to insert, delete and move, or keys to put and remove."""

    insert: Points | None = Field(None, description="Points to insert.", examples=[[[0, 0], [4, 0], [2, 3]]])
    delete: Points | None = Field(None, description="Points to delete.")
    move: Move | None = Field(None, description="Points to move.")
    keys: list[Key] | None = Field(None, description="Keys to put, in a keyed hull,")
    points: Points | None = Field(None, description="and their positions.")
    times: list[Time] | None = Field(None, description="Event times of the points to insert or put.")
    remove: list[Key] | None = Field(None, description="Keys to remove.")
    release: list[Key] | None = Field(None, description="Keys in quarantine to let in.")
    drop: list[Key] | None = Field(None, description="Keys in quarantine whose held position is dropped.")
    only: Literal["absent", "present"] | None = Field(None, description="Put only new keys, or only known ones.")
    ttl: Seconds | None = Field(None, description=f"Time after which the keys leave. {SPAN}.")
    expire_times: list[Time] | None = Field(None, description="Times at which the keys leave, instead of ttl.")
    accuracies: list[Accuracy] | None = Field(
        None, description="How far the positions may be from where the keys are: units of the coordinates, or metres."
    )
    missing: Literal["raise", "count"] | None = Field(
        None, description="Refuse the batch, or skip and count, where a point or key is not there."
    )


@answering(sdk.Applied)
class Applied(Response):
    """The effect of a batch. If `gathered` is more than 1, that of all the requests that were applied together."""

    held_rows: Annotated[list[int], BeforeValidator(listed)] = Field(
        description="The rows of this request that were put into quarantine."
    )
    gathered: int = Field(1, description="Requests whose changes were applied together, as one revision.")


class Transfer(Request):
    """A batch for each of 2 to 16 hulls: all are applied or none."""

    batches: dict[Name, Batch] = Field(min_length=2, max_length=16)


class Transferred(Response):
    """The effect on each hull."""

    results: dict[str, Applied]


class BadRow(Response):
    """A row that was left out."""

    row: int = Field(description="Its number in the body, counted from 0.")
    detail: str = Field(description="What is wrong with it.")
    field: str | None = Field(None, description="The column or member at fault.")
    value: str | None = Field(None, description="The value at fault.")


@answering(sdk.Applied, COUNTS)
class Uploaded(Response):
    """The effect of a body of rows: the sums over its batches, and the hull after the last one."""

    rows: int = Field(
        description="Rows of the body: applied, now or by an earlier request, or bad and left out (max_bad)."
    )
    repeated: int = Field(description="Rows that an earlier request had applied.")
    batches: int
    revision: int | None = Field(description="Of the last batch; null if there was nothing to apply.")
    points: int | None
    bad_rows: int = Field(description="Rows left out because they cannot be read, or the server refuses them.")
    bad: list[BadRow] = Field(description="The first ten of these.")
    last_sequence: int | None = Field(description="With an Idempotency-Key, the number of the last row.")


# Questions


class AboutPoints(Request):
    """Points to ask about."""

    model_config = example(points=[[1, 1], [9, 9]])

    points: Points


class AboutPointsOrKeys(Request):
    """Points to ask about, or keys whose positions are asked about."""

    points: Points | None = None
    keys: list[Key] | None = None
    keys_of: Name | None = Field(None, description="The hull that has the keys; null for the hull itself.")
    keys_min_revision: Count = Field(0, description="A revision of that hull to wait for.")


@answering(sdk.Located)
class Located(Response):
    """Row by row: 1 inside, 0 on the boundary, -1 outside; -128 for a key that is not there."""


class Distances(Response):
    """Row by row; 0 inside. Null for a key that is not there, and if the hull has no points."""

    revision: int
    distances: Numbers
    keys_revision: int | None


class Counted(Response):
    """The multiplicity of each point."""

    revision: int
    counts: Integers


class Directions(Request):
    """Vectors of any length but 0."""

    model_config = example(directions=[[1, 0], [0, 1]])

    directions: Points
    keys: StrictBool = Field(False, description="Whether to name the vertices, in a keyed hull.")


@answering(sdk.Supported)
class Supported(Response):
    """The extreme vertex in each direction, and its key if requested."""


class Tangents(Response):
    """The left and right tangent point of each point; null for points not strictly outside."""

    revision: int
    tangents: Pairs


class Lines(Request):
    """Lines, each through an origin and a target."""

    model_config = example(origins=[[-1, 1]], targets=[[9, 1]])

    origins: Points
    targets: Points


class Crossings(Response):
    """Where each line enters and leaves the hull; null for lines that miss it."""

    revision: int
    crossings: Pairs


class AboutKeys(Request):
    """Keys to ask about."""

    model_config = example(keys=["LH400", "BA117"])

    keys: list[Key]


class Positions(Response):
    """The position of each key, null for one that is not there; no times for hulls without, null for a key without."""

    revision: int
    positions: Rows
    present: Booleans
    times: Times | None
    accuracies: Numbers | None = Field(None, description="How far each may be from where its key is; null for none.")


class KeyTrack(Response):
    """The way of a key: when it came to each place, and the revision. A place of nulls says that it left the hull."""

    key: str | int
    times: list[str | None] = Field(description="When each was committed; the first is the start.")
    points: Rows
    revisions: list[int]
    event_times: list[str | None] | None = Field(description="What was sent with the positions; null for none at all.")
    accuracies: Numbers | None = Field(None, description="As for `Positions`.")


class Tracks(Response):
    """The ways of keys, in the order in which they are asked for."""

    tracks: list[KeyTrack]


class Entities(Response):
    """All keys of a hull at one revision, ascending, with their positions; times as for `Positions`."""

    revision: int
    keys: Keys
    points: Rows
    times: Times | None
    accuracies: Numbers | None = Field(None, description="As for `Positions`.")


@answering(sdk.Sampled)
class Sampled(Response):
    """A sample of the points, and a key of each if requested."""


class Layers(Response):
    """Convex layers, the outermost first: the vertices of each, and their keys if requested."""

    revision: int
    layers: list[Rows]
    keys: list[Keys] | None


class Influence(Response):
    """The vertices of a hull, the area that it would lose without each, and their keys if requested."""

    revision: int
    vertices: Rows
    areas: Numbers
    keys: list[str] | list[int] | None


class Series(Response):
    """How a hull was over the last time: row by row, the oldest first; the last row is of now.

    A row says how the hull was at its time, and since its changed time. Areas and lengths are in the units of the
    coordinates; on the globe in square metres and metres. Hulls of more than 256 vertices have no diameters and widths,
    those on the globe no widths.
    """

    uid: str
    geographic: bool
    since: AwareDatetime = Field(description="The time from which on rows are kept, or those that were asked for.")
    interval: float = Field(
        description="Seconds between two rows of a hull that changes all the time; 0 where the server keeps none."
    )
    times: Times
    changed_times: Times = Field(
        description="When the newest batch was committed, or points last left by time; null where that is not known."
    )
    revisions: Integers
    points: Integers
    vertices: Integers
    areas: Numbers
    perimeters: Numbers
    diameters: Numbers
    widths: Numbers
    rates: Numbers = Field(description="Revisions a second before each row; null for the first one.")


@answering(sdk.Separation)
class Separation(Response):
    """The distance or overlap of two hulls, and the line between them."""


class Entries(Request):
    """Entries of a phase diagram: composition and energy."""

    model_config = example(entries=[[0.25, -0.4]])

    entries: Points = []


class Phases(Response):
    """The hull as a binary phase diagram."""

    revision: int
    stable: Rows
    energies_above_hull: Numbers
    phases: Pairs
    shares: Rows


class FrontierQuestion(Request):
    """Risks and returns to compare with the frontier, and risk-free rates."""

    model_config = example(points=[[0.25, 0.05]], rates=[0.01])

    points: Points = []
    rates: list[Number] = []


class Efficient(Response):
    """The hull as an efficient frontier."""

    revision: int
    efficient: Rows
    turning_rates: Numbers
    dominated: Booleans
    tangencies: Rows
    sharpe_ratios: Numbers


@answering(sdk.ChanRound)
class ChanRound(Response):
    """One round of Chan's algorithm."""


@answering(sdk.Difference)
class Difference(Response):
    """The first row in which two lists of vertices differ."""


@answering(sdk.FenceDifference)
class FenceDifference(Response):
    """One thing about a fence that is not as it must be."""


@answering(sdk.Verification)
class Verification(Response):
    """The live hull compared with one computed anew, and the fences that compare it."""

    whole: bool = Field(description="Whether everything that was compared is as it must be.")


# Fences


class CircleArea(Request):
    """A disk."""

    center: Point
    radius: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]


class HullArea(Request):
    """A hull, whose area moves as its points do."""

    hull: Name


class PolygonArea(Request):
    """A simple polygon: the corners of its exterior, and of its holes."""

    exterior: Points = Field(min_length=3, max_length=100_000)
    holes: list[Points] = []


class GeometryArea(Request):
    """A polygon or several as a geometry of GeoJSON, such as that of a hull."""

    model_config = ConfigDict(extra="ignore")  # GeoJSON has members for everybody

    type: Literal["Polygon", "MultiPolygon"]
    coordinates: list[Any]


def _form_of_area(area: Any) -> str:
    """The form of an area, by the fields that it has."""
    if isinstance(area, list):
        return "polygons"
    fields = area if isinstance(area, dict) else type(area).model_fields if isinstance(area, BaseModel) else ()
    if "coordinates" in fields:
        return "geometry"
    return "hull" if "hull" in fields else "circle" if {"center", "radius"} & set(fields) else "polygon"


class PolygonPart(PolygonArea):
    """One of several polygons that are an area together."""

    # A type of its own: what openapi-generator makes of a choice of a type and a list of the same names it twice.


OwnForms = (
    Annotated[HullArea, Tag("hull")]
    | Annotated[CircleArea, Tag("circle")]
    | Annotated[PolygonArea, Tag("polygon")]
    | Annotated[list[PolygonPart], Tag("polygons")]
)
Area = TypeAliasType("Area", Annotated[OwnForms, Discriminator(_form_of_area)])
GivenArea = TypeAliasType(
    "GivenArea", Annotated[OwnForms | Annotated[GeometryArea, Tag("geometry")], Discriminator(_form_of_area)]
)


@with_settings(surface.FenceSettings)
class FenceSettings(Request):
    """What a fence compares, and when it makes events."""

    area: GivenArea
    subjects: Name | None = Field(None, description="The keyed hull whose keys are compared,")
    subject_prefix: Annotated[str, Field(strict=True, max_length=200)] | None = Field(
        None, description="or a prefix of the names of several,"
    )
    other_hull: Name | None = Field(None, description="or a hull that is compared as a whole.")
    expected: Annotated[list[Key], Field(min_length=1, max_length=10_000)] | None = Field(
        None, description="Keys that should be inside by `expected_by` or `expected_within`."
    )


@with_settings(surface.FenceSettings, at_creation=True)
class PastFence(FenceSettings):
    """A fence after the fact: its settings, and between which moments it would have been there."""

    start: Moment | None = Field(
        None,
        description="Where it begins: a revision of the subjects' hull, all digits, or a time of RFC 3339, for the "
        "last revision committed at or before it. By default the oldest that the server keeps.",
    )
    end: Moment | None = Field(None, description="The last revision, or the last time, that counts. By default now.")


@with_settings(surface.FenceSettings, at_creation=True)
class NewFence(FenceSettings):
    """A fence to create."""

    name: Name
    exist_ok: StrictBool = Field(False, description="Return an existing fence with these settings.")


@answering(sdk.FenceConsumer)
class Consumer(Response):
    """A durable reader of a fence or an alarm."""


class Acknowledgement(Request):
    """The last sequence that was processed."""

    model_config = example(sequence=1)

    sequence: Count
    uid: StrictStr = Field(
        "", max_length=200, description="The uid of the fence or alarm, to notice that it was replaced."
    )


@answering(sdk.SubjectsInside)
class SubjectsInside(Response):
    """Keys of one hull that are inside."""


@answering(sdk.Inside)
class Inside(Response):
    """The subjects inside a fence at one moment."""


@answering(sdk.Fence, finite=True)
class Fence(Response):
    """A fence with its settings, its counts and its consumers."""

    area: Area
    subjects: str | None = Field(description="The keyed hull whose keys are compared,")
    subject_prefix: str | None = Field(description="or a prefix of the names of several,")
    other_hull: str | None = Field(description="or a hull that is compared as a whole.")


class FencePage(Response):
    """Fences by name. `next` is the `after` of the next page; null on the last."""

    fences: list[Fence]
    next: str | None


class Subscription(Request):
    """One of the streams that are joined to one."""

    model_config = example(path="/hulls/fleet/events?keys=true")

    path: Annotated[str, Field(strict=True, max_length=65_536, pattern=STREAM_PATH)] = Field(
        description="The path of a stream of events with its query, below that of the gateway."
    )
    # Forty digits for each of at most 1024 partitions, of a feed.
    last_event_id: Annotated[str, Field(strict=True, max_length=40_960, pattern=EVENT_ID)] | None = Field(
        None, description="The id of the last event of this stream that was received, to go on after it."
    )


class Subscriptions(Request):
    """What a stream follows from its beginning."""

    subscriptions: dict[Annotated[str, Field(pattern=LABEL, description=LABELS)], Subscription] = Field(
        {}, description="By names that the caller chooses."
    )


class Health(Response):
    """Whether the gateway, and the server behind it, can answer."""

    status: Literal["ok", "draining", "unavailable"]
    seconds_without_server: float | None = Field(
        description="How long the gateway has had no connection to its server; null while it has one."
    )
