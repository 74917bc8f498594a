"""The time at which a file was made, which Python does not report on Linux."""

import ctypes
import os
import struct
import sys
from functools import cache
from pathlib import Path
from typing import Any

# What statx is asked for: a path from the present folder, and the time; and where it answers which it knows, and what.
FROM_HERE, BIRTH = -100, 0x800
ANSWER_BYTES, KNOWN_AT, BIRTH_AT = 256, 0, 80
NANOSECONDS = 10**9


def birth(file: Path) -> int | None:
    """When a file was made, in nanoseconds since 1970; None if it does not exist, or its file system does not know.

    Moving a file, or changing its owner, leaves it; a copy has another one, which no program can set.
    """
    if sys.platform != "linux":
        try:
            born: float | None = getattr(file.stat(), "st_birthtime", None)
        except FileNotFoundError:
            return None
        return None if born is None else round(born * NANOSECONDS)
    statx = _statx()
    answer = ctypes.create_string_buffer(ANSWER_BYTES)
    if statx is None or statx(FROM_HERE, os.fsencode(file), 0, BIRTH, answer):
        return None
    (known,) = struct.unpack_from("=I", answer, KNOWN_AT)
    seconds, rest = struct.unpack_from("=qI", answer, BIRTH_AT)
    return seconds * NANOSECONDS + rest if known & BIRTH else None


@cache
def _statx() -> Any:
    """The function of the C library; None if it has none."""
    return getattr(ctypes.CDLL(None), "statx", None)
