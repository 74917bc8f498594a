import datetime

from dynhull_proto.v1 import batch_pb2 as _batch_pb2
from dynhull_proto.v1 import hull_pb2 as _hull_pb2
from dynhull_proto.v1 import points_pb2 as _points_pb2
from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class FeedRequest(_message.Message):
    __slots__ = ("name", "after_revision", "only_new", "position", "consumer", "uid", "progress_interval", "encoding", "prefix")
    NAME_FIELD_NUMBER: _ClassVar[int]
    AFTER_REVISION_FIELD_NUMBER: _ClassVar[int]
    ONLY_NEW_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_INTERVAL_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    name: str
    after_revision: int
    only_new: bool
    position: bytes
    consumer: str
    uid: str
    progress_interval: _duration_pb2.Duration
    encoding: _points_pb2.PointEncoding
    prefix: str
    def __init__(self, name: _Optional[str] = ..., after_revision: _Optional[int] = ..., only_new: bool = ..., position: _Optional[bytes] = ..., consumer: _Optional[str] = ..., uid: _Optional[str] = ..., progress_interval: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., prefix: _Optional[str] = ...) -> None: ...

class FeedResponse(_message.Message):
    __slots__ = ("batches", "lost", "revision", "uid", "hulls", "gone", "position")
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    HULLS_FIELD_NUMBER: _ClassVar[int]
    GONE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    batches: _containers.RepeatedCompositeFieldContainer[FeedBatch]
    lost: _containers.RepeatedCompositeFieldContainer[LostBatches]
    revision: int
    uid: str
    hulls: _containers.RepeatedCompositeFieldContainer[FedHull]
    gone: _containers.RepeatedCompositeFieldContainer[FedHull]
    position: bytes
    def __init__(self, batches: _Optional[_Iterable[_Union[FeedBatch, _Mapping]]] = ..., lost: _Optional[_Iterable[_Union[LostBatches, _Mapping]]] = ..., revision: _Optional[int] = ..., uid: _Optional[str] = ..., hulls: _Optional[_Iterable[_Union[FedHull, _Mapping]]] = ..., gone: _Optional[_Iterable[_Union[FedHull, _Mapping]]] = ..., position: _Optional[bytes] = ...) -> None: ...

class FeedConsumer(_message.Message):
    __slots__ = ("name", "hull", "prefix", "acknowledged_revision", "uid", "position", "backlog", "lost", "replaced")
    NAME_FIELD_NUMBER: _ClassVar[int]
    HULL_FIELD_NUMBER: _ClassVar[int]
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    ACKNOWLEDGED_REVISION_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    BACKLOG_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    REPLACED_FIELD_NUMBER: _ClassVar[int]
    name: str
    hull: str
    prefix: str
    acknowledged_revision: int
    uid: str
    position: bytes
    backlog: int
    lost: int
    replaced: bool
    def __init__(self, name: _Optional[str] = ..., hull: _Optional[str] = ..., prefix: _Optional[str] = ..., acknowledged_revision: _Optional[int] = ..., uid: _Optional[str] = ..., position: _Optional[bytes] = ..., backlog: _Optional[int] = ..., lost: _Optional[int] = ..., replaced: bool = ...) -> None: ...

class AckFeedRequest(_message.Message):
    __slots__ = ("name", "prefix", "consumer", "revision", "uid", "position")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    name: str
    prefix: str
    consumer: str
    revision: int
    uid: str
    position: bytes
    def __init__(self, name: _Optional[str] = ..., prefix: _Optional[str] = ..., consumer: _Optional[str] = ..., revision: _Optional[int] = ..., uid: _Optional[str] = ..., position: _Optional[bytes] = ...) -> None: ...

class AckFeedResponse(_message.Message):
    __slots__ = ("consumer",)
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    consumer: FeedConsumer
    def __init__(self, consumer: _Optional[_Union[FeedConsumer, _Mapping]] = ...) -> None: ...

