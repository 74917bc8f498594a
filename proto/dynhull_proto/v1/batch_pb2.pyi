from dynhull_proto.v1 import points_pb2 as _points_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class MissingPointPolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MISSING_POINT_POLICY_UNSPECIFIED: _ClassVar[MissingPointPolicy]
    MISSING_POINT_POLICY_REFUSE: _ClassVar[MissingPointPolicy]
    MISSING_POINT_POLICY_COUNT: _ClassVar[MissingPointPolicy]
MISSING_POINT_POLICY_UNSPECIFIED: MissingPointPolicy
MISSING_POINT_POLICY_REFUSE: MissingPointPolicy
MISSING_POINT_POLICY_COUNT: MissingPointPolicy

class Batch(_message.Message):
    __slots__ = ("inserts", "deletes", "moves", "missing_points")
    INSERTS_FIELD_NUMBER: _ClassVar[int]
    DELETES_FIELD_NUMBER: _ClassVar[int]
    MOVES_FIELD_NUMBER: _ClassVar[int]
    MISSING_POINTS_FIELD_NUMBER: _ClassVar[int]
    inserts: _points_pb2.Points
    deletes: _points_pb2.Points
    moves: Moves
    missing_points: MissingPointPolicy
    def __init__(self, inserts: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., deletes: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., moves: _Optional[_Union[Moves, _Mapping]] = ..., missing_points: _Optional[_Union[MissingPointPolicy, str]] = ...) -> None: ...

class Moves(_message.Message):
    __slots__ = ("origins", "destinations")
    ORIGINS_FIELD_NUMBER: _ClassVar[int]
    DESTINATIONS_FIELD_NUMBER: _ClassVar[int]
    origins: _points_pb2.Points
    destinations: _points_pb2.Points
    def __init__(self, origins: _Optional[_Union[_points_pb2.Points, _Mapping]] = ..., destinations: _Optional[_Union[_points_pb2.Points, _Mapping]] = ...) -> None: ...

class BatchResult(_message.Message):
    __slots__ = ("revision", "inserted", "deleted", "missing", "hull_changed", "point_count", "duplicate")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    INSERTED_FIELD_NUMBER: _ClassVar[int]
    DELETED_FIELD_NUMBER: _ClassVar[int]
    MISSING_FIELD_NUMBER: _ClassVar[int]
    HULL_CHANGED_FIELD_NUMBER: _ClassVar[int]
    POINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    DUPLICATE_FIELD_NUMBER: _ClassVar[int]
    revision: int
    inserted: int
    deleted: int
    missing: int
    hull_changed: bool
    point_count: int
    duplicate: bool
    def __init__(self, revision: _Optional[int] = ..., inserted: _Optional[int] = ..., deleted: _Optional[int] = ..., missing: _Optional[int] = ..., hull_changed: bool = ..., point_count: _Optional[int] = ..., duplicate: bool = ...) -> None: ...
