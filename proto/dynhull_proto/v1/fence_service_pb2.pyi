import datetime

from dynhull_proto.v1 import fence_pb2 as _fence_pb2
from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class CreateFenceRequest(_message.Message):
    __slots__ = ("name", "config")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    name: str
    config: _fence_pb2.FenceConfig
    def __init__(self, name: _Optional[str] = ..., config: _Optional[_Union[_fence_pb2.FenceConfig, _Mapping]] = ...) -> None: ...

class CreateFenceResponse(_message.Message):
    __slots__ = ("fence",)
    FENCE_FIELD_NUMBER: _ClassVar[int]
    fence: _fence_pb2.Fence
    def __init__(self, fence: _Optional[_Union[_fence_pb2.Fence, _Mapping]] = ...) -> None: ...

class ReplaceFenceRequest(_message.Message):
    __slots__ = ("name", "config")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    name: str
    config: _fence_pb2.FenceConfig
    def __init__(self, name: _Optional[str] = ..., config: _Optional[_Union[_fence_pb2.FenceConfig, _Mapping]] = ...) -> None: ...

class ReplaceFenceResponse(_message.Message):
    __slots__ = ("fence",)
    FENCE_FIELD_NUMBER: _ClassVar[int]
    fence: _fence_pb2.Fence
    def __init__(self, fence: _Optional[_Union[_fence_pb2.Fence, _Mapping]] = ...) -> None: ...

class DeleteFenceRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteFenceResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class GetFenceRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetFenceResponse(_message.Message):
    __slots__ = ("fence",)
    FENCE_FIELD_NUMBER: _ClassVar[int]
    fence: _fence_pb2.Fence
    def __init__(self, fence: _Optional[_Union[_fence_pb2.Fence, _Mapping]] = ...) -> None: ...

class ListFencesRequest(_message.Message):
    __slots__ = ("prefix", "page_size", "page_token")
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    prefix: str
    page_size: int
    page_token: str
    def __init__(self, prefix: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListFencesResponse(_message.Message):
    __slots__ = ("fences", "next_page_token")
    FENCES_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    fences: _containers.RepeatedCompositeFieldContainer[_fence_pb2.Fence]
    next_page_token: str
    def __init__(self, fences: _Optional[_Iterable[_Union[_fence_pb2.Fence, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class ReadInsideRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class ReadInsideResponse(_message.Message):
    __slots__ = ("sequence", "subjects")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    SUBJECTS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    subjects: _containers.RepeatedCompositeFieldContainer[_fence_pb2.FenceSubjects]
    def __init__(self, sequence: _Optional[int] = ..., subjects: _Optional[_Iterable[_Union[_fence_pb2.FenceSubjects, _Mapping]]] = ...) -> None: ...

class WatchFenceRequest(_message.Message):
    __slots__ = ("name", "after_sequence", "consumer", "only_new", "conflate", "max_responses_per_second", "progress_interval", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    ONLY_NEW_FIELD_NUMBER: _ClassVar[int]
    CONFLATE_FIELD_NUMBER: _ClassVar[int]
    MAX_RESPONSES_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_INTERVAL_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    after_sequence: int
    consumer: str
    only_new: bool
    conflate: bool
    max_responses_per_second: float
    progress_interval: _duration_pb2.Duration
    uid: str
    def __init__(self, name: _Optional[str] = ..., after_sequence: _Optional[int] = ..., consumer: _Optional[str] = ..., only_new: bool = ..., conflate: bool = ..., max_responses_per_second: _Optional[float] = ..., progress_interval: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., uid: _Optional[str] = ...) -> None: ...

class WatchFenceResponse(_message.Message):
    __slots__ = ("events", "lost", "conflated", "sequence", "uid")
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    CONFLATED_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[_fence_pb2.FenceEvent]
    lost: LostEvents
    conflated: int
    sequence: int
    uid: str
    def __init__(self, events: _Optional[_Iterable[_Union[_fence_pb2.FenceEvent, _Mapping]]] = ..., lost: _Optional[_Union[LostEvents, _Mapping]] = ..., conflated: _Optional[int] = ..., sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class LostEvents(_message.Message):
    __slots__ = ("first_sequence", "last_sequence")
    FIRST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    LAST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    first_sequence: int
    last_sequence: int
    def __init__(self, first_sequence: _Optional[int] = ..., last_sequence: _Optional[int] = ...) -> None: ...

class AckFenceRequest(_message.Message):
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

class AckFenceResponse(_message.Message):
    __slots__ = ("consumer",)
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    consumer: _fence_pb2.FenceConsumer
    def __init__(self, consumer: _Optional[_Union[_fence_pb2.FenceConsumer, _Mapping]] = ...) -> None: ...

class DeleteConsumerRequest(_message.Message):
    __slots__ = ("name", "consumer")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    name: str
    consumer: str
    def __init__(self, name: _Optional[str] = ..., consumer: _Optional[str] = ...) -> None: ...

class DeleteConsumerResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class FenceEventsBetweenRequest(_message.Message):
    __slots__ = ("config", "start_revision", "start_time", "end_revision", "end_time")
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    START_REVISION_FIELD_NUMBER: _ClassVar[int]
    START_TIME_FIELD_NUMBER: _ClassVar[int]
    END_REVISION_FIELD_NUMBER: _ClassVar[int]
    END_TIME_FIELD_NUMBER: _ClassVar[int]
    config: _fence_pb2.FenceConfig
    start_revision: int
    start_time: _timestamp_pb2.Timestamp
    end_revision: int
    end_time: _timestamp_pb2.Timestamp
    def __init__(self, config: _Optional[_Union[_fence_pb2.FenceConfig, _Mapping]] = ..., start_revision: _Optional[int] = ..., start_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end_revision: _Optional[int] = ..., end_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class FenceEventsBetweenResponse(_message.Message):
    __slots__ = ("events",)
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[_fence_pb2.FenceEvent]
    def __init__(self, events: _Optional[_Iterable[_Union[_fence_pb2.FenceEvent, _Mapping]]] = ...) -> None: ...
