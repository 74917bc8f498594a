"""What the data of events looks like, for the description."""

from pydantic import BaseModel, Field

import dynhull_client

from ..answers import Place, Rows, answering
from ..schemas import Measures, Response, SubjectsInside

CHANGED = "When the newest batch was committed, or points last left by time."
# The id of an event says after which sequence to go on.
STATE = [name for name in dynhull_client.ManyChange.__dataclass_fields__ if name not in ("kind", "position")]
BATCH = [name for name in dynhull_client.FeedBatch.__dataclass_fields__ if name not in ("type", "after")]
SENT = [name for name in dynhull_client.FenceEvent.__dataclass_fields__ if name != "after"]


class HullEvent(BaseModel):
    """What all events of a hull have."""

    revision: int = Field(description="The revision of the hull. An event may stand for several revisions.")


class HullSnapshot(HullEvent):
    """The whole hull: event `snapshot`, not with f=geojson."""

    points: int = Field(description="The number of points.")
    vertices: Rows = Field(description="The vertices, counter-clockwise.")
    vertex_keys: list[str] | list[int] | None = Field(None, description="With keys=true, the key of each vertex.")
    center: Place | None = Field(description="Of a hull on the globe, longitude and latitude of its centre.")
    measures: Measures | None = Field(None, description="With measures=true.")
    changed: str | None = Field(None, description=CHANGED)
    erased: bool = Field(
        False, description="In a replay, whether the hull may lack keys that it had then, since they were erased."
    )
    error: float | None = Field(
        None,
        description="With max_vertices, the distance by which the hull reaches beyond the vertices, rounded up; "
        "on the globe in metres.",
    )


class HullChange(HullEvent):
    """The difference to the event before: event `change`, with f=changes.

    From the vertices of the event before, remove the rows `removed_rows`, move the first `rotation` of those that are
    left to the end, then insert `added`, one after the other, each so that it becomes the row in `added_rows`. With
    keys=true, treat the keys alike, with `added_keys`; then the rows `renamed_rows` have the keys `renamed_keys`.
    """

    points: int = Field(description="The number of points.")
    removed: Rows = Field(description="The vertices that are no longer there.")
    removed_rows: list[int] = Field(description="Their rows before, ascending.")
    rotation: int = Field(description="The number of rows to move from the front to the end.")
    added: Rows = Field(description="The vertices that are new.")
    added_rows: list[int] = Field(description="Their rows afterwards, ascending.")
    added_keys: list[str] | list[int] | None = Field(None, description="With keys=true, their keys.")
    renamed_rows: list[int] | None = Field(None, description="With keys=true, the rows that have another key now,")
    renamed_keys: list[str] | list[int] | None = Field(None, description="and these keys.")
    measures: Measures | None = Field(None, description="With measures=true.")
    cause: str = Field(description="What has changed the hull: batch, expiry or recenter.")
    clock: str | None = Field(None, description="The clock of a hull with a window.")
    center: Place | None = Field(None, description="Of a hull on the globe whose centre has moved.")
    changed: str | None = Field(None, description=CHANGED)
    erased: bool = Field(False, description="As in a snapshot.")


class HullProgress(HullEvent):
    """A later revision with the same vertices: event `progress`."""

    points: int = Field(description="The number of points.")
    cause: str = Field(description="As in a change.")
    clock: str | None = Field(None, description="As in a change.")
    center: Place | None = Field(None, description="As in a change.")
    changed: str | None = Field(None, description="As in a change.")
    erased: bool = Field(False, description="As in a snapshot.")


@answering(dynhull_client.FenceEvent, SENT, partial=True)
class FenceEvent(BaseModel):
    """The data of an event of a fence; fields that do not apply are left out."""

    inside: list[SubjectsInside] = Field([], description="Of snapshot and closed, who was inside, by hull.")


@answering(dynhull_client.AlarmEvent, partial=True)
class AlarmEvent(BaseModel):
    """The data of an event of an alarm; fields that do not apply are left out."""

    cause: list[str] = Field([], description="Why it happened.")


@answering(dynhull_client.FeedHeld, partial=True)
class FeedHeld(BaseModel):
    """What a batch has changed in the quarantine of a hull; fields that do not apply are left out."""

    points: Rows = Field([], description="The positions held.")
    times: list[str | None] = Field([], description="Their times, null for one without.")


@answering(dynhull_client.FeedBatch, BATCH, partial=True)
class FeedBatch(BaseModel):
    """The data of a batch of a hull; fields that do not apply are left out."""

    points: Rows = Field([], description="The positions of the keys put.")
    inserts: Rows = Field([], description="The points inserted into a hull without keys.")
    deletes: Rows = Field([], description="The points deleted from it.")
    times: list[str | None] = Field([], description="The event times of the points put or inserted, null for none.")
    expire_times: list[str | None] = Field([], description="When the points put leave the hull, likewise.")
    accuracies: list[float] | None = Field(None, description="How far the points put may be from where the keys are.")
    held: FeedHeld | None = Field(None, description="What it has changed in the quarantine.")


@answering(dynhull_client.ManyChange, STATE, partial=True)
class HullNow(Response):
    """The newest that is known of one of many hulls; fields that do not apply are left out."""

    measures: Measures | None = Field(None, description="Its measures; without points there are none.")


