from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional

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
