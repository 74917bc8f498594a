"""The index of a log in use: what SQLite's processes know of it, in a file that they share.

For its format see https://www.sqlite.org/walformat.html, section 2.1. It begins with two copies of one header, which
are written one after the other, in the order of bytes of the machine.
"""

import struct
from pathlib import Path
from typing import NamedTuple

from .disk import Disk

HEADER_BYTES = 48
LAST_FRAME_AT, SALTS_AT, SALTS_END = 16, 32, 40


class LogIndex(NamedTuple):
    """What an index says.

    Attributes:
        last: the last frame of the last commit; 0 if the next one begins the log anew.
        salts: what distinguishes this use of the file from earlier ones.
    """

    last: int
    salts: bytes

    def is_of_same_use(self, other: "LogIndex") -> bool:
        """Whether the log has not begun anew in between."""
        return self.salts == other.salts and (self.last == 0) == (other.last == 0)


def read_index(disk: Disk, path: Path) -> LogIndex | None:
    """The index of a log, without a frame if nobody has opened the database; None if it is written at this moment.

    Not for a process that has the database open: the end of the reading would release its locks.
    """
    try:
        with disk.open(path) as file:
            header, copy = file.read(HEADER_BYTES), file.read(HEADER_BYTES)
    except FileNotFoundError:
        return LogIndex(0, b"")
    if header != copy or len(header) != HEADER_BYTES:
        return None
    (last,) = struct.unpack_from("=I", header, LAST_FRAME_AT)
    return LogIndex(last, header[SALTS_AT:SALTS_END])
