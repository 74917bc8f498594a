import datetime

from dynhull_proto.v1 import points_pb2 as _points_pb2
from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class FenceBoundary(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FENCE_BOUNDARY_UNSPECIFIED: _ClassVar[FenceBoundary]
    FENCE_BOUNDARY_CLOSED: _ClassVar[FenceBoundary]
    FENCE_BOUNDARY_OPEN: _ClassVar[FenceBoundary]

class FenceInitial(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FENCE_INITIAL_UNSPECIFIED: _ClassVar[FenceInitial]
    FENCE_INITIAL_SNAPSHOT: _ClassVar[FenceInitial]
    FENCE_INITIAL_EVENTS: _ClassVar[FenceInitial]
    FENCE_INITIAL_NONE: _ClassVar[FenceInitial]

class FenceEventType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FENCE_EVENT_TYPE_UNSPECIFIED: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_ENTER: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_EXIT: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_CROSS: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_DWELL: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_BEGIN: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_CEASE: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_SNAPSHOT: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_CLOSED: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_TRANSFER: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_MISSING: _ClassVar[FenceEventType]
    FENCE_EVENT_TYPE_ARRIVED: _ClassVar[FenceEventType]

class FenceCause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FENCE_CAUSE_UNSPECIFIED: _ClassVar[FenceCause]
    FENCE_CAUSE_SUBJECT_MOVED: _ClassVar[FenceCause]
    FENCE_CAUSE_AREA_MOVED: _ClassVar[FenceCause]
    FENCE_CAUSE_SUBJECT_APPEARED: _ClassVar[FenceCause]
    FENCE_CAUSE_SUBJECT_REMOVED: _ClassVar[FenceCause]
    FENCE_CAUSE_SUBJECT_EXPIRED: _ClassVar[FenceCause]
    FENCE_CAUSE_FENCE_CREATED: _ClassVar[FenceCause]
    FENCE_CAUSE_FENCE_CHANGED: _ClassVar[FenceCause]
    FENCE_CAUSE_TIME_PASSED: _ClassVar[FenceCause]
FENCE_BOUNDARY_UNSPECIFIED: FenceBoundary
FENCE_BOUNDARY_CLOSED: FenceBoundary
FENCE_BOUNDARY_OPEN: FenceBoundary
FENCE_INITIAL_UNSPECIFIED: FenceInitial
FENCE_INITIAL_SNAPSHOT: FenceInitial
FENCE_INITIAL_EVENTS: FenceInitial
FENCE_INITIAL_NONE: FenceInitial
FENCE_EVENT_TYPE_UNSPECIFIED: FenceEventType
FENCE_EVENT_TYPE_ENTER: FenceEventType
FENCE_EVENT_TYPE_EXIT: FenceEventType
FENCE_EVENT_TYPE_CROSS: FenceEventType
FENCE_EVENT_TYPE_DWELL: FenceEventType
FENCE_EVENT_TYPE_BEGIN: FenceEventType
FENCE_EVENT_TYPE_CEASE: FenceEventType
FENCE_EVENT_TYPE_SNAPSHOT: FenceEventType
FENCE_EVENT_TYPE_CLOSED: FenceEventType
FENCE_EVENT_TYPE_TRANSFER: FenceEventType
FENCE_EVENT_TYPE_MISSING: FenceEventType
FENCE_EVENT_TYPE_ARRIVED: FenceEventType
FENCE_CAUSE_UNSPECIFIED: FenceCause
FENCE_CAUSE_SUBJECT_MOVED: FenceCause
FENCE_CAUSE_AREA_MOVED: FenceCause
FENCE_CAUSE_SUBJECT_APPEARED: FenceCause
FENCE_CAUSE_SUBJECT_REMOVED: FenceCause
FENCE_CAUSE_SUBJECT_EXPIRED: FenceCause
FENCE_CAUSE_FENCE_CREATED: FenceCause
FENCE_CAUSE_FENCE_CHANGED: FenceCause
FENCE_CAUSE_TIME_PASSED: FenceCause

class Fence(_message.Message):
    __slots__ = ("name", "config", "create_time", "uid", "last_sequence", "first_sequence", "inside_count", "subject_count", "consumers")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    LAST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    INSIDE_COUNT_FIELD_NUMBER: _ClassVar[int]
    SUBJECT_COUNT_FIELD_NUMBER: _ClassVar[int]
    CONSUMERS_FIELD_NUMBER: _ClassVar[int]
    name: str
    config: FenceConfig
    create_time: _timestamp_pb2.Timestamp
    uid: str
    last_sequence: int
    first_sequence: int
    inside_count: int
    subject_count: int
    consumers: _containers.RepeatedCompositeFieldContainer[FenceConsumer]
    def __init__(self, name: _Optional[str] = ..., config: _Optional[_Union[FenceConfig, _Mapping]] = ..., create_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., uid: _Optional[str] = ..., last_sequence: _Optional[int] = ..., first_sequence: _Optional[int] = ..., inside_count: _Optional[int] = ..., subject_count: _Optional[int] = ..., consumers: _Optional[_Iterable[_Union[FenceConsumer, _Mapping]]] = ...) -> None: ...

class FenceConsumer(_message.Message):
    __slots__ = ("name", "acknowledged_sequence", "backlog", "oldest_event_time", "lost")
    NAME_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    BACKLOG_FIELD_NUMBER: _ClassVar[int]
    OLDEST_EVENT_TIME_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    name: str
    acknowledged_sequence: int
    backlog: int
    oldest_event_time: _timestamp_pb2.Timestamp
    lost: int
    def __init__(self, name: _Optional[str] = ..., acknowledged_sequence: _Optional[int] = ..., backlog: _Optional[int] = ..., oldest_event_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., lost: _Optional[int] = ...) -> None: ...

class FenceConfig(_message.Message):
    __slots__ = ("hull_area", "polygon_area", "circle_area", "subject_hull", "subject_prefix", "other_hull", "boundary", "margin", "near_distance", "initial", "report_crosses", "dwell", "confirmations", "min_dwell", "max_events", "max_event_age", "by_accuracy", "expected", "expected_by", "expected_within")
    HULL_AREA_FIELD_NUMBER: _ClassVar[int]
    POLYGON_AREA_FIELD_NUMBER: _ClassVar[int]
    CIRCLE_AREA_FIELD_NUMBER: _ClassVar[int]
    SUBJECT_HULL_FIELD_NUMBER: _ClassVar[int]
    SUBJECT_PREFIX_FIELD_NUMBER: _ClassVar[int]
    OTHER_HULL_FIELD_NUMBER: _ClassVar[int]
    BOUNDARY_FIELD_NUMBER: _ClassVar[int]
    MARGIN_FIELD_NUMBER: _ClassVar[int]
    NEAR_DISTANCE_FIELD_NUMBER: _ClassVar[int]
    INITIAL_FIELD_NUMBER: _ClassVar[int]
    REPORT_CROSSES_FIELD_NUMBER: _ClassVar[int]
    DWELL_FIELD_NUMBER: _ClassVar[int]
    CONFIRMATIONS_FIELD_NUMBER: _ClassVar[int]
    MIN_DWELL_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENTS_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENT_AGE_FIELD_NUMBER: _ClassVar[int]
    BY_ACCURACY_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_BY_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_WITHIN_FIELD_NUMBER: _ClassVar[int]
    hull_area: HullArea
    polygon_area: PolygonArea
    circle_area: CircleArea
    subject_hull: str
    subject_prefix: str
    other_hull: str
    boundary: FenceBoundary
    margin: float
    near_distance: float
    initial: FenceInitial
    report_crosses: bool
    dwell: _duration_pb2.Duration
    confirmations: int
    min_dwell: _duration_pb2.Duration
    max_events: int
    max_event_age: _duration_pb2.Duration
    by_accuracy: bool
    expected: _points_pb2.Keys
    expected_by: str
    expected_within: _duration_pb2.Duration
    def __init__(self, hull_area: _Optional[_Union[HullArea, _Mapping]] = ..., polygon_area: _Optional[_Union[PolygonArea, _Mapping]] = ..., circle_area: _Optional[_Union[CircleArea, _Mapping]] = ..., subject_hull: _Optional[str] = ..., subject_prefix: _Optional[str] = ..., other_hull: _Optional[str] = ..., boundary: _Optional[_Union[FenceBoundary, str]] = ..., margin: _Optional[float] = ..., near_distance: _Optional[float] = ..., initial: _Optional[_Union[FenceInitial, str]] = ..., report_crosses: bool = ..., dwell: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., confirmations: _Optional[int] = ..., min_dwell: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., max_events: _Optional[int] = ..., max_event_age: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., by_accuracy: bool = ..., expected: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., expected_by: _Optional[str] = ..., expected_within: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ...) -> None: ...

class HullArea(_message.Message):
    __slots__ = ("name", "without_self", "layer")
    NAME_FIELD_NUMBER: _ClassVar[int]
    WITHOUT_SELF_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    name: str
    without_self: bool
    layer: int
    def __init__(self, name: _Optional[str] = ..., without_self: bool = ..., layer: _Optional[int] = ...) -> None: ...

class PolygonArea(_message.Message):
    __slots__ = ("polygons",)
    POLYGONS_FIELD_NUMBER: _ClassVar[int]
    polygons: _containers.RepeatedCompositeFieldContainer[Polygon]
    def __init__(self, polygons: _Optional[_Iterable[_Union[Polygon, _Mapping]]] = ...) -> None: ...

class Polygon(_message.Message):
    __slots__ = ("exterior", "holes")
    EXTERIOR_FIELD_NUMBER: _ClassVar[int]
    HOLES_FIELD_NUMBER: _ClassVar[int]
    exterior: _points_pb2.Points
    holes: _containers.RepeatedCompositeFieldContainer[_points_pb2.Points]
    def __init__(self, exterior: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., holes: _Optional[_Iterable[_Union[_points_pb2.Points, _Mapping]]] = ...) -> None: ...

class CircleArea(_message.Message):
    __slots__ = ("center_x", "center_y", "radius")
    CENTER_X_FIELD_NUMBER: _ClassVar[int]
    CENTER_Y_FIELD_NUMBER: _ClassVar[int]
    RADIUS_FIELD_NUMBER: _ClassVar[int]
    center_x: float
    center_y: float
    radius: float
    def __init__(self, center_x: _Optional[float] = ..., center_y: _Optional[float] = ..., radius: _Optional[float] = ...) -> None: ...

class FenceEvent(_message.Message):
    __slots__ = ("sequence", "type", "causes", "subject_hull", "string_key", "integer_key", "subject_revision", "area_revision", "position", "previous_position", "distance", "event_time", "time", "first_time", "inside", "previous_hull", "previous_hull_revision")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    SUBJECT_HULL_FIELD_NUMBER: _ClassVar[int]
    STRING_KEY_FIELD_NUMBER: _ClassVar[int]
    INTEGER_KEY_FIELD_NUMBER: _ClassVar[int]
    SUBJECT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AREA_REVISION_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_POSITION_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    EVENT_TIME_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    FIRST_TIME_FIELD_NUMBER: _ClassVar[int]
    INSIDE_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_HULL_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_HULL_REVISION_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    type: FenceEventType
    causes: _containers.RepeatedScalarFieldContainer[FenceCause]
    subject_hull: str
    string_key: str
    integer_key: int
    subject_revision: int
    area_revision: int
    position: FencePosition
    previous_position: FencePosition
    distance: float
    event_time: _timestamp_pb2.Timestamp
    time: _timestamp_pb2.Timestamp
    first_time: _timestamp_pb2.Timestamp
    inside: _containers.RepeatedCompositeFieldContainer[FenceSubjects]
    previous_hull: str
    previous_hull_revision: int
    def __init__(self, sequence: _Optional[int] = ..., type: _Optional[_Union[FenceEventType, str]] = ..., causes: _Optional[_Iterable[_Union[FenceCause, str]]] = ..., subject_hull: _Optional[str] = ..., string_key: _Optional[str] = ..., integer_key: _Optional[int] = ..., subject_revision: _Optional[int] = ..., area_revision: _Optional[int] = ..., position: _Optional[_Union[FencePosition, _Mapping]] = ..., previous_position: _Optional[_Union[FencePosition, _Mapping]] = ..., distance: _Optional[float] = ..., event_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., first_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., inside: _Optional[_Iterable[_Union[FenceSubjects, _Mapping]]] = ..., previous_hull: _Optional[str] = ..., previous_hull_revision: _Optional[int] = ...) -> None: ...

class FencePosition(_message.Message):
    __slots__ = ("x", "y")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ...) -> None: ...

class FenceSubjects(_message.Message):
    __slots__ = ("hull", "keys", "revision")
    HULL_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    hull: str
    keys: _points_pb2.Keys
    revision: int
    def __init__(self, hull: _Optional[str] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., revision: _Optional[int] = ...) -> None: ...