class ListFeedConsumersRequest(_message.Message):
    __slots__ = ("prefix", "page_size", "page_token")
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    prefix: str
    page_size: int
    page_token: str
    def __init__(self, prefix: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListFeedConsumersResponse(_message.Message):
    __slots__ = ("consumers", "next_page_token")
    CONSUMERS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    consumers: _containers.RepeatedCompositeFieldContainer[FeedConsumer]
    next_page_token: str
    def __init__(self, consumers: _Optional[_Iterable[_Union[FeedConsumer, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class DeleteFeedConsumerRequest(_message.Message):
    __slots__ = ("name", "prefix", "consumer")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    CONSUMER_FIELD_NUMBER: _ClassVar[int]
    name: str
    prefix: str
    consumer: str
    def __init__(self, name: _Optional[str] = ..., prefix: _Optional[str] = ..., consumer: _Optional[str] = ...) -> None: ...

class DeleteFeedConsumerResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class FedHull(_message.Message):
    __slots__ = ("name", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    uid: str
    def __init__(self, name: _Optional[str] = ..., uid: _Optional[str] = ...) -> None: ...

class LostBatches(_message.Message):
    __slots__ = ("first_revision", "last_revision", "hull", "uid")
    FIRST_REVISION_FIELD_NUMBER: _ClassVar[int]
    LAST_REVISION_FIELD_NUMBER: _ClassVar[int]
    HULL_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    first_revision: int
    last_revision: int
    hull: str
    uid: str
    def __init__(self, first_revision: _Optional[int] = ..., last_revision: _Optional[int] = ..., hull: _Optional[str] = ..., uid: _Optional[str] = ...) -> None: ...

class FeedBatch(_message.Message):
    __slots__ = ("hull", "revision", "commit", "commit_time", "cause", "batch", "expired_until", "expired_count", "clock_time", "center", "held", "uid", "more")
    HULL_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    COMMIT_FIELD_NUMBER: _ClassVar[int]
    COMMIT_TIME_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    BATCH_FIELD_NUMBER: _ClassVar[int]
    EXPIRED_UNTIL_FIELD_NUMBER: _ClassVar[int]
    EXPIRED_COUNT_FIELD_NUMBER: _ClassVar[int]
    CLOCK_TIME_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    MORE_FIELD_NUMBER: _ClassVar[int]
    hull: str
    revision: int
    commit: int
    commit_time: _timestamp_pb2.Timestamp
    cause: _batch_pb2.Cause
    batch: _batch_pb2.Batch
    expired_until: _timestamp_pb2.Timestamp
    expired_count: int
    clock_time: _timestamp_pb2.Timestamp
    center: _hull_pb2.LonLat
    held: FeedHeld
    uid: str
    more: bool
    def __init__(self, hull: _Optional[str] = ..., revision: _Optional[int] = ..., commit: _Optional[int] = ..., commit_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., cause: _Optional[_Union[_batch_pb2.Cause, str]] = ..., batch: _Optional[_Union[_batch_pb2.Batch, _Mapping]] = ..., expired_until: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., expired_count: _Optional[int] = ..., clock_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., center: _Optional[_Union[_hull_pb2.LonLat, _Mapping]] = ..., held: _Optional[_Union[FeedHeld, _Mapping]] = ..., uid: _Optional[str] = ..., more: bool = ...) -> None: ...

class FeedHeld(_message.Message):
    __slots__ = ("dropped", "keys", "positions", "times", "rules")
    DROPPED_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    RULES_FIELD_NUMBER: _ClassVar[int]
    dropped: _points_pb2.Keys
    keys: _points_pb2.Keys
    positions: _points_pb2.Points
    times: _points_pb2.Times
    rules: _hull_pb2.Quarantine
    def __init__(self, dropped: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., positions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., rules: _Optional[_Union[_hull_pb2.Quarantine, _Mapping]] = ...) -> None: ...
