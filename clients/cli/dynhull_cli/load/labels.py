"""The keys and times of rows."""

from collections.abc import Callable
from typing import Any

from dynhull.keys import as_key

from ..keyed_rows import integer_key
from ..times import TimeReader
from .chunks import Labels
from .source import Source

Label = Callable[[Any], Any]


def label_reader(source: Source) -> Callable[[Any, Any], Labels] | None:
    """Checks the key and the time of a row; None if the options name neither.

    The first number among the times decides their unit, which is noted, unless the options give one.
    """
    options = source.options
    if options.key is None and options.time is None:
        return None
    key_of: Label = _none if options.key is None else _key_reader(options.key, source.integer_keys)
    time_of: Label = _none if options.time is None else _time_reader(source)

    def read(key: Any, time: Any) -> Labels:
        return key_of(key), time_of(time)

    return read


def _key_reader(name: str, integers: bool) -> Label:
    def read(value: Any) -> str | int:
        if value is None or value == "":
            raise ValueError(f"{name} is missing")
        if integers:
            return as_key(integer_key(value, name), "int", name)
        if isinstance(value, bool | float | list | dict):
            raise ValueError(f"{name} is {value!r}, not a string")
        return as_key(str(value), "str", name)

    return read


def _time_reader(source: Source) -> Label:
    assert source.options.time is not None  # as label_reader checks
    times = TimeReader(source.options.time, source.options.time_unit)

    def read(value: Any) -> int:
        time = times.read(value)
        if times.note is not None:
            source.notes.append(times.note)
            times.note = None
        return time

    return read


def _none(_: Any) -> None:
    return None
