"""Reads keys, and keys with positions, from the arguments of a command or from standard input."""

import csv
import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from dynhull_client import HullClient, HullInfo, InvalidRequestError, Points

from .reading.labels import integer_key
from .reading.text import standard_input
from .reading.values import plain
from .rows import STANDARD_INPUT

FIELDS = 3


def keyed_rows(arguments: list[str] | None) -> tuple[list[str], Points]:
    """Keys and their positions: one from the arguments KEY X Y, or lines KEY,X,Y of standard input.

    ValueError names the first row that is something else.
    """
    if arguments and arguments != STANDARD_INPUT:
        if len(arguments) != FIELDS:
            raise ValueError(f"give KEY X Y, three arguments: {len(arguments)} were given")
        rows = [("arguments", arguments)]
    else:
        rows = [(f"line {line}", fields) for line, fields in enumerate(_lines(arguments), start=1) if fields]
    if not rows:
        raise ValueError("no keys: give KEY X Y as arguments, or lines KEY,X,Y on standard input")
    positions = np.array([_position(place, fields) for place, fields in rows])
    return [fields[0] for _, fields in rows], positions


def given_keys(arguments: list[str] | None) -> list[str]:
    """The arguments as keys, or the lines of standard input; ValueError if there are none."""
    if arguments and arguments != STANDARD_INPUT:
        return arguments
    keys = [fields[0] for fields in _lines(arguments) if fields]
    if not keys:
        raise ValueError("no keys: give them as arguments, or as lines of standard input")
    return keys


def keys_for(client: HullClient, name: str, keys: Sequence[str]) -> list[str] | list[int]:
    """The keys as the hull has them: as integers if its keys are; as text also where there is no such hull yet."""
    known = known_hull(client, name)
    if known is None or known.keyed != "int":
        return list(keys)
    return [integer_key(key, f"key {row}") for row, key in enumerate(keys, start=1)]


def known_hull(client: HullClient, name: str, *, timeout: float | None = None) -> HullInfo | None:
    """The hull, None if there is no such hull."""
    try:
        first = next(client.list_hulls(name, timeout=timeout), None)
    except InvalidRequestError as error:
        raise ValueError(f"the name of the hull {str(error).removeprefix('prefix ')}") from None
    return first if first is not None and first.name == name else None


def _lines(arguments: list[str] | None) -> Any:
    if not arguments and sys.stdin.isatty():
        raise ValueError("nothing given: give keys as arguments, or - to type them in")
    return csv.reader(standard_input(), skipinitialspace=True)


def _position(place: str, fields: list[str]) -> tuple[float, float]:
    try:
        _, x, y = fields
        found = float(plain(x, ".")), float(plain(y, "."))
    except ValueError:
        found = math.nan, math.nan
    if not fields[0]:
        raise ValueError(f"{place}: the key is empty")
    if not all(map(math.isfinite, found)):
        raise ValueError(f"{place}: {','.join(fields)!r} is not KEY,X,Y with finite numbers")
    return found
