"""The keys and times of rows, and the times at which they leave."""

from collections.abc import Callable
from decimal import Decimal
from typing import Any

from dynhull.keys import as_key

from ..keyed_rows import integer_key
from ..times import TimeReader
from .chunks import Labels
from .geometry import json_text
from .source import Source

Label = Callable[[Any], Any]


def label_reader(source: Source) -> Callable[[Any, Any, Any], Labels] | None:
    """Checks the key, the time and the time to leave of a row; None if the options name no such column.

    The first number among the times decides their unit, which is noted, unless the options give one.
    """
    options = source.options
    if not any(column for _, column in options.labels):
        return None
    key_of: Label = _none if options.key is None else _key_reader(options.key, source.integer_keys)
    time_of: Label = _none if options.time is None else _time_reader(source, options.time)
    end_of: Label = _none if options.expires is None else _time_reader(source, options.expires)

    def read(key: Any, time: Any, end: Any) -> Labels:
        return key_of(key), time_of(time), None if end is None or end == "" else end_of(end)

    return read


def _key_reader(name: str, integers: bool) -> Label:
    def read(value: Any) -> str | int:
        if value is None or value == "":
            raise ValueError(f"{name} is missing")
        value = float(value) if isinstance(value, Decimal) else value
        if integers:
            return as_key(integer_key(value, name), "int", name)
        if isinstance(value, bool | float | list | dict):
            raise ValueError(f"{name} is {json_text(value)}, not a string")
        return as_key(str(value), "str", name)

    return read


def _time_reader(source: Source, column: str) -> Label:
    times = TimeReader(column, source.options.time_unit)

    def read(value: Any) -> int:
        time = times.read(value)
        if times.note is not None:
            source.notes.append(times.note)
            times.note = None
        return time

    return read


def _none(_: Any) -> None:
    return None
