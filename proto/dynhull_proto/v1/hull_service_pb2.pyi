import datetime

from dynhull_proto.v1 import batch_pb2 as _batch_pb2
from dynhull_proto.v1 import feed_pb2 as _feed_pb2
from dynhull_proto.v1 import hull_pb2 as _hull_pb2
from dynhull_proto.v1 import points_pb2 as _points_pb2
from google.protobuf import any_pb2 as _any_pb2
from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class HullView(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    HULL_VIEW_UNSPECIFIED: _ClassVar[HullView]
    HULL_VIEW_BASIC: _ClassVar[HullView]
    HULL_VIEW_FULL: _ClassVar[HullView]

class HullContents(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    HULL_CONTENTS_UNSPECIFIED: _ClassVar[HullContents]
    HULL_CONTENTS_SUMMARY: _ClassVar[HullContents]
    HULL_CONTENTS_OUTLINE: _ClassVar[HullContents]

class Picture(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PICTURE_UNSPECIFIED: _ClassVar[Picture]
    PICTURE_BEGINS: _ClassVar[Picture]
    PICTURE_BEGINS_ANEW: _ClassVar[Picture]
    PICTURE_COMPLETE: _ClassVar[Picture]

class HullPresence(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    HULL_PRESENCE_UNSPECIFIED: _ClassVar[HullPresence]
    HULL_PRESENCE_UNCHANGED: _ClassVar[HullPresence]
    HULL_PRESENCE_GONE: _ClassVar[HullPresence]
HULL_VIEW_UNSPECIFIED: HullView
HULL_VIEW_BASIC: HullView
HULL_VIEW_FULL: HullView
HULL_CONTENTS_UNSPECIFIED: HullContents
HULL_CONTENTS_SUMMARY: HullContents
HULL_CONTENTS_OUTLINE: HullContents
PICTURE_UNSPECIFIED: Picture
PICTURE_BEGINS: Picture
PICTURE_BEGINS_ANEW: Picture
PICTURE_COMPLETE: Picture
HULL_PRESENCE_UNSPECIFIED: HullPresence
HULL_PRESENCE_UNCHANGED: HullPresence
HULL_PRESENCE_GONE: HullPresence

class CreateHullRequest(_message.Message):
    __slots__ = ("name", "config")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    name: str
    config: _hull_pb2.HullConfig
    def __init__(self, name: _Optional[str] = ..., config: _Optional[_Union[_hull_pb2.HullConfig, _Mapping]] = ...) -> None: ...

class CreateHullResponse(_message.Message):
    __slots__ = ("hull",)
    HULL_FIELD_NUMBER: _ClassVar[int]
    hull: _hull_pb2.Hull
    def __init__(self, hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ...) -> None: ...

class DeleteHullRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteHullResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListHullsRequest(_message.Message):
    __slots__ = ("prefix", "page_size", "page_token")
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    prefix: str
    page_size: int
    page_token: str
    def __init__(self, prefix: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListHullsResponse(_message.Message):
    __slots__ = ("hulls", "next_page_token")
    HULLS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    hulls: _containers.RepeatedCompositeFieldContainer[_hull_pb2.Hull]
    next_page_token: str
    def __init__(self, hulls: _Optional[_Iterable[_Union[_hull_pb2.Hull, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class RecenterRequest(_message.Message):
    __slots__ = ("name", "center")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    name: str
    center: _hull_pb2.LonLat
    def __init__(self, name: _Optional[str] = ..., center: _Optional[_Union[_hull_pb2.LonLat, _Mapping]] = ...) -> None: ...

class RecenterResponse(_message.Message):
    __slots__ = ("hull", "hull_changed")
    HULL_FIELD_NUMBER: _ClassVar[int]
    HULL_CHANGED_FIELD_NUMBER: _ClassVar[int]
    hull: _hull_pb2.Hull
    hull_changed: bool
    def __init__(self, hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ..., hull_changed: bool = ...) -> None: ...

class SetHistoryRequest(_message.Message):
    __slots__ = ("name", "history")
    NAME_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    name: str
    history: _hull_pb2.History
    def __init__(self, name: _Optional[str] = ..., history: _Optional[_Union[_hull_pb2.History, _Mapping]] = ...) -> None: ...

class SetHistoryResponse(_message.Message):
    __slots__ = ("hull",)
    HULL_FIELD_NUMBER: _ClassVar[int]
    hull: _hull_pb2.Hull
    def __init__(self, hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ...) -> None: ...

class GetHistoryRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class GetHistoryResponse(_message.Message):
    __slots__ = ("history", "first_revision", "first_time", "last_revision", "last_time", "bytes", "batches", "moves", "erasures")
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    FIRST_REVISION_FIELD_NUMBER: _ClassVar[int]
    FIRST_TIME_FIELD_NUMBER: _ClassVar[int]
    LAST_REVISION_FIELD_NUMBER: _ClassVar[int]
    LAST_TIME_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    MOVES_FIELD_NUMBER: _ClassVar[int]
    ERASURES_FIELD_NUMBER: _ClassVar[int]
    history: _hull_pb2.History
    first_revision: int
    first_time: _timestamp_pb2.Timestamp
    last_revision: int
    last_time: _timestamp_pb2.Timestamp
    bytes: int
    batches: int
    moves: int
    erasures: _containers.RepeatedCompositeFieldContainer[_hull_pb2.Erasure]
    def __init__(self, history: _Optional[_Union[_hull_pb2.History, _Mapping]] = ..., first_revision: _Optional[int] = ..., first_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., last_revision: _Optional[int] = ..., last_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., bytes: _Optional[int] = ..., batches: _Optional[int] = ..., moves: _Optional[int] = ..., erasures: _Optional[_Iterable[_Union[_hull_pb2.Erasure, _Mapping]]] = ...) -> None: ...

class EraseHistoryRequest(_message.Message):
    __slots__ = ("name", "keys")
    NAME_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    name: str
    keys: _points_pb2.Keys
    def __init__(self, name: _Optional[str] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class EraseHistoryResponse(_message.Message):
    __slots__ = ("erasure",)
    ERASURE_FIELD_NUMBER: _ClassVar[int]
    erasure: _hull_pb2.Erasure
    def __init__(self, erasure: _Optional[_Union[_hull_pb2.Erasure, _Mapping]] = ...) -> None: ...

class SetQuarantineRequest(_message.Message):
    __slots__ = ("name", "quarantine")
    NAME_FIELD_NUMBER: _ClassVar[int]
    QUARANTINE_FIELD_NUMBER: _ClassVar[int]
    name: str
    quarantine: _hull_pb2.Quarantine
    def __init__(self, name: _Optional[str] = ..., quarantine: _Optional[_Union[_hull_pb2.Quarantine, _Mapping]] = ...) -> None: ...

class SetQuarantineResponse(_message.Message):
    __slots__ = ("hull",)
    HULL_FIELD_NUMBER: _ClassVar[int]
    hull: _hull_pb2.Hull
    def __init__(self, hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ...) -> None: ...

class ReshardRequest(_message.Message):
    __slots__ = ("name", "shards")
    NAME_FIELD_NUMBER: _ClassVar[int]
    SHARDS_FIELD_NUMBER: _ClassVar[int]
    name: str
    shards: int
    def __init__(self, name: _Optional[str] = ..., shards: _Optional[int] = ...) -> None: ...

class ReshardResponse(_message.Message):
    __slots__ = ("hull",)
    HULL_FIELD_NUMBER: _ClassVar[int]
    hull: _hull_pb2.Hull
    def __init__(self, hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ...) -> None: ...

class ListHeldRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "page_size", "page_token", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    page_size: int
    page_token: str
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class ListHeldResponse(_message.Message):
    __slots__ = ("revision", "keys", "positions", "times", "speeds", "growths", "revisions", "confirmations", "held_count", "next_page_token", "accuracies")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    SPEEDS_FIELD_NUMBER: _ClassVar[int]
    GROWTHS_FIELD_NUMBER: _ClassVar[int]
    REVISIONS_FIELD_NUMBER: _ClassVar[int]
    CONFIRMATIONS_FIELD_NUMBER: _ClassVar[int]
    HELD_COUNT_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    ACCURACIES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    keys: _points_pb2.Keys
    positions: _points_pb2.Points
    times: _points_pb2.Times
    speeds: _containers.RepeatedScalarFieldContainer[float]
    growths: _containers.RepeatedScalarFieldContainer[float]
    revisions: _containers.RepeatedScalarFieldContainer[int]
    confirmations: _containers.RepeatedScalarFieldContainer[int]
    held_count: int
    next_page_token: str
    accuracies: _points_pb2.Accuracies
    def __init__(self, revision: _Optional[int] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., positions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., speeds: _Optional[_Iterable[float]] = ..., growths: _Optional[_Iterable[float]] = ..., revisions: _Optional[_Iterable[int]] = ..., confirmations: _Optional[_Iterable[int]] = ..., held_count: _Optional[int] = ..., next_page_token: _Optional[str] = ..., accuracies: _Optional[_Union[_points_pb2.Accuracies, _Mapping]] = ...) -> None: ...

class ApplyRequest(_message.Message):
    __slots__ = ("name", "batch", "producer", "sequence", "may_skip", "after_sequence", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    BATCH_FIELD_NUMBER: _ClassVar[int]
    PRODUCER_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    MAY_SKIP_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    batch: _batch_pb2.Batch
    producer: str
    sequence: int
    may_skip: bool
    after_sequence: int
    uid: str
    def __init__(self, name: _Optional[str] = ..., batch: _Optional[_Union[_batch_pb2.Batch, _Mapping]] = ..., producer: _Optional[str] = ..., sequence: _Optional[int] = ..., may_skip: bool = ..., after_sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class ApplyResponse(_message.Message):
    __slots__ = ("result",)
    RESULT_FIELD_NUMBER: _ClassVar[int]
    result: _batch_pb2.BatchResult
    def __init__(self, result: _Optional[_Union[_batch_pb2.BatchResult, _Mapping]] = ...) -> None: ...

class ApplyTogetherRequest(_message.Message):
    __slots__ = ("batches", "producer", "sequence", "may_skip")
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    PRODUCER_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    MAY_SKIP_FIELD_NUMBER: _ClassVar[int]
    batches: _containers.RepeatedCompositeFieldContainer[HullBatch]
    producer: str
    sequence: int
    may_skip: bool
    def __init__(self, batches: _Optional[_Iterable[_Union[HullBatch, _Mapping]]] = ..., producer: _Optional[str] = ..., sequence: _Optional[int] = ..., may_skip: bool = ...) -> None: ...

class HullBatch(_message.Message):
    __slots__ = ("name", "batch", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    BATCH_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    batch: _batch_pb2.Batch
    uid: str
    def __init__(self, name: _Optional[str] = ..., batch: _Optional[_Union[_batch_pb2.Batch, _Mapping]] = ..., uid: _Optional[str] = ...) -> None: ...

class ApplyTogetherResponse(_message.Message):
    __slots__ = ("results",)
    RESULTS_FIELD_NUMBER: _ClassVar[int]
    results: _containers.RepeatedCompositeFieldContainer[_batch_pb2.BatchResult]
    def __init__(self, results: _Optional[_Iterable[_Union[_batch_pb2.BatchResult, _Mapping]]] = ...) -> None: ...

class IngestRequest(_message.Message):
    __slots__ = ("name", "batch", "producer", "sequence", "may_skip", "after_sequence", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    BATCH_FIELD_NUMBER: _ClassVar[int]
    PRODUCER_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    MAY_SKIP_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    batch: _batch_pb2.Batch
    producer: str
    sequence: int
    may_skip: bool
    after_sequence: int
    uid: str
    def __init__(self, name: _Optional[str] = ..., batch: _Optional[_Union[_batch_pb2.Batch, _Mapping]] = ..., producer: _Optional[str] = ..., sequence: _Optional[int] = ..., may_skip: bool = ..., after_sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class IngestResponse(_message.Message):
    __slots__ = ("batches", "revision", "point_count", "duplicates", "inserted", "deleted", "missing", "moved", "stale", "late", "skipped", "clamped", "evicted", "held", "released", "dropped")
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    DUPLICATES_FIELD_NUMBER: _ClassVar[int]
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
    batches: int
    revision: int
    point_count: int
    duplicates: int
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
    def __init__(self, batches: _Optional[int] = ..., revision: _Optional[int] = ..., point_count: _Optional[int] = ..., duplicates: _Optional[int] = ..., inserted: _Optional[int] = ..., deleted: _Optional[int] = ..., missing: _Optional[int] = ..., moved: _Optional[int] = ..., stale: _Optional[int] = ..., late: _Optional[int] = ..., skipped: _Optional[int] = ..., clamped: _Optional[int] = ..., evicted: _Optional[int] = ..., held: _Optional[int] = ..., released: _Optional[int] = ..., dropped: _Optional[int] = ...) -> None: ...

class StreamRequest(_message.Message):
    __slots__ = ("name", "batch", "producer", "sequence", "batches", "accept_results", "may_skip", "after_sequence", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    BATCH_FIELD_NUMBER: _ClassVar[int]
    PRODUCER_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    BATCHES_FIELD_NUMBER: _ClassVar[int]
    ACCEPT_RESULTS_FIELD_NUMBER: _ClassVar[int]
    MAY_SKIP_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    batch: _batch_pb2.Batch
    producer: str
    sequence: int
    batches: _containers.RepeatedCompositeFieldContainer[NumberedBatch]
    accept_results: bool
    may_skip: bool
    after_sequence: int
    uid: str
    def __init__(self, name: _Optional[str] = ..., batch: _Optional[_Union[_batch_pb2.Batch, _Mapping]] = ..., producer: _Optional[str] = ..., sequence: _Optional[int] = ..., batches: _Optional[_Iterable[_Union[NumberedBatch, _Mapping]]] = ..., accept_results: bool = ..., may_skip: bool = ..., after_sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class NumberedBatch(_message.Message):
    __slots__ = ("batch", "sequence", "after_sequence")
    BATCH_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    AFTER_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    batch: _batch_pb2.Batch
    sequence: int
    after_sequence: int
    def __init__(self, batch: _Optional[_Union[_batch_pb2.Batch, _Mapping]] = ..., sequence: _Optional[int] = ..., after_sequence: _Optional[int] = ...) -> None: ...

class StreamResponse(_message.Message):
    __slots__ = ("result", "sequence", "results", "max_batches", "max_message_bytes")
    RESULT_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    RESULTS_FIELD_NUMBER: _ClassVar[int]
    MAX_BATCHES_FIELD_NUMBER: _ClassVar[int]
    MAX_MESSAGE_BYTES_FIELD_NUMBER: _ClassVar[int]
    result: _batch_pb2.BatchResult
    sequence: int
    results: _containers.RepeatedCompositeFieldContainer[NumberedResult]
    max_batches: int
    max_message_bytes: int
    def __init__(self, result: _Optional[_Union[_batch_pb2.BatchResult, _Mapping]] = ..., sequence: _Optional[int] = ..., results: _Optional[_Iterable[_Union[NumberedResult, _Mapping]]] = ..., max_batches: _Optional[int] = ..., max_message_bytes: _Optional[int] = ...) -> None: ...

class NumberedResult(_message.Message):
    __slots__ = ("result", "sequence")
    RESULT_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    result: _batch_pb2.BatchResult
    sequence: int
    def __init__(self, result: _Optional[_Union[_batch_pb2.BatchResult, _Mapping]] = ..., sequence: _Optional[int] = ...) -> None: ...

class GetProducerRequest(_message.Message):
    __slots__ = ("name", "producer", "uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PRODUCER_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    producer: str
    uid: str
    def __init__(self, name: _Optional[str] = ..., producer: _Optional[str] = ..., uid: _Optional[str] = ...) -> None: ...

class GetProducerResponse(_message.Message):
    __slots__ = ("last_sequence", "uid")
    LAST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    last_sequence: int
    uid: str
    def __init__(self, last_sequence: _Optional[int] = ..., uid: _Optional[str] = ...) -> None: ...

class LocateRequest(_message.Message):
    __slots__ = ("name", "min_revision", "points", "keys", "keys_of", "keys_min_revision", "layer", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    KEYS_OF_FIELD_NUMBER: _ClassVar[int]
    KEYS_MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    points: _points_pb2.Points
    keys: _points_pb2.Keys
    keys_of: str
    keys_min_revision: int
    layer: int
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., keys_of: _Optional[str] = ..., keys_min_revision: _Optional[int] = ..., layer: _Optional[int] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class LocateResponse(_message.Message):
    __slots__ = ("revision", "sides", "keys_revision")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    SIDES_FIELD_NUMBER: _ClassVar[int]
    KEYS_REVISION_FIELD_NUMBER: _ClassVar[int]
    revision: int
    sides: bytes
    keys_revision: int
    def __init__(self, revision: _Optional[int] = ..., sides: _Optional[bytes] = ..., keys_revision: _Optional[int] = ...) -> None: ...

class CountRequest(_message.Message):
    __slots__ = ("name", "min_revision", "points", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    points: _points_pb2.Points
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class CountResponse(_message.Message):
    __slots__ = ("revision", "counts")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    counts: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, revision: _Optional[int] = ..., counts: _Optional[_Iterable[int]] = ...) -> None: ...

class GetPositionsRequest(_message.Message):
    __slots__ = ("name", "min_revision", "keys", "encoding", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    keys: _points_pb2.Keys
    encoding: _points_pb2.PointEncoding
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class GetPositionsResponse(_message.Message):
    __slots__ = ("revision", "positions", "present", "times", "accuracies")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    PRESENT_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    ACCURACIES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    positions: _points_pb2.Points
    present: bytes
    times: _points_pb2.Times
    accuracies: _points_pb2.Accuracies
    def __init__(self, revision: _Optional[int] = ..., positions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., present: _Optional[bytes] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., accuracies: _Optional[_Union[_points_pb2.Accuracies, _Mapping]] = ...) -> None: ...

class ReadEntitiesRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class ReadEntitiesResponse(_message.Message):
    __slots__ = ("revision", "keys", "positions", "times", "accuracies")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    ACCURACIES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    keys: _points_pb2.Keys
    positions: _points_pb2.Points
    times: _points_pb2.Times
    accuracies: _points_pb2.Accuracies
    def __init__(self, revision: _Optional[int] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., positions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., accuracies: _Optional[_Union[_points_pb2.Accuracies, _Mapping]] = ...) -> None: ...

class ReadPointsRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class ReadPointsResponse(_message.Message):
    __slots__ = ("revision", "hull", "points", "keys", "times", "timed", "expire_times", "expires", "accuracies")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    HULL_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    TIMED_FIELD_NUMBER: _ClassVar[int]
    EXPIRE_TIMES_FIELD_NUMBER: _ClassVar[int]
    EXPIRES_FIELD_NUMBER: _ClassVar[int]
    ACCURACIES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    hull: _hull_pb2.Hull
    points: _points_pb2.Points
    keys: _points_pb2.Keys
    times: _points_pb2.Times
    timed: bytes
    expire_times: _points_pb2.Times
    expires: bytes
    accuracies: _points_pb2.Accuracies
    def __init__(self, revision: _Optional[int] = ..., hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., timed: _Optional[bytes] = ..., expire_times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., expires: _Optional[bytes] = ..., accuracies: _Optional[_Union[_points_pb2.Accuracies, _Mapping]] = ...) -> None: ...

class SupportRequest(_message.Message):
    __slots__ = ("name", "min_revision", "directions", "encoding", "include_keys", "layer", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    directions: _points_pb2.Points
    encoding: _points_pb2.PointEncoding
    include_keys: bool
    layer: int
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., directions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., include_keys: bool = ..., layer: _Optional[int] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class SupportResponse(_message.Message):
    __slots__ = ("revision", "vertices", "keys")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    vertices: _points_pb2.Points
    keys: _points_pb2.Keys
    def __init__(self, revision: _Optional[int] = ..., vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class TangentsRequest(_message.Message):
    __slots__ = ("name", "min_revision", "points", "encoding", "layer", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    points: _points_pb2.Points
    encoding: _points_pb2.PointEncoding
    layer: int
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., layer: _Optional[int] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class TangentsResponse(_message.Message):
    __slots__ = ("revision", "left", "right")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    RIGHT_FIELD_NUMBER: _ClassVar[int]
    revision: int
    left: _points_pb2.Points
    right: _points_pb2.Points
    def __init__(self, revision: _Optional[int] = ..., left: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., right: _Optional[_Union[_points_pb2.Points, _Mapping]] = ...) -> None: ...

class DistanceRequest(_message.Message):
    __slots__ = ("name", "min_revision", "points", "keys", "keys_of", "keys_min_revision", "layer", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    KEYS_OF_FIELD_NUMBER: _ClassVar[int]
    KEYS_MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    points: _points_pb2.Points
    keys: _points_pb2.Keys
    keys_of: str
    keys_min_revision: int
    layer: int
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., keys_of: _Optional[str] = ..., keys_min_revision: _Optional[int] = ..., layer: _Optional[int] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class DistanceResponse(_message.Message):
    __slots__ = ("revision", "distances", "keys_revision")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    DISTANCES_FIELD_NUMBER: _ClassVar[int]
    KEYS_REVISION_FIELD_NUMBER: _ClassVar[int]
    revision: int
    distances: _containers.RepeatedScalarFieldContainer[float]
    keys_revision: int
    def __init__(self, revision: _Optional[int] = ..., distances: _Optional[_Iterable[float]] = ..., keys_revision: _Optional[int] = ...) -> None: ...

class IntersectLinesRequest(_message.Message):
    __slots__ = ("name", "min_revision", "origins", "targets", "encoding", "layer", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ORIGINS_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    origins: _points_pb2.Points
    targets: _points_pb2.Points
    encoding: _points_pb2.PointEncoding
    layer: int
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., origins: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., targets: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., layer: _Optional[int] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class IntersectLinesResponse(_message.Message):
    __slots__ = ("revision", "entries", "exits")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    ENTRIES_FIELD_NUMBER: _ClassVar[int]
    EXITS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    entries: _points_pb2.Points
    exits: _points_pb2.Points
    def __init__(self, revision: _Optional[int] = ..., entries: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., exits: _Optional[_Union[_points_pb2.Points, _Mapping]] = ...) -> None: ...

class GetHullRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "view", "include_keys", "layer", "vertex_page_size", "vertex_page_token", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    VIEW_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    VERTEX_PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    VERTEX_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    view: HullView
    include_keys: bool
    layer: int
    vertex_page_size: int
    vertex_page_token: str
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., view: _Optional[_Union[HullView, str]] = ..., include_keys: bool = ..., layer: _Optional[int] = ..., vertex_page_size: _Optional[int] = ..., vertex_page_token: _Optional[str] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class GetHullResponse(_message.Message):
    __slots__ = ("hull", "vertices", "measures", "vertex_keys", "next_vertex_page_token")
    HULL_FIELD_NUMBER: _ClassVar[int]
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    VERTEX_KEYS_FIELD_NUMBER: _ClassVar[int]
    NEXT_VERTEX_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    hull: _hull_pb2.Hull
    vertices: _points_pb2.Points
    measures: _hull_pb2.Measures
    vertex_keys: _points_pb2.Keys
    next_vertex_page_token: str
    def __init__(self, hull: _Optional[_Union[_hull_pb2.Hull, _Mapping]] = ..., vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., measures: _Optional[_Union[_hull_pb2.Measures, _Mapping]] = ..., vertex_keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., next_vertex_page_token: _Optional[str] = ...) -> None: ...

class SamplePointsRequest(_message.Message):
    __slots__ = ("name", "min_revision", "sample_size", "encoding", "include_keys", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_SIZE_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    sample_size: int
    encoding: _points_pb2.PointEncoding
    include_keys: bool
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., sample_size: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., include_keys: bool = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class SamplePointsResponse(_message.Message):
    __slots__ = ("revision", "points", "keys")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    points: _points_pb2.Points
    keys: _points_pb2.Keys
    def __init__(self, revision: _Optional[int] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class GetLayersRequest(_message.Message):
    __slots__ = ("name", "min_revision", "layer_count", "encoding", "include_keys", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    LAYER_COUNT_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    layer_count: int
    encoding: _points_pb2.PointEncoding
    include_keys: bool
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., layer_count: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., include_keys: bool = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class GetLayersResponse(_message.Message):
    __slots__ = ("revision", "vertex_counts", "vertices", "vertex_keys")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNTS_FIELD_NUMBER: _ClassVar[int]
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    VERTEX_KEYS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    vertex_counts: _containers.RepeatedScalarFieldContainer[int]
    vertices: _points_pb2.Points
    vertex_keys: _points_pb2.Keys
    def __init__(self, revision: _Optional[int] = ..., vertex_counts: _Optional[_Iterable[int]] = ..., vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., vertex_keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class GetInfluenceRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "include_keys", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    include_keys: bool
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., include_keys: bool = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class GetInfluenceResponse(_message.Message):
    __slots__ = ("revision", "vertices", "areas", "vertex_keys")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    AREAS_FIELD_NUMBER: _ClassVar[int]
    VERTEX_KEYS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    vertices: _points_pb2.Points
    areas: _containers.RepeatedScalarFieldContainer[float]
    vertex_keys: _points_pb2.Keys
    def __init__(self, revision: _Optional[int] = ..., vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., areas: _Optional[_Iterable[float]] = ..., vertex_keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class GetMeasuresRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "layer", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    layer: int
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., layer: _Optional[int] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class GetMeasuresResponse(_message.Message):
    __slots__ = ("revision", "measures", "diameter", "width", "min_box", "min_perimeter_box", "min_circle_x", "min_circle_y", "min_circle_radius", "label_x", "label_y", "geographic")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    DIAMETER_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    MIN_BOX_FIELD_NUMBER: _ClassVar[int]
    MIN_PERIMETER_BOX_FIELD_NUMBER: _ClassVar[int]
    MIN_CIRCLE_X_FIELD_NUMBER: _ClassVar[int]
    MIN_CIRCLE_Y_FIELD_NUMBER: _ClassVar[int]
    MIN_CIRCLE_RADIUS_FIELD_NUMBER: _ClassVar[int]
    LABEL_X_FIELD_NUMBER: _ClassVar[int]
    LABEL_Y_FIELD_NUMBER: _ClassVar[int]
    GEOGRAPHIC_FIELD_NUMBER: _ClassVar[int]
    revision: int
    measures: _hull_pb2.Measures
    diameter: float
    width: float
    min_box: _points_pb2.Points
    min_perimeter_box: _points_pb2.Points
    min_circle_x: float
    min_circle_y: float
    min_circle_radius: float
    label_x: float
    label_y: float
    geographic: bool
    def __init__(self, revision: _Optional[int] = ..., measures: _Optional[_Union[_hull_pb2.Measures, _Mapping]] = ..., diameter: _Optional[float] = ..., width: _Optional[float] = ..., min_box: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., min_perimeter_box: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., min_circle_x: _Optional[float] = ..., min_circle_y: _Optional[float] = ..., min_circle_radius: _Optional[float] = ..., label_x: _Optional[float] = ..., label_y: _Optional[float] = ..., geographic: bool = ...) -> None: ...

class GetSeriesRequest(_message.Message):
    __slots__ = ("name", "last", "encoding")
    NAME_FIELD_NUMBER: _ClassVar[int]
    LAST_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    name: str
    last: _duration_pb2.Duration
    encoding: _points_pb2.PointEncoding
    def __init__(self, name: _Optional[str] = ..., last: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ...) -> None: ...

class GetSeriesResponse(_message.Message):
    __slots__ = ("uid", "frame", "since_time", "interval", "times", "changed_times", "revisions", "point_counts", "vertex_counts", "areas", "perimeters", "diameters", "widths")
    UID_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    SINCE_TIME_FIELD_NUMBER: _ClassVar[int]
    INTERVAL_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    CHANGED_TIMES_FIELD_NUMBER: _ClassVar[int]
    REVISIONS_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNTS_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNTS_FIELD_NUMBER: _ClassVar[int]
    AREAS_FIELD_NUMBER: _ClassVar[int]
    PERIMETERS_FIELD_NUMBER: _ClassVar[int]
    DIAMETERS_FIELD_NUMBER: _ClassVar[int]
    WIDTHS_FIELD_NUMBER: _ClassVar[int]
    uid: str
    frame: _hull_pb2.Frame
    since_time: _timestamp_pb2.Timestamp
    interval: _duration_pb2.Duration
    times: _points_pb2.Times
    changed_times: _points_pb2.Times
    revisions: _containers.RepeatedScalarFieldContainer[int]
    point_counts: _containers.RepeatedScalarFieldContainer[int]
    vertex_counts: _containers.RepeatedScalarFieldContainer[int]
    areas: _containers.RepeatedScalarFieldContainer[float]
    perimeters: _containers.RepeatedScalarFieldContainer[float]
    diameters: _containers.RepeatedScalarFieldContainer[float]
    widths: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, uid: _Optional[str] = ..., frame: _Optional[_Union[_hull_pb2.Frame, str]] = ..., since_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., interval: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., changed_times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., revisions: _Optional[_Iterable[int]] = ..., point_counts: _Optional[_Iterable[int]] = ..., vertex_counts: _Optional[_Iterable[int]] = ..., areas: _Optional[_Iterable[float]] = ..., perimeters: _Optional[_Iterable[float]] = ..., diameters: _Optional[_Iterable[float]] = ..., widths: _Optional[_Iterable[float]] = ...) -> None: ...

class SeparateRequest(_message.Message):
    __slots__ = ("name", "min_revision", "other_name", "other_min_revision", "encoding")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    OTHER_NAME_FIELD_NUMBER: _ClassVar[int]
    OTHER_MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    other_name: str
    other_min_revision: int
    encoding: _points_pb2.PointEncoding
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., other_name: _Optional[str] = ..., other_min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ...) -> None: ...

class SeparateResponse(_message.Message):
    __slots__ = ("revision", "other_revision", "intersect", "distance", "depth", "normal_x", "normal_y", "offset", "closest")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    OTHER_REVISION_FIELD_NUMBER: _ClassVar[int]
    INTERSECT_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    DEPTH_FIELD_NUMBER: _ClassVar[int]
    NORMAL_X_FIELD_NUMBER: _ClassVar[int]
    NORMAL_Y_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    CLOSEST_FIELD_NUMBER: _ClassVar[int]
    revision: int
    other_revision: int
    intersect: bool
    distance: float
    depth: float
    normal_x: float
    normal_y: float
    offset: float
    closest: _points_pb2.Points
    def __init__(self, revision: _Optional[int] = ..., other_revision: _Optional[int] = ..., intersect: bool = ..., distance: _Optional[float] = ..., depth: _Optional[float] = ..., normal_x: _Optional[float] = ..., normal_y: _Optional[float] = ..., offset: _Optional[float] = ..., closest: _Optional[_Union[_points_pb2.Points, _Mapping]] = ...) -> None: ...

class PhaseDiagramRequest(_message.Message):
    __slots__ = ("name", "min_revision", "entries", "encoding", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENTRIES_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    entries: _points_pb2.Points
    encoding: _points_pb2.PointEncoding
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., entries: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class PhaseDiagramResponse(_message.Message):
    __slots__ = ("revision", "stable", "energies_above_hull", "left", "right", "left_shares", "right_shares")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    STABLE_FIELD_NUMBER: _ClassVar[int]
    ENERGIES_ABOVE_HULL_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    RIGHT_FIELD_NUMBER: _ClassVar[int]
    LEFT_SHARES_FIELD_NUMBER: _ClassVar[int]
    RIGHT_SHARES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    stable: _points_pb2.Points
    energies_above_hull: _containers.RepeatedScalarFieldContainer[float]
    left: _points_pb2.Points
    right: _points_pb2.Points
    left_shares: _containers.RepeatedScalarFieldContainer[float]
    right_shares: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, revision: _Optional[int] = ..., stable: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., energies_above_hull: _Optional[_Iterable[float]] = ..., left: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., right: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., left_shares: _Optional[_Iterable[float]] = ..., right_shares: _Optional[_Iterable[float]] = ...) -> None: ...

class FrontierRequest(_message.Message):
    __slots__ = ("name", "min_revision", "points", "rates", "encoding", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    RATES_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    points: _points_pb2.Points
    rates: _containers.RepeatedScalarFieldContainer[float]
    encoding: _points_pb2.PointEncoding
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., points: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., rates: _Optional[_Iterable[float]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class FrontierResponse(_message.Message):
    __slots__ = ("revision", "efficient", "turning_rates", "dominated", "tangencies", "sharpe_ratios")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    EFFICIENT_FIELD_NUMBER: _ClassVar[int]
    TURNING_RATES_FIELD_NUMBER: _ClassVar[int]
    DOMINATED_FIELD_NUMBER: _ClassVar[int]
    TANGENCIES_FIELD_NUMBER: _ClassVar[int]
    SHARPE_RATIOS_FIELD_NUMBER: _ClassVar[int]
    revision: int
    efficient: _points_pb2.Points
    turning_rates: _containers.RepeatedScalarFieldContainer[float]
    dominated: _containers.RepeatedScalarFieldContainer[bool]
    tangencies: _points_pb2.Points
    sharpe_ratios: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, revision: _Optional[int] = ..., efficient: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., turning_rates: _Optional[_Iterable[float]] = ..., dominated: _Optional[_Iterable[bool]] = ..., tangencies: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., sharpe_ratios: _Optional[_Iterable[float]] = ...) -> None: ...

class QueryRequest(_message.Message):
    __slots__ = ("reads",)
    READS_FIELD_NUMBER: _ClassVar[int]
    reads: _containers.RepeatedCompositeFieldContainer[Read]
    def __init__(self, reads: _Optional[_Iterable[_Union[Read, _Mapping]]] = ...) -> None: ...

class Read(_message.Message):
    __slots__ = ("locate", "count", "get_positions", "support", "tangents", "distance", "intersect_lines", "get_hull", "sample_points", "get_measures", "separate", "phase_diagram", "frontier", "verify", "get_producer", "get_layers", "get_influence")
    LOCATE_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    GET_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    SUPPORT_FIELD_NUMBER: _ClassVar[int]
    TANGENTS_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    INTERSECT_LINES_FIELD_NUMBER: _ClassVar[int]
    GET_HULL_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_POINTS_FIELD_NUMBER: _ClassVar[int]
    GET_MEASURES_FIELD_NUMBER: _ClassVar[int]
    SEPARATE_FIELD_NUMBER: _ClassVar[int]
    PHASE_DIAGRAM_FIELD_NUMBER: _ClassVar[int]
    FRONTIER_FIELD_NUMBER: _ClassVar[int]
    VERIFY_FIELD_NUMBER: _ClassVar[int]
    GET_PRODUCER_FIELD_NUMBER: _ClassVar[int]
    GET_LAYERS_FIELD_NUMBER: _ClassVar[int]
    GET_INFLUENCE_FIELD_NUMBER: _ClassVar[int]
    locate: LocateRequest
    count: CountRequest
    get_positions: GetPositionsRequest
    support: SupportRequest
    tangents: TangentsRequest
    distance: DistanceRequest
    intersect_lines: IntersectLinesRequest
    get_hull: GetHullRequest
    sample_points: SamplePointsRequest
    get_measures: GetMeasuresRequest
    separate: SeparateRequest
    phase_diagram: PhaseDiagramRequest
    frontier: FrontierRequest
    verify: VerifyRequest
    get_producer: GetProducerRequest
    get_layers: GetLayersRequest
    get_influence: GetInfluenceRequest
    def __init__(self, locate: _Optional[_Union[LocateRequest, _Mapping]] = ..., count: _Optional[_Union[CountRequest, _Mapping]] = ..., get_positions: _Optional[_Union[GetPositionsRequest, _Mapping]] = ..., support: _Optional[_Union[SupportRequest, _Mapping]] = ..., tangents: _Optional[_Union[TangentsRequest, _Mapping]] = ..., distance: _Optional[_Union[DistanceRequest, _Mapping]] = ..., intersect_lines: _Optional[_Union[IntersectLinesRequest, _Mapping]] = ..., get_hull: _Optional[_Union[GetHullRequest, _Mapping]] = ..., sample_points: _Optional[_Union[SamplePointsRequest, _Mapping]] = ..., get_measures: _Optional[_Union[GetMeasuresRequest, _Mapping]] = ..., separate: _Optional[_Union[SeparateRequest, _Mapping]] = ..., phase_diagram: _Optional[_Union[PhaseDiagramRequest, _Mapping]] = ..., frontier: _Optional[_Union[FrontierRequest, _Mapping]] = ..., verify: _Optional[_Union[VerifyRequest, _Mapping]] = ..., get_producer: _Optional[_Union[GetProducerRequest, _Mapping]] = ..., get_layers: _Optional[_Union[GetLayersRequest, _Mapping]] = ..., get_influence: _Optional[_Union[GetInfluenceRequest, _Mapping]] = ...) -> None: ...

class QueryResponse(_message.Message):
    __slots__ = ("answers",)
    ANSWERS_FIELD_NUMBER: _ClassVar[int]
    answers: _containers.RepeatedCompositeFieldContainer[ReadAnswer]
    def __init__(self, answers: _Optional[_Iterable[_Union[ReadAnswer, _Mapping]]] = ...) -> None: ...

class ReadAnswer(_message.Message):
    __slots__ = ("error", "locate", "count", "get_positions", "support", "tangents", "distance", "intersect_lines", "get_hull", "sample_points", "get_measures", "separate", "phase_diagram", "frontier", "verify", "get_producer", "get_layers", "get_influence")
    ERROR_FIELD_NUMBER: _ClassVar[int]
    LOCATE_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    GET_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    SUPPORT_FIELD_NUMBER: _ClassVar[int]
    TANGENTS_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    INTERSECT_LINES_FIELD_NUMBER: _ClassVar[int]
    GET_HULL_FIELD_NUMBER: _ClassVar[int]
    SAMPLE_POINTS_FIELD_NUMBER: _ClassVar[int]
    GET_MEASURES_FIELD_NUMBER: _ClassVar[int]
    SEPARATE_FIELD_NUMBER: _ClassVar[int]
    PHASE_DIAGRAM_FIELD_NUMBER: _ClassVar[int]
    FRONTIER_FIELD_NUMBER: _ClassVar[int]
    VERIFY_FIELD_NUMBER: _ClassVar[int]
    GET_PRODUCER_FIELD_NUMBER: _ClassVar[int]
    GET_LAYERS_FIELD_NUMBER: _ClassVar[int]
    GET_INFLUENCE_FIELD_NUMBER: _ClassVar[int]
    error: ReadError
    locate: LocateResponse
    count: CountResponse
    get_positions: GetPositionsResponse
    support: SupportResponse
    tangents: TangentsResponse
    distance: DistanceResponse
    intersect_lines: IntersectLinesResponse
    get_hull: GetHullResponse
    sample_points: SamplePointsResponse
    get_measures: GetMeasuresResponse
    separate: SeparateResponse
    phase_diagram: PhaseDiagramResponse
    frontier: FrontierResponse
    verify: VerifyResponse
    get_producer: GetProducerResponse
    get_layers: GetLayersResponse
    get_influence: GetInfluenceResponse
    def __init__(self, error: _Optional[_Union[ReadError, _Mapping]] = ..., locate: _Optional[_Union[LocateResponse, _Mapping]] = ..., count: _Optional[_Union[CountResponse, _Mapping]] = ..., get_positions: _Optional[_Union[GetPositionsResponse, _Mapping]] = ..., support: _Optional[_Union[SupportResponse, _Mapping]] = ..., tangents: _Optional[_Union[TangentsResponse, _Mapping]] = ..., distance: _Optional[_Union[DistanceResponse, _Mapping]] = ..., intersect_lines: _Optional[_Union[IntersectLinesResponse, _Mapping]] = ..., get_hull: _Optional[_Union[GetHullResponse, _Mapping]] = ..., sample_points: _Optional[_Union[SamplePointsResponse, _Mapping]] = ..., get_measures: _Optional[_Union[GetMeasuresResponse, _Mapping]] = ..., separate: _Optional[_Union[SeparateResponse, _Mapping]] = ..., phase_diagram: _Optional[_Union[PhaseDiagramResponse, _Mapping]] = ..., frontier: _Optional[_Union[FrontierResponse, _Mapping]] = ..., verify: _Optional[_Union[VerifyResponse, _Mapping]] = ..., get_producer: _Optional[_Union[GetProducerResponse, _Mapping]] = ..., get_layers: _Optional[_Union[GetLayersResponse, _Mapping]] = ..., get_influence: _Optional[_Union[GetInfluenceResponse, _Mapping]] = ...) -> None: ...

class ReadError(_message.Message):
    __slots__ = ("code", "message", "details")
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    DETAILS_FIELD_NUMBER: _ClassVar[int]
    code: int
    message: str
    details: _containers.RepeatedCompositeFieldContainer[_any_pb2.Any]
    def __init__(self, code: _Optional[int] = ..., message: _Optional[str] = ..., details: _Optional[_Iterable[_Union[_any_pb2.Any, _Mapping]]] = ...) -> None: ...

class WatchManyRequest(_message.Message):
    __slots__ = ("prefix", "names", "contents", "max_vertices", "max_events_per_second", "position", "encoding")
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    NAMES_FIELD_NUMBER: _ClassVar[int]
    CONTENTS_FIELD_NUMBER: _ClassVar[int]
    MAX_VERTICES_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENTS_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    prefix: str
    names: _containers.RepeatedScalarFieldContainer[str]
    contents: HullContents
    max_vertices: int
    max_events_per_second: float
    position: bytes
    encoding: _points_pb2.PointEncoding
    def __init__(self, prefix: _Optional[str] = ..., names: _Optional[_Iterable[str]] = ..., contents: _Optional[_Union[HullContents, str]] = ..., max_vertices: _Optional[int] = ..., max_events_per_second: _Optional[float] = ..., position: _Optional[bytes] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ...) -> None: ...

class WatchManyResponse(_message.Message):
    __slots__ = ("hulls", "picture", "position")
    HULLS_FIELD_NUMBER: _ClassVar[int]
    PICTURE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    hulls: _containers.RepeatedCompositeFieldContainer[HullNow]
    picture: Picture
    position: bytes
    def __init__(self, hulls: _Optional[_Iterable[_Union[HullNow, _Mapping]]] = ..., picture: _Optional[_Union[Picture, str]] = ..., position: _Optional[bytes] = ...) -> None: ...

class HullNow(_message.Message):
    __slots__ = ("name", "presence", "uid", "revision", "point_count", "held_count", "vertex_count", "frame", "center", "measures", "changed_time", "clock_time", "vertices", "error", "commit", "distinct_count")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PRESENCE_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    HELD_COUNT_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNT_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    CHANGED_TIME_FIELD_NUMBER: _ClassVar[int]
    CLOCK_TIME_FIELD_NUMBER: _ClassVar[int]
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    COMMIT_FIELD_NUMBER: _ClassVar[int]
    DISTINCT_COUNT_FIELD_NUMBER: _ClassVar[int]
    name: str
    presence: HullPresence
    uid: str
    revision: int
    point_count: int
    held_count: int
    vertex_count: int
    frame: _hull_pb2.Frame
    center: _hull_pb2.LonLat
    measures: _hull_pb2.Measures
    changed_time: _timestamp_pb2.Timestamp
    clock_time: _timestamp_pb2.Timestamp
    vertices: _points_pb2.Points
    error: float
    commit: int
    distinct_count: int
    def __init__(self, name: _Optional[str] = ..., presence: _Optional[_Union[HullPresence, str]] = ..., uid: _Optional[str] = ..., revision: _Optional[int] = ..., point_count: _Optional[int] = ..., held_count: _Optional[int] = ..., vertex_count: _Optional[int] = ..., frame: _Optional[_Union[_hull_pb2.Frame, str]] = ..., center: _Optional[_Union[_hull_pb2.LonLat, _Mapping]] = ..., measures: _Optional[_Union[_hull_pb2.Measures, _Mapping]] = ..., changed_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., clock_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., error: _Optional[float] = ..., commit: _Optional[int] = ..., distinct_count: _Optional[int] = ...) -> None: ...

class WatchRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "include_measures", "max_events_per_second", "progress_interval", "resume", "directions", "include_keys", "outline_only", "layer", "max_vertices")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_MEASURES_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENTS_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_INTERVAL_FIELD_NUMBER: _ClassVar[int]
    RESUME_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    OUTLINE_ONLY_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    MAX_VERTICES_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    include_measures: bool
    max_events_per_second: float
    progress_interval: _duration_pb2.Duration
    resume: WatchResume
    directions: _points_pb2.Points
    include_keys: bool
    outline_only: bool
    layer: int
    max_vertices: int
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., include_measures: bool = ..., max_events_per_second: _Optional[float] = ..., progress_interval: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., resume: _Optional[_Union[WatchResume, _Mapping]] = ..., directions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., include_keys: bool = ..., outline_only: bool = ..., layer: _Optional[int] = ..., max_vertices: _Optional[int] = ...) -> None: ...

class WatchResume(_message.Message):
    __slots__ = ("uid", "revision")
    UID_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    uid: str
    revision: int
    def __init__(self, uid: _Optional[str] = ..., revision: _Optional[int] = ...) -> None: ...

class WatchResponse(_message.Message):
    __slots__ = ("revision", "point_count", "snapshot", "change", "progress", "sketch", "measures", "cause", "clock_time", "center", "changed_time", "erased")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    CHANGE_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_FIELD_NUMBER: _ClassVar[int]
    SKETCH_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    CLOCK_TIME_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    CHANGED_TIME_FIELD_NUMBER: _ClassVar[int]
    ERASED_FIELD_NUMBER: _ClassVar[int]
    revision: int
    point_count: int
    snapshot: HullSnapshot
    change: HullChange
    progress: HullProgress
    sketch: HullSketch
    measures: _hull_pb2.Measures
    cause: _batch_pb2.Cause
    clock_time: _timestamp_pb2.Timestamp
    center: _hull_pb2.LonLat
    changed_time: _timestamp_pb2.Timestamp
    erased: bool
    def __init__(self, revision: _Optional[int] = ..., point_count: _Optional[int] = ..., snapshot: _Optional[_Union[HullSnapshot, _Mapping]] = ..., change: _Optional[_Union[HullChange, _Mapping]] = ..., progress: _Optional[_Union[HullProgress, _Mapping]] = ..., sketch: _Optional[_Union[HullSketch, _Mapping]] = ..., measures: _Optional[_Union[_hull_pb2.Measures, _Mapping]] = ..., cause: _Optional[_Union[_batch_pb2.Cause, str]] = ..., clock_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., center: _Optional[_Union[_hull_pb2.LonLat, _Mapping]] = ..., changed_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., erased: bool = ...) -> None: ...

class ReplayRequest(_message.Message):
    __slots__ = ("name", "start_revision", "start_time", "end_revision", "end_time", "speed", "every", "encoding", "include_measures", "max_events_per_second", "progress_interval", "resume", "directions", "include_keys", "outline_only", "layer", "max_vertices")
    NAME_FIELD_NUMBER: _ClassVar[int]
    START_REVISION_FIELD_NUMBER: _ClassVar[int]
    START_TIME_FIELD_NUMBER: _ClassVar[int]
    END_REVISION_FIELD_NUMBER: _ClassVar[int]
    END_TIME_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    EVERY_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_MEASURES_FIELD_NUMBER: _ClassVar[int]
    MAX_EVENTS_PER_SECOND_FIELD_NUMBER: _ClassVar[int]
    PROGRESS_INTERVAL_FIELD_NUMBER: _ClassVar[int]
    RESUME_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_KEYS_FIELD_NUMBER: _ClassVar[int]
    OUTLINE_ONLY_FIELD_NUMBER: _ClassVar[int]
    LAYER_FIELD_NUMBER: _ClassVar[int]
    MAX_VERTICES_FIELD_NUMBER: _ClassVar[int]
    name: str
    start_revision: int
    start_time: _timestamp_pb2.Timestamp
    end_revision: int
    end_time: _timestamp_pb2.Timestamp
    speed: float
    every: _duration_pb2.Duration
    encoding: _points_pb2.PointEncoding
    include_measures: bool
    max_events_per_second: float
    progress_interval: _duration_pb2.Duration
    resume: WatchResume
    directions: _points_pb2.Points
    include_keys: bool
    outline_only: bool
    layer: int
    max_vertices: int
    def __init__(self, name: _Optional[str] = ..., start_revision: _Optional[int] = ..., start_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end_revision: _Optional[int] = ..., end_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., speed: _Optional[float] = ..., every: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., include_measures: bool = ..., max_events_per_second: _Optional[float] = ..., progress_interval: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., resume: _Optional[_Union[WatchResume, _Mapping]] = ..., directions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., include_keys: bool = ..., outline_only: bool = ..., layer: _Optional[int] = ..., max_vertices: _Optional[int] = ...) -> None: ...

class ReplayResponse(_message.Message):
    __slots__ = ("event",)
    EVENT_FIELD_NUMBER: _ClassVar[int]
    event: WatchResponse
    def __init__(self, event: _Optional[_Union[WatchResponse, _Mapping]] = ...) -> None: ...

class TrackRequest(_message.Message):
    __slots__ = ("name", "start_revision", "start_time", "end_revision", "end_time", "keys", "every", "encoding")
    NAME_FIELD_NUMBER: _ClassVar[int]
    START_REVISION_FIELD_NUMBER: _ClassVar[int]
    START_TIME_FIELD_NUMBER: _ClassVar[int]
    END_REVISION_FIELD_NUMBER: _ClassVar[int]
    END_TIME_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    EVERY_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    name: str
    start_revision: int
    start_time: _timestamp_pb2.Timestamp
    end_revision: int
    end_time: _timestamp_pb2.Timestamp
    keys: _points_pb2.Keys
    every: _duration_pb2.Duration
    encoding: _points_pb2.PointEncoding
    def __init__(self, name: _Optional[str] = ..., start_revision: _Optional[int] = ..., start_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., end_revision: _Optional[int] = ..., end_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., every: _Optional[_Union[datetime.timedelta, _duration_pb2.Duration, _Mapping]] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ...) -> None: ...

class TrackResponse(_message.Message):
    __slots__ = ("key_indices", "times", "positions", "event_times", "revisions", "accuracies")
    KEY_INDICES_FIELD_NUMBER: _ClassVar[int]
    TIMES_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    EVENT_TIMES_FIELD_NUMBER: _ClassVar[int]
    REVISIONS_FIELD_NUMBER: _ClassVar[int]
    ACCURACIES_FIELD_NUMBER: _ClassVar[int]
    key_indices: _containers.RepeatedScalarFieldContainer[int]
    times: _points_pb2.Times
    positions: _points_pb2.Points
    event_times: _points_pb2.Times
    revisions: _containers.RepeatedScalarFieldContainer[int]
    accuracies: _points_pb2.Accuracies
    def __init__(self, key_indices: _Optional[_Iterable[int]] = ..., times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., positions: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., event_times: _Optional[_Union[_points_pb2.Times, _Mapping]] = ..., revisions: _Optional[_Iterable[int]] = ..., accuracies: _Optional[_Union[_points_pb2.Accuracies, _Mapping]] = ...) -> None: ...

class HullSnapshot(_message.Message):
    __slots__ = ("vertices", "uid", "vertex_keys")
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    VERTEX_KEYS_FIELD_NUMBER: _ClassVar[int]
    vertices: _points_pb2.Points
    uid: str
    vertex_keys: _points_pb2.Keys
    def __init__(self, vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., uid: _Optional[str] = ..., vertex_keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class HullSketch(_message.Message):
    __slots__ = ("vertices", "keys", "error", "uid")
    VERTICES_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    UID_FIELD_NUMBER: _ClassVar[int]
    vertices: _points_pb2.Points
    keys: _points_pb2.Keys
    error: float
    uid: str
    def __init__(self, vertices: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., error: _Optional[float] = ..., uid: _Optional[str] = ...) -> None: ...

class HullChange(_message.Message):
    __slots__ = ("removed", "removed_indices", "added", "added_indices", "rotation", "added_keys", "renamed_indices", "renamed_keys")
    REMOVED_FIELD_NUMBER: _ClassVar[int]
    REMOVED_INDICES_FIELD_NUMBER: _ClassVar[int]
    ADDED_FIELD_NUMBER: _ClassVar[int]
    ADDED_INDICES_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    ADDED_KEYS_FIELD_NUMBER: _ClassVar[int]
    RENAMED_INDICES_FIELD_NUMBER: _ClassVar[int]
    RENAMED_KEYS_FIELD_NUMBER: _ClassVar[int]
    removed: _points_pb2.Points
    removed_indices: _containers.RepeatedScalarFieldContainer[int]
    added: _points_pb2.Points
    added_indices: _containers.RepeatedScalarFieldContainer[int]
    rotation: int
    added_keys: _points_pb2.Keys
    renamed_indices: _containers.RepeatedScalarFieldContainer[int]
    renamed_keys: _points_pb2.Keys
    def __init__(self, removed: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., removed_indices: _Optional[_Iterable[int]] = ..., added: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., added_indices: _Optional[_Iterable[int]] = ..., rotation: _Optional[int] = ..., added_keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ..., renamed_indices: _Optional[_Iterable[int]] = ..., renamed_keys: _Optional[_Union[_points_pb2.Keys, _Mapping]] = ...) -> None: ...

class HullProgress(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class VerifyRequest(_message.Message):
    __slots__ = ("name", "min_revision", "encoding", "at_revision", "at_time", "at_uid")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MIN_REVISION_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    AT_TIME_FIELD_NUMBER: _ClassVar[int]
    AT_UID_FIELD_NUMBER: _ClassVar[int]
    name: str
    min_revision: int
    encoding: _points_pb2.PointEncoding
    at_revision: int
    at_time: _timestamp_pb2.Timestamp
    at_uid: str
    def __init__(self, name: _Optional[str] = ..., min_revision: _Optional[int] = ..., encoding: _Optional[_Union[_points_pb2.PointEncoding, str]] = ..., at_revision: _Optional[int] = ..., at_time: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., at_uid: _Optional[str] = ...) -> None: ...

class VerifyResponse(_message.Message):
    __slots__ = ("revision", "equal", "point_count", "vertex_count", "rounds", "first_difference", "keys_equal", "fence_count", "fence_differences")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    EQUAL_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNT_FIELD_NUMBER: _ClassVar[int]
    ROUNDS_FIELD_NUMBER: _ClassVar[int]
    FIRST_DIFFERENCE_FIELD_NUMBER: _ClassVar[int]
    KEYS_EQUAL_FIELD_NUMBER: _ClassVar[int]
    FENCE_COUNT_FIELD_NUMBER: _ClassVar[int]
    FENCE_DIFFERENCES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    equal: bool
    point_count: int
    vertex_count: int
    rounds: _containers.RepeatedCompositeFieldContainer[ChanRound]
    first_difference: VertexDifference
    keys_equal: bool
    fence_count: int
    fence_differences: _containers.RepeatedCompositeFieldContainer[FenceDifference]
    def __init__(self, revision: _Optional[int] = ..., equal: bool = ..., point_count: _Optional[int] = ..., vertex_count: _Optional[int] = ..., rounds: _Optional[_Iterable[_Union[ChanRound, _Mapping]]] = ..., first_difference: _Optional[_Union[VertexDifference, _Mapping]] = ..., keys_equal: bool = ..., fence_count: _Optional[int] = ..., fence_differences: _Optional[_Iterable[_Union[FenceDifference, _Mapping]]] = ...) -> None: ...

class FenceDifference(_message.Message):
    __slots__ = ("fence", "subject_hull", "string_key", "integer_key", "sequence", "expected", "found")
    FENCE_FIELD_NUMBER: _ClassVar[int]
    SUBJECT_HULL_FIELD_NUMBER: _ClassVar[int]
    STRING_KEY_FIELD_NUMBER: _ClassVar[int]
    INTEGER_KEY_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_FIELD_NUMBER: _ClassVar[int]
    FOUND_FIELD_NUMBER: _ClassVar[int]
    fence: str
    subject_hull: str
    string_key: str
    integer_key: int
    sequence: int
    expected: str
    found: str
    def __init__(self, fence: _Optional[str] = ..., subject_hull: _Optional[str] = ..., string_key: _Optional[str] = ..., integer_key: _Optional[int] = ..., sequence: _Optional[int] = ..., expected: _Optional[str] = ..., found: _Optional[str] = ...) -> None: ...

class ChanRound(_message.Message):
    __slots__ = ("guess", "groups", "steps", "cost", "closed")
    GUESS_FIELD_NUMBER: _ClassVar[int]
    GROUPS_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    COST_FIELD_NUMBER: _ClassVar[int]
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    guess: int
    groups: int
    steps: int
    cost: float
    closed: bool
    def __init__(self, guess: _Optional[int] = ..., groups: _Optional[int] = ..., steps: _Optional[int] = ..., cost: _Optional[float] = ..., closed: bool = ...) -> None: ...

class VertexDifference(_message.Message):
    __slots__ = ("index", "live", "recomputed")
    INDEX_FIELD_NUMBER: _ClassVar[int]
    LIVE_FIELD_NUMBER: _ClassVar[int]
    RECOMPUTED_FIELD_NUMBER: _ClassVar[int]
    index: int
    live: _points_pb2.Points
    recomputed: _points_pb2.Points
    def __init__(self, index: _Optional[int] = ..., live: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., recomputed: _Optional[_Union[_points_pb2.Points, _Mapping]] = ...) -> None: ...