class Hulls(BaseModel):
    """What has become of many hulls: event `hulls`."""

    hulls: list[HullNow] = Field(description="Their newest states.")
    gone: list[str] = Field(description="Those that are there no more.")
    unchanged: list[str] = Field(description="Those that are as they were at the id that the stream goes on from.")


EVENTS = HullSnapshot, HullChange, HullProgress, Hulls, FenceEvent, AlarmEvent, FeedBatch

OF_MANY = (
    "retry: 1000\n\n"
    "event: begin\ndata: {}\n\n"
    'event: hulls\ndata: {"hulls":[{"hull":"fleet/a","uid":"fe203b7c85e2be96","revision":2,"points":3,"distinct":3,'
    '"held":0,"vertex_count":3,"geographic":false,"error":0.0}],"gone":[],"unchanged":[]}\n\n'
    'event: complete\nid: 00000000000000000000000200065fbb4e8d1a40\ndata: {"hulls":1}\n\n'
)
OF_HULL = (
    "retry: 1000\n\n"
    "event: snapshot\nid: fe203b7c85e2be96:1\n"
    'data: {"revision":1,"points":3,"vertices":[[0.0,0.0],[4.0,0.0],[4.0,3.0]],"center":null}\n\n'
    "event: progress\nid: fe203b7c85e2be96:2\n"
    'data: {"revision":2,"points":4,"cause":"batch"}\n\n'
    "event: change\nid: fe203b7c85e2be96:3\n"
    'data: {"revision":3,"points":5,"removed":[[4.0,3.0]],"removed_rows":[2],"added":[[4.0,4.0],[2.0,4.0]],'
    '"added_rows":[2,3],"rotation":0,"cause":"batch"}\n\n'
)
OF_PAST = (
    "retry: 1000\n\n"
    "event: snapshot\nid: fe203b7c85e2be96:1\n"
    'data: {"revision":1,"points":3,"changed":"2026-01-31T12:00:00Z","vertices":[[0.0,0.0],[4.0,0.0],[4.0,3.0]],'
    '"center":null}\n\n'
    "event: progress\nid: fe203b7c85e2be96:2\n"
    'data: {"revision":2,"points":4,"cause":"batch","changed":"2026-01-31T12:00:01Z"}\n\n'
    'event: end\nid: fe203b7c85e2be96:over\ndata: {"revision":2}\n\n'
)
OF_FENCE = (
    "retry: 1000\n\n"
    "event: enter\nid: beb1f1fb68d6cfdb:2\n"
    'data: {"type":"enter","sequence":2,"fence":"yard","uid":"beb1f1fb68d6cfdb","cause":["subject_appeared"],'
    '"hull":"fleet","key":"LH400","revision":1,"position":[0.0,0.0],"time":"2026-01-31T12:00:00Z"}\n\n'
)
OF_ALARM = (
    "retry: 1000\n\n"
    "event: raised\nid: 3ac87ec5d5b4ff0a:1\n"
    'data: {"type":"raised","sequence":1,"alarm":"spread","uid":"3ac87ec5d5b4ff0a","hull":"fleet","revision":2,'
    '"value":12.0,"bound":9.0,"cause":["batch"],"cause_revision":2,"cause_hull":"fleet",'
    '"cause_time":"2026-01-31T12:00:00Z","previous":6.0,"time":"2026-01-31T12:00:00Z"}\n\n'
)
OF_PAST_FENCE = (
    "retry: 1000\n\n"
    'event: snapshot\ndata: {"type":"snapshot","sequence":1,"cause":["fence_created"],"inside":[],'
    '"time":"2026-01-31T12:00:00Z"}\n\n'
    'event: enter\ndata: {"type":"enter","sequence":2,"cause":["subject_appeared"],'
    '"hull":"fleet","key":"LH400","revision":2,"position":[0.0,0.0],"distance":0.0,"time":"2026-01-31T12:00:01Z"}\n\n'
    'event: complete\ndata: {"events":2}\n\n'
)
OF_FEED = (
    "retry: 1000\n\n"
    "event: batch\nid: fe203b7c85e2be96:2\n"
    'data: {"hull":"fleet","revision":2,"uid":"fe203b7c85e2be96","commit":7,"time":"2026-01-31T12:00:00+00:00",'
    '"cause":"batch","keys":["LH400"],"points":[[8.57,50.03]]}\n\n'
)
OF_JOINED = (
    "retry: 1000\n\n"
    'event: stream\ndata: {"stream":"ZvBq3r0l4cWcA3lMFt5yVg"}\n\n'
    "id: yard beb1f1fb68d6cfdb:1\n\n"
    "event: snapshot\nid: hull fe203b7c85e2be96:1\n"
    'data: {"revision":1,"points":3,"vertices":[[0.0,0.0],[4.0,0.0],[4.0,3.0]],"center":null}\n\n'
    "event: enter\nid: yard beb1f1fb68d6cfdb:2\n"
    'data: {"type":"enter","sequence":2,"fence":"yard","uid":"beb1f1fb68d6cfdb","cause":["subject_appeared"],'
    '"hull":"fleet","key":"LH400","revision":1,"position":[0.0,0.0],"time":"2026-01-31T12:00:00Z"}\n\n'
)
