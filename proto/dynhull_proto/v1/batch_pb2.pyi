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

class PutCondition(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PUT_CONDITION_UNSPECIFIED: _ClassVar[PutCondition]
    PUT_CONDITION_ALWAYS: _ClassVar[PutCondition]
    PUT_CONDITION_IF_ABSENT: _ClassVar[PutCondition]
    PUT_CONDITION_IF_PRESENT: _ClassVar[PutCondition]

class MissingKeyPolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MISSING_KEY_POLICY_UNSPECIFIED: _ClassVar[MissingKeyPolicy]
    MISSING_KEY_POLICY_COUNT: _ClassVar[MissingKeyPolicy]
    MISSING_KEY_POLICY_REFUSE: _ClassVar[MissingKeyPolicy]

class Cause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CAUSE_UNSPECIFIED: _ClassVar[Cause]
    CAUSE_BATCH: _ClassVar[Cause]
    CAUSE_EXPIRY: _ClassVar[Cause]
    CAUSE_RECENTER: _ClassVar[Cause]

class MissingPointPolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MISSING_POINT_POLICY_UNSPECIFIED: _ClassVar[MissingPointPolicy]
    MISSING_POINT_POLICY_REFUSE: _ClassVar[MissingPointPolicy]
    MISSING_POINT_POLICY_COUNT: _ClassVar[MissingPointPolicy]
PUT_CONDITION_UNSPECIFIED: PutCondition
PUT_CONDITION_ALWAYS: PutCondition
PUT_CONDITION_IF_ABSENT: PutCondition
PUT_CONDITION_IF_PRESENT: PutCondition
MISSING_KEY_POLICY_UNSPECIFIED: MissingKeyPolicy
MISSING_KEY_POLICY_COUNT: MissingKeyPolicy
MISSING_KEY_POLICY_REFUSE: MissingKeyPolicy
CAUSE_UNSPECIFIED: Cause
CAUSE_BATCH: Cause
CAUSE_EXPIRY: Cause
CAUSE_RECENTER: Cause
MISSING_POINT_POLICY_UNSPECIFIED: MissingPointPolicy
MISSING_POINT_POLICY_REFUSE: MissingPointPolicy
MISSING_POINT_POLICY_COUNT: MissingPointPolicy

class Batch(_message.Message):
    __slots__ = ("inserts", "deletes", "moves", "missing_points", "puts", "removes", "missing_keys", "insert_times", "releases", "drops")
    INSERTS_FIELD_NUMBER: _ClassVar[int]
    DELETES_FIELD_NUMBER: _ClassVar[int]
    MOVES_FIELD_NUMBER: _ClassVar[int]
    MISSING_POINTS_FIELD_NUMBER: _ClassVar[int]
    PUTS_FIELD_NUMBER: _ClassVar[int]
    REMOVES_FIELD_NUMBER: _ClassVar[int]
    MISSING_KEYS_FIELD_NUMBER: _ClassVar[int]
    INSERT_TIMES_FIELD_NUMBER: _ClassVar[int]
    RELEASES_FIELD_NUMBER: _ClassVar[int]
    DROPS_FIELD_NUMBER: _ClassVar[int]
    inserts: _points_pb2.Points
    deletes: _points_pb2.Points
    moves: Moves
    missing_points: MissingPointPolicy
    puts: Puts
    removes: _points_pb2.Keys
    missing_keys: MissingKeyPolicy
    insert_times: _points_pb2.Times
    releases: _points_pb2.Keys
    drops: _points_pb2.Keys
    def __init__(self, inserts: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., deletes: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., moves: _Optional[_Union[Moves, _Mapping]] = ..., missing_points: _Optional[_Union[MissingPointPolicy, str]] = ..., puts: _Optional[_Union[Puts, _Mapping]] = ..., removes: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., missing_keys: _Optional[_Union[MissingKeyPolicy, str]] = ..., insert_times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., releases: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., drops: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class Puts(_message.Message):
    __slots__ = ("keys", "points", "times", "condition", "ttl", "expire_times", "accuracies")
    KEYS_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    CONDITION_FIELD_NUMBER: _ClassVar[int]
    TTL_FIELD_NUMBER: _ClassVar[int]
    EXPIRE_TIMES_FIELD_NUMBER: _ClassVar[int]
    ACCURACIES_FIELD_NUMBER: _ClassVar[int]
    keys: _points_pb2.Keys
    points: _points_pb2.Points
    times: _points_pb2.Times
    condition: PutCondition
    ttl: _duration_pb2.Duration
    expire_times: _points_pb2.Times
    accuracies: _points_pb2.Accuracies
    def __init__(self, keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., condition: _Optional[_Union[PutCondition, str]] = ..., ttl: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., expire_times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., accuracies: _Optional[_Union[_points_pb2.Accuracies, _Mapping]] = ...) -> None: ...

class Moves(_message.Message):
    __slots__ = ("origins", "destinations")
    ORIGINS_FIELD_NUMBER: _ClassVar[int]
    DESTINATIONS_FIELD_NUMBER: _ClassVar[int]
    origins: _points_pb2.Points
    destinations: _points_pb2.Points
    def __init__(self, origins: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., destinations: _Optional[_Union[_points_pb2.Points, _Mapping]] = ...) -> None: ...

class BatchResult(_message.Message):
    __slots__ = ("revision", "hull_changed", "point_count", "duplicate", "clock_time", "held_rows", "inserted", "deleted", "missing", "moved", "stale", "late", "skipped", "clamped", "evicted", "held", "released", "dropped")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    HULL_CHANGED_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    DUPLICATE_FIELD_NUMBER: _ClassVar[int]
    CLOCK_TIME_FIELD_NUMBER: _ClassVar[int]
    HELD_ROWS_FIELD_NUMBER: _ClassVar[int]
    INSERTED_FIELD_NUMBER: _ClassVar[int]
    DELETED_FIELD_NUMBER: _ClassVar[int]
    MISSING_FIELD_NUMBER: _ClassVar[int]
    MOVED_FIELD_NUMBER: _ClassVar[int]
    STALE_FIELD_NUMBER: _ClassVar[int]
    LATE_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_FIELD_NUMBER: _ClassVar[int]
    CLAMPED_FIELD_NUMBER: _ClassVar[int]
    EVICTED_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    RELEASED_FIELD_NUMBER: _ClassVar[int]
    DROPPED_FIELD_NUMBER: _ClassVar[int]
    revision: int
    hull_changed: bool
    point_count: int
    duplicate: bool
    clock_time: _timestamp_pb2.Timestamp
    held_rows: _containers.RepeatedScalarFieldContainer[int]
    inserted: int
    deleted: int
    missing: int
    moved: int
    stale: int
    late: int
    skipped: int
    clamped: int
    evicted: int
    held: int
    released: int
    dropped: int
    def __init__(self, revision: _Optional[int] = ..., hull_changed: bool = ..., point_count: _Optional[int] = ..., duplicate: bool = ..., clock_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., held_rows: _Optional[_Iterable[int]] = ..., inserted: _Optional[int] = ..., deleted: _Optional[int] = ..., missing: _Optional[int] = ..., moved: _Optional[int] = ..., stale: _Optional[int] = ..., late: _Optional[int] = ..., skipped: _Optional[int] = ..., clamped: _Optional[int] = ..., evicted: _Optional[int] = ..., held: _Optional[int] = ..., released: _Optional[int] = ..., dropped: _Optional[int] = ...) -> None: ...
