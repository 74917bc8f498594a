import datetime

from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Frame(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FRAME_UNSPECIFIED: _ClassVar[Frame]
    FRAME_PLANE: _ClassVar[Frame]
    FRAME_GEOGRAPHIC: _ClassVar[Frame]

class Clock(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CLOCK_UNSPECIFIED: _ClassVar[Clock]
    CLOCK_SERVER: _ClassVar[Clock]
    CLOCK_DATA: _ClassVar[Clock]

class AheadPolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    AHEAD_POLICY_UNSPECIFIED: _ClassVar[AheadPolicy]
    AHEAD_POLICY_REFUSE: _ClassVar[AheadPolicy]
    AHEAD_POLICY_CLAMP: _ClassVar[AheadPolicy]

class Ordering(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ORDERING_UNSPECIFIED: _ClassVar[Ordering]
    ORDERING_ARRIVAL: _ClassVar[Ordering]
    ORDERING_EVENT_TIME: _ClassVar[Ordering]

class Identity(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    IDENTITY_UNSPECIFIED: _ClassVar[Identity]
    IDENTITY_MULTISET: _ClassVar[Identity]
    IDENTITY_STRING_KEYS: _ClassVar[Identity]
    IDENTITY_INTEGER_KEYS: _ClassVar[Identity]
FRAME_UNSPECIFIED: Frame
FRAME_PLANE: Frame
FRAME_GEOGRAPHIC: Frame
CLOCK_UNSPECIFIED: Clock
CLOCK_SERVER: Clock
CLOCK_DATA: Clock
AHEAD_POLICY_UNSPECIFIED: AheadPolicy
AHEAD_POLICY_REFUSE: AheadPolicy
AHEAD_POLICY_CLAMP: AheadPolicy
ORDERING_UNSPECIFIED: Ordering
ORDERING_ARRIVAL: Ordering
ORDERING_EVENT_TIME: Ordering
IDENTITY_UNSPECIFIED: Identity
IDENTITY_MULTISET: Identity
IDENTITY_STRING_KEYS: Identity
IDENTITY_INTEGER_KEYS: Identity

class Hull(_message.Message):
    __slots__ = ("name", "config", "revision", "point_count", "distinct_point_count", "create_time", "uid", "clock_time", "center", "quarantine", "held_count", "changed_time", "erased")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    DISTINCT_POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    CLOCK_TIME_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    QUARANTINE_FIELD_NUMBER: _ClassVar[int]
    HELD_COUNT_FIELD_NUMBER: _ClassVar[int]
    CHANGED_TIME_FIELD_NUMBER: _ClassVar[int]
    ERASED_FIELD_NUMBER: _ClassVar[int]
    name: str
    config: HullConfig
    revision: int
    point_count: int
    distinct_point_count: int
    create_time: _timestamp_pb2.Timestamp
    uid: str
    clock_time: _timestamp_pb2.Timestamp
    center: LonLat
    quarantine: Quarantine
    held_count: int
    changed_time: _timestamp_pb2.Timestamp
    erased: bool
    def __init__(self, name: _Optional[str] = ..., config: _Optional[_Union[HullConfig, _Mapping]] = ..., revision: _Optional[int] = ..., point_count: _Optional[int] = ..., distinct_point_count: _Optional[int] = ..., create_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., uid: _Optional[str] = ..., clock_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., center: _Optional[_Union[LonLat, _Mapping]] = ..., quarantine: _Optional[_Union[Quarantine, _Mapping]] = ..., held_count: _Optional[int] = ..., changed_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., erased: bool = ...) -> None: ...

class HullConfig(_message.Message):
    __slots__ = ("identity", "max_points", "window", "ordering", "frame", "center", "quarantine", "shards", "history")
    IDENTITY_FIELD_NUMBER: _ClassVar[int]
    MAX_POINTS_FIELD_NUMBER: _ClassVar[int]
    WINDOW_FIELD_NUMBER: _ClassVar[int]
    ORDERING_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    QUARANTINE_FIELD_NUMBER: _ClassVar[int]
    SHARDS_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    identity: Identity
    max_points: int
    window: Window
    ordering: Ordering
    frame: Frame
    center: LonLat
    quarantine: Quarantine
    shards: int
    history: History
    def __init__(self, identity: _Optional[_Union[Identity, str]] = ..., max_points: _Optional[int] = ..., window: _Optional[_Union[Window, _Mapping]] = ..., ordering: _Optional[_Union[Ordering, str]] = ..., frame: _Optional[_Union[Frame, str]] = ..., center: _Optional[_Union[LonLat, _Mapping]] = ..., quarantine: _Optional[_Union[Quarantine, _Mapping]] = ..., shards: _Optional[int] = ..., history: _Optional[_Union[History, _Mapping]] = ...) -> None: ...

class History(_message.Message):
    __slots__ = ("max_age", "max_bytes")
    MAX_AGE_FIELD_NUMBER: _ClassVar[int]
    MAX_BYTES_FIELD_NUMBER: _ClassVar[int]
    max_age: _duration_pb2.Duration
    max_bytes: int
    def __init__(self, max_age: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., max_bytes: _Optional[int] = ...) -> None: ...

class Erasure(_message.Message):
    __slots__ = ("time", "first_revision", "last_revision", "keys", "moves")
    TIME_FIELD_NUMBER: _ClassVar[int]
    FIRST_REVISION_FIELD_NUMBER: _ClassVar[int]
    LAST_REVISION_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    MOVES_FIELD_NUMBER: _ClassVar[int]
    time: _timestamp_pb2.Timestamp
    first_revision: int
    last_revision: int
    keys: int
    moves: int
    def __init__(self, time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., first_revision: _Optional[int] = ..., last_revision: _Optional[int] = ..., keys: _Optional[int] = ..., moves: _Optional[int] = ...) -> None: ...

class Quarantine(_message.Message):
    __slots__ = ("max_speed", "max_growth", "confirmations")
    MAX_SPEED_FIELD_NUMBER: _ClassVar[int]
    MAX_GROWTH_FIELD_NUMBER: _ClassVar[int]
    CONFIRMATIONS_FIELD_NUMBER: _ClassVar[int]
    max_speed: float
    max_growth: float
    confirmations: int
    def __init__(self, max_speed: _Optional[float] = ..., max_growth: _Optional[float] = ..., confirmations: _Optional[int] = ...) -> None: ...

class LonLat(_message.Message):
    __slots__ = ("longitude", "latitude")
    LONGITUDE_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_FIELD_NUMBER: _ClassVar[int]
    longitude: float
    latitude: float
    def __init__(self, longitude: _Optional[float] = ..., latitude: _Optional[float] = ...) -> None: ...

class Window(_message.Message):
    __slots__ = ("max_age", "max_points", "clock", "max_skew", "ahead")
    MAX_AGE_FIELD_NUMBER: _ClassVar[int]
    MAX_POINTS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_FIELD_NUMBER: _ClassVar[int]
    MAX_SKEW_FIELD_NUMBER: _ClassVar[int]
    AHEAD_FIELD_NUMBER: _ClassVar[int]
    max_age: _duration_pb2.Duration
    max_points: int
    clock: Clock
    max_skew: _duration_pb2.Duration
    ahead: AheadPolicy
    def __init__(self, max_age: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., max_points: _Optional[int] = ..., clock: _Optional[_Union[Clock, str]] = ..., max_skew: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., ahead: _Optional[_Union[AheadPolicy, str]] = ...) -> None: ...

class Measures(_message.Message):
    __slots__ = ("area", "perimeter", "centroid_x", "centroid_y", "min_x", "min_y", "max_x", "max_y", "diameter", "width")
    AREA_FIELD_NUMBER: _ClassVar[int]
    PERIMETER_FIELD_NUMBER: _ClassVar[int]
    CENTROID_X_FIELD_NUMBER: _ClassVar[int]
    CENTROID_Y_FIELD_NUMBER: _ClassVar[int]
    MIN_X_FIELD_NUMBER: _ClassVar[int]
    MIN_Y_FIELD_NUMBER: _ClassVar[int]
    MAX_X_FIELD_NUMBER: _ClassVar[int]
    MAX_Y_FIELD_NUMBER: _ClassVar[int]
    DIAMETER_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    area: float
    perimeter: float
    centroid_x: float
    centroid_y: float
    min_x: float
    min_y: float
    max_x: float
    max_y: float
    diameter: float
    width: float
    def __init__(self, area: _Optional[float] = ..., perimeter: _Optional[float] = ..., centroid_x: _Optional[float] = ..., centroid_y: _Optional[float] = ..., min_x: _Optional[float] = ..., min_y: _Optional[float] = ..., max_x: _Optional[float] = ..., max_y: _Optional[float] = ..., diameter: _Optional[float] = ..., width: _Optional[float] = ...) -> None: ...
