"""Settings as messages and as documentation, made of their descriptions."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING, Any

from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message

from dynhull.arrays import as_coordinate
from dynhull.globe import as_center
from dynhull_proto.v1 import hull_pb2
from dynhull_surface.described import described, documenting

from ._arguments import choice, flag, whole
from ._times import encode_duration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dynhull_surface.described import Documented, Setting

SPAN = " Seconds, a timedelta, or text such as 30m."  # of an argument that is a time span


def encode_settings(settings: type, given: Mapping[str, Any], config: Message) -> None:
    """Add those of the described settings to a message that are given and not as usual."""
    chosen = {each.name: each for each in described(settings) if each.name in given}
    unusual = {name for name, each in chosen.items() if given[name] != each.usual}
    for name, each in chosen.items():
        if each.needs and name in unusual and unusual.isdisjoint(each.needs):
            raise ValueError(f"{name} is given alone: give {' or '.join(each.needs)}, too")
        if name in unusual:
            _encode(each, given[name], config)


def decode_settings(settings: type, config: Message) -> dict[str, Any]:
    """The described settings that a message has, by name."""
    return {each.name: _decode(each, config) for each in described(settings)}


def _encode(setting: Setting, value: Any, config: Message) -> None:
    within, _, name = setting.path.rpartition(".")
    message = getattr(config, within) if within else config
    encoded = _encoded(setting, value, message.DESCRIPTOR.fields_by_name[name])
    if encoded is None:
        return
    if setting.of and not config.HasField(within):
        raise ValueError(f"{setting.name} is for {setting.of}")
    if isinstance(encoded, Message):
        getattr(message, name).CopyFrom(encoded)
    else:
        setattr(message, name, encoded)


def _encoded(setting: Setting, value: Any, field: Any) -> Any:
    """The value in the form of a message; None for one that means the same as the usual one."""
    name, least = setting.name, setting.least
    if setting.choices:
        choice(name, value, setting.choices if setting.usual else (None, *setting.choices))
    if setting.kind is bool:
        value = flag(name, value) or None
    if field.enum_type is not None:
        return None if value is None else _numbers(setting, field)[value]
    if setting.kind is timedelta:
        return _span(value, name) if least == 0 else encode_duration(value, name)
    if setting.kind is float:
        return as_coordinate(value, name) or None
    if setting.kind is int:
        return whole(name, value, 32 if field.type == field.TYPE_UINT32 else 64, least or 0)
    return encode_center(value) if setting.kind == tuple[float, float] else value


def encode_center(center: tuple[float, float]) -> hull_pb2.LonLat:
    """A centre in the form of a message."""
    lon, lat = as_center(center)
    return hull_pb2.LonLat(longitude=lon, latitude=lat)


def _decode(setting: Setting, config: Message) -> Any:
    within, _, name = setting.path.rpartition(".")
    message = getattr(config, within) if within else config
    if setting.kind is timedelta:
        return getattr(message, name).ToTimedelta() if message.HasField(name) else None
    value = getattr(message, name)
    if setting.choices:
        numbers = _numbers(setting, message.DESCRIPTOR.fields_by_name[name])
        return next((each for each, number in numbers.items() if number == value), setting.usual)
    return value or setting.usual


def _numbers(setting: Setting, field: Any) -> dict[str, int]:
    """The number of each choice on the wire."""
    numbers = field.enum_type.values_by_name
    prefix = field.enum_type.values[0].name.removesuffix("UNSPECIFIED")
    words = setting.words or {each: each.upper() for each in setting.choices}
    return {each: numbers[f"{prefix}{word}"].number for each, word in words.items()}


def _span(seconds: float | timedelta | str, name: str) -> Duration | None:
    """A time span; None for 0, which means the same."""
    span = encode_duration(seconds, name)
    if span != Duration():
        return span
    if seconds:  # rounded to nothing, it would be no rule
        raise ValueError(f"{name} is {seconds!r}: must be at least a microsecond, or 0")
    return None


def documenting_settings(settings: type, spans: str = "") -> Callable[[Documented], Documented]:
    """Put the lines about the settings into a docstring; `spans` says what time spans are."""
    said = {each.name: f"{each.meaning}{spans if each.kind is timedelta else ''}" for each in described(settings)}
    return documenting("SETTINGS", said)
