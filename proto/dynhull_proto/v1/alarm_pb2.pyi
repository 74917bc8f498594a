import datetime

from dynhull_proto.v1 import fence_pb2 as _fence_pb2
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

class AlarmEventType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ALARM_EVENT_TYPE_UNSPECIFIED: _ClassVar[AlarmEventType]
    ALARM_EVENT_TYPE_RAISED: _ClassVar[AlarmEventType]
    ALARM_EVENT_TYPE_CLEARED: _ClassVar[AlarmEventType]
    ALARM_EVENT_TYPE_SNAPSHOT: _ClassVar[AlarmEventType]
    ALARM_EVENT_TYPE_CLOSED: _ClassVar[AlarmEventType]

class AlarmCause(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ALARM_CAUSE_UNSPECIFIED: _ClassVar[AlarmCause]
    ALARM_CAUSE_BATCH: _ClassVar[AlarmCause]
    ALARM_CAUSE_EXPIRED: _ClassVar[AlarmCause]
    ALARM_CAUSE_HULL_DELETED: _ClassVar[AlarmCause]
    ALARM_CAUSE_ALARM_CREATED: _ClassVar[AlarmCause]
    ALARM_CAUSE_TIME_PASSED: _ClassVar[AlarmCause]
    ALARM_CAUSE_OTHER_HULL: _ClassVar[AlarmCause]
    ALARM_CAUSE_RECENTERED: _ClassVar[AlarmCause]
ALARM_EVENT_TYPE_UNSPECIFIED: AlarmEventType
ALARM_EVENT_TYPE_RAISED: AlarmEventType
ALARM_EVENT_TYPE_CLEARED: AlarmEventType
ALARM_EVENT_TYPE_SNAPSHOT: AlarmEventType
ALARM_EVENT_TYPE_CLOSED: AlarmEventType
ALARM_CAUSE_UNSPECIFIED: AlarmCause
ALARM_CAUSE_BATCH: AlarmCause
ALARM_CAUSE_EXPIRED: AlarmCause
ALARM_CAUSE_HULL_DELETED: AlarmCause
ALARM_CAUSE_ALARM_CREATED: AlarmCause
ALARM_CAUSE_TIME_PASSED: AlarmCause
ALARM_CAUSE_OTHER_HULL: AlarmCause
ALARM_CAUSE_RECENTERED: AlarmCause

class Alarm(_message.Message):
    __slots__ = ("name", "rule", "create_time", "uid", "last_sequence", "first_sequence", "hull_count", "raised_count", "consumers")
    NAME_FIELD_NUMBER: _ClassVar[int]
    RULE_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    LAST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    FIRST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    HULL_COUNT_FIELD_NUMBER: _ClassVar[int]
    RAISED_COUNT_FIELD_NUMBER: _ClassVar[int]
    CONSUMERS_FIELD_NUMBER: _ClassVar[int]
    name: str
    rule: AlarmRule
    create_time: _timestamp_pb2.Timestamp
    uid: str
    last_sequence: int
    first_sequence: int
    hull_count: int
    raised_count: int
    consumers: _containers.RepeatedCompositeFieldContainer[_fence_pb2.FenceConsumer]
    def __init__(self, name: _Optional[str] = ..., rule: _Optional[_Union[AlarmRule, _Mapping]] = ..., create_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., uid: _Optional[str] = ..., last_sequence: _Optional[int] = ..., first_sequence: _Optional[int] = ..., hull_count: _Optional[int] = ..., raised_count: _Optional[int] = ..., consumers: _Optional[_Iterable[_Union[_fence_pb2.FenceConsumer, _Mapping]]] = ...) -> None: ...

class AlarmRule(_message.Message):
    __slots__ = ("hull", "prefix", "when", "clear", "hold", "max_events", "max_event_age")
    HULL_FIELD_NUMBER: _ClassVar[int]
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    WHEN_FIELD_NUMBER: _ClassVar[int]
    CLEAR_FIELD_NUMBER: _ClassVar[int]
    HOLD_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENTS_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENT_AGE_FIELD_NUMBER: _ClassVar[int]
    hull: str
    prefix: str
    when: str
    clear: str
    hold: _duration_pb2.Duration
    max_events: int
    max_event_age: _duration_pb2.Duration
    def __init__(self, hull: _Optional[str] = ..., prefix: _Optional[str] = ..., when: _Optional[str] = ..., clear: _Optional[str] = ..., hold: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., max_events: _Optional[int] = ..., max_event_age: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ...) -> None: ...

class AlarmEvent(_message.Message):
    __slots__ = ("sequence", "type", "hull", "revision", "value", "bound", "causes", "cause_revision", "cause_time", "previous_value", "time", "raised", "cause_hull", "keys")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    HULL_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    BOUND_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    CAUSE_REVISION_FIELD_NUMBER: _ClassVar[int]
    CAUSE_TIME_FIELD_NUMBER: _ClassVar[int]
    PREVIOUS_VALUE_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    RAISED_FIELD_NUMBER: _ClassVar[int]
    CAUSE_HULL_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    type: AlarmEventType
    hull: str
    revision: int
    value: float
    bound: float
    causes: _containers.RepeatedScalarFieldContainer[AlarmCause]
    cause_revision: int
    cause_time: _timestamp_pb2.Timestamp
    previous_value: float
    time: _timestamp_pb2.Timestamp
    raised: _containers.RepeatedScalarFieldContainer[str]
    cause_hull: str
    keys: _points_pb2.Keys
    def __init__(self, sequence: _Optional[int] = ..., type: _Optional[_Union[AlarmEventType, str]] = ..., hull: _Optional[str] = ..., revision: _Optional[int] = ..., value: _Optional[float] = ..., bound: _Optional[float] = ..., causes: _Optional[_Iterable[_Union[AlarmCause, str]]] = ..., cause_revision: _Optional[int] = ..., cause_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., previous_value: _Optional[float] = ..., time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., raised: _Optional[_Iterable[str]] = ..., cause_hull: _Optional[str] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class AlarmStatus(_message.Message):
    __slots__ = ("hull", "raised", "revision", "value", "since", "acknowledge_time", "mute_time")
    HULL_FIELD_NUMBER: _ClassVar[int]
    RAISED_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    SINCE_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGE_TIME_FIELD_NUMBER: _ClassVar[int]
    MUTE_TIME_FIELD_NUMBER: _ClassVar[int]
    hull: str
    raised: bool
    revision: int
    value: float
    since: _timestamp_pb2.Timestamp
    acknowledge_time: _timestamp_pb2.Timestamp
    mute_time: _timestamp_pb2.Timestamp
    def __init__(self, hull: _Optional[str] = ..., raised: bool = ..., revision: _Optional[int] = ..., value: _Optional[float] = ..., since: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., acknowledge_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., mute_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...
