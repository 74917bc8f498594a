import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class PointEncoding(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    POINT_ENCODING_UNSPECIFIED: _ClassVar[PointEncoding]
    POINT_ENCODING_PACKED: _ClassVar[PointEncoding]
    POINT_ENCODING_COORDINATES: _ClassVar[PointEncoding]
POINT_ENCODING_UNSPECIFIED: PointEncoding
POINT_ENCODING_PACKED: PointEncoding
POINT_ENCODING_COORDINATES: PointEncoding

class Points(_message.Message):
    __slots__ = ("packed", "coordinates")
    PACKED_FIELD_NUMBER: _ClassVar[int]
    COORDINATES_FIELD_NUMBER: _ClassVar[int]
    packed: bytes
    coordinates: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, packed: _Optional[bytes] = ..., coordinates: _Optional[_Iterable[float]] = ...) -> None: ...

class Keys(_message.Message):
    __slots__ = ("lengths", "text", "strings", "packed_integers", "integers")
    LENGTHS_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    STRINGS_FIELD_NUMBER: _ClassVar[int]
    PACKED_INTEGERS_FIELD_NUMBER: _ClassVar[int]
    INTEGERS_FIELD_NUMBER: _ClassVar[int]
    lengths: bytes
    text: bytes
    strings: _containers.RepeatedScalarFieldContainer[str]
    packed_integers: bytes
    integers: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, lengths: _Optional[bytes] = ..., text: _Optional[bytes] = ..., strings: _Optional[_Iterable[str]] = ..., packed_integers: _Optional[bytes] = ..., integers: _Optional[_Iterable[int]] = ...) -> None: ...

class Accuracies(_message.Message):
    __slots__ = ("packed", "values")
    PACKED_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    packed: bytes
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, packed: _Optional[bytes] = ..., values: _Optional[_Iterable[float]] = ...) -> None: ...

class Times(_message.Message):
    __slots__ = ("packed", "timestamps")
    PACKED_FIELD_NUMBER: _ClassVar[int]
    TIMESTAMPS_FIELD_NUMBER: _ClassVar[int]
    packed: bytes
    timestamps: _containers.RepeatedCompositeFieldContainer[_timestamp_pb2.Timestamp]
    def __init__(self, packed: _Optional[bytes] = ..., timestamps: _Optional[_Iterable[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]]] = ...) -> None: ...
