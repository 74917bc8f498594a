import datetime

from dynhull_proto.v1 import alarm_pb2 as _alarm_pb2
from dynhull_proto.v1 import fence_pb2 as _fence_pb2
from dynhull_proto.v1 import fence_service_pb2 as _fence_service_pb2
from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CreateAlarmRequest(_message.Message):
    __slots__ = ("name", "rule")
    NAME_FIELD_NUMBER: _ClassVar[int]
    RULE_FIELD_NUMBER: _ClassVar[int]
    name: str
    rule: _alarm_pb2.AlarmRule
    def __init__(self, name: _Optional[str] = ..., rule: _Optional[_Union[_alarm_pb2.AlarmRule, _Mapping]] = ...) -> None: ...

class CreateAlarmResponse(_message.Message):
    __slots__ = ("alarm",)
    ALARM_FIELD_NUMBER: _ClassVar[int]
    alarm: _alarm_pb2.Alarm
    def __init__(self, alarm: _Optional[_Union[_alarm_pb2.Alarm, _Mapping]] = ...) -> None: ...

class DeleteAlarmRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteAlarmResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class GetAlarmRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetAlarmResponse(_message.Message):
    __slots__ = ("alarm", "statuses")
    ALARM_FIELD_NUMBER: _ClassVar[int]
    STATUSES_FIELD_NUMBER: _ClassVar[int]
    alarm: _alarm_pb2.Alarm
    statuses: _containers.RepeatedCompositeFieldContainer[_alarm_pb2.AlarmStatus]
    def __init__(self, alarm: _Optional[_Union[_alarm_pb2.Alarm, _Mapping]] = ..., statuses: _Optional[_Iterable[_Union[_alarm_pb2.AlarmStatus, _Mapping]]] = ...) -> None: ...

class ListAlarmsRequest(_message.Message):
    __slots__ = ("prefix", "page_size", "page_token")
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    prefix: str
    page_size: int
    page_token: str
    def __init__(self, prefix: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListAlarmsResponse(_message.Message):
    __slots__ = ("alarms", "next_page_token")
    ALARMS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    alarms: _containers.RepeatedCompositeFieldContainer[_alarm_pb2.Alarm]
    next_page_token: str
    def __init__(self, alarms: _Optional[_Iterable[_Union[_alarm_pb2.Alarm, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class WatchAlarmRequest(_message.Message):
    __slots__ = ("name", "after_sequence", "consumer", "only_new", "progress_interval", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    ONLY_NEW_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_INTERVAL_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    after_sequence: int
    consumer: str
    only_new: bool
    progress_interval: _duration_pb2.Duration
    uid: str
    def __init__(self, name: _Optional[str] = ..., after_sequence: _Optional[int] = ..., consumer: _Optional[str] = ..., only_new: bool = ..., progress_interval: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., uid: _Optional[str] = ...) -> None: ...

class WatchAlarmResponse(_message.Message):
    __slots__ = ("events", "lost", "sequence", "uid")
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[_alarm_pb2.AlarmEvent]
    lost: _fence_service_pb2.LostEvents
    sequence: int
    uid: str
    def __init__(self, events: _Optional[_Iterable[_Union[_alarm_pb2.AlarmEvent, _Mapping]]] = ..., lost: _Optional[_Union[_fence_service_pb2.LostEvents, _Mapping]] = ..., sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class AckAlarmRequest(_message.Message):
    __slots__ = ("name", "consumer", "sequence", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    consumer: str
    sequence: int
    uid: str
    def __init__(self, name: _Optional[str] = ..., consumer: _Optional[str] = ..., sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class AckAlarmResponse(_message.Message):
    __slots__ = ("consumer",)
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    consumer: _fence_pb2.FenceConsumer
    def __init__(self, consumer: _Optional[_Union[_fence_pb2.FenceConsumer, _Mapping]] = ...) -> None: ...

class DeleteAlarmConsumerRequest(_message.Message):
    __slots__ = ("name", "consumer")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    name: str
    consumer: str
    def __init__(self, name: _Optional[str] = ..., consumer: _Optional[str] = ...) -> None: ...

class DeleteAlarmConsumerResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class AcknowledgeAlarmRequest(_message.Message):
    __slots__ = ("name", "hull")
    NAME_FIELD_NUMBER: _ClassVar[int]
    HULL_FIELD_NUMBER: _ClassVar[int]
    name: str
    hull: str
    def __init__(self, name: _Optional[str] = ..., hull: _Optional[str] = ...) -> None: ...

class AcknowledgeAlarmResponse(_message.Message):
    __slots__ = ("status",)
    STATUS_FIELD_NUMBER: _ClassVar[int]
    status: _alarm_pb2.AlarmStatus
    def __init__(self, status: _Optional[_Union[_alarm_pb2.AlarmStatus, _Mapping]] = ...) -> None: ...

class MuteAlarmRequest(_message.Message):
    __slots__ = ("name", "hull", "mute_time")
    NAME_FIELD_NUMBER: _ClassVar[int]
    HULL_FIELD_NUMBER: _ClassVar[int]
    MUTE_TIME_FIELD_NUMBER: _ClassVar[int]
    name: str
    hull: str
    mute_time: _timestamp_pb2.Timestamp
    def __init__(self, name: _Optional[str] = ..., hull: _Optional[str] = ..., mute_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class MuteAlarmResponse(_message.Message):
    __slots__ = ("status",)
    STATUS_FIELD_NUMBER: _ClassVar[int]
    status: _alarm_pb2.AlarmStatus
    def __init__(self, status: _Optional[_Union[_alarm_pb2.AlarmStatus, _Mapping]] = ...) -> None: ...
