"""Examination of the write-ahead log. SQLite itself silently drops all frames after a damaged one.

For the format see https://www.sqlite.org/fileformat2.html, section 4. A frame is valid if both of its salts are those
of the header and its checksum, which continues from frame to frame, is right. The last commit may be followed by

* frames of an earlier use of the file, both of whose salts differ;
* one unfinished commit, because the process ended, the power failed or the disk was full: it was not acknowledged.

Everything else is damage, also a frame with only one different salt: SQLite would take it for one of an earlier use.
"""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from ..durability import Durability
from ..port import DamagedError
from ..rows.totals import MODES, STOPPED, Totals
from .disk import Disk

HEADER_BYTES, FRAME_HEADER_BYTES = 32, 24
CHECKED_BYTES = 24  # of the header, before its checksum
MAGIC = (0x377F0682, 0x377F0683)  # checksums over little-endian, over big-endian words

REMEDY = "restore a backup, or what is left without the newest commits (dynhull restore --accept-loss)"

# In these modes, after a power failure the log may have holes followed by intact commits.
UNSYNCED = (MODES[Durability.INTERVAL], MODES[Durability.NONE])

Words = npt.NDArray[np.uint32]


def check_log(disk: Disk, path: Path, own: Totals | None, last: int | None = None) -> str | None:
    """A message about what was lost at the end of the log; None if nothing was, or if no log is needed.

    Args:
        disk: the disk it is on.
        path: the log.
        own: the totals in the database file, as of the last checkpoint.
        last: the last frame to examine, where others may be written at this moment.

    Raises:
        DamagedError: the log is damaged, and acknowledged batches are lost.
    """
    size = disk.size(path) or 0
    in_use = own is not None and own.mode != STOPPED
    if size < HEADER_BYTES + FRAME_HEADER_BYTES:
        if in_use:
            raise DamagedError(
                f"{path} is missing or cut short, and the database is incomplete without it: put it back, or {REMEDY}"
            )
        return None
    with disk.open(path) as file:
        header = file.read(HEADER_BYTES)
        magic, _, page_bytes, _, *salts, sum0, sum1 = struct.unpack(">8I", header)
        order = "<u4" if magic == MAGIC[0] else ">u4"
        state = _checksum((0, 0), header[:CHECKED_BYTES], order)
        if magic not in MAGIC or state != (sum0, sum1):
            if own is not None and not in_use:
                return None  # a new log, without acknowledged commits
            raise DamagedError(f"the header of {path} is damaged, so its commits cannot be read: {REMEDY}")
        damage = _damage(islice(_frames(file, page_bytes), last), (salts[0], salts[1]), state, order)
    if damage is None:
        return None
    frame, commits, others_follow = damage
    if others_follow and (own is None or own.mode not in UNSYNCED):
        raise DamagedError(f"{path}: frame {frame} is damaged, and intact commits follow it: {REMEDY}")
    return (
        f"{path}: the end, from frame {frame} on, is incomplete or damaged and was dropped, with at most "
        f"{commits or 1} of the newest commits; these had not been acknowledged, unless the disk lost them afterwards"
    )


@dataclass(frozen=True, slots=True)
class _Frame:
    """A page as of a commit; `commit` is non-zero in the last frame of a commit."""

    header: bytes
    page: bytes

    @property
    def commit(self) -> int:
        return int.from_bytes(self.header[4:8])

    @property
    def salts(self) -> tuple[int, int]:
        return int.from_bytes(self.header[8:12]), int.from_bytes(self.header[12:16])

    @property
    def sums(self) -> tuple[int, int]:
        return int.from_bytes(self.header[16:20]), int.from_bytes(self.header[20:24])


def _frames(file: IO[bytes], page_bytes: int) -> Iterator[_Frame]:
    while len(frame := file.read(FRAME_HEADER_BYTES + page_bytes)) >= FRAME_HEADER_BYTES:
        yield _Frame(frame[:FRAME_HEADER_BYTES], frame[FRAME_HEADER_BYTES:].ljust(page_bytes, b"\0"))


def _damage(
    frames: Iterable[_Frame], salts: tuple[int, int], state: tuple[int, int], order: str
) -> tuple[int, int, bool] | None:
    """The first damaged frame, the number of commits that end in or after it, and whether intact ones follow the first.

    A frame after the damaged one counts as intact if its checksum continues that of the frame before.
    """
    damaged: int | None = None
    foreign: int | None = None
    commits = 0
    others_follow = False
    for number, frame in enumerate(frames, start=1):
        same = [one == other for one, other in zip(frame.salts, salts, strict=True)]
        if not any(same):
            foreign = foreign or number
            continue
        whole = all(same) and _checksum(state, frame.header[:8] + frame.page, order) == frame.sums
        state = frame.sums
        if damaged is None and foreign is None and whole:
            continue
        if damaged is None:
            damaged = foreign or number
        else:
            others_follow |= whole and commits > 0
        commits += frame.commit != 0 and (whole or number == damaged)
    return None if damaged is None else (damaged, commits, others_follow)


def _checksum(state: tuple[int, int], data: bytes, order: str) -> tuple[int, int]:
    """SQLite's running checksum: for each pair of words (x, y): s += x + t, then t += y + s, modulo 2**32.

    The recurrence is linear, so the result is a sum of words times fixed factors.
    """
    words = np.frombuffer(data, order).astype(np.uint32)
    x, y = words[::2], words[1::2]
    ss, st, ts, tt = _powers(len(x) + 1)
    # The pair k of n passes through the matrix ((1, 1), (1, 2)) n - k times: y enters after its first row.
    s, t = (np.uint32(word) for word in state)
    with np.errstate(over="ignore"):
        new_s = ss[-1] * s + st[-1] * t + np.sum(ss[-2::-1] * x + st[-2::-1] * (x + y), dtype=np.uint32)
        new_t = ts[-1] * s + tt[-1] * t + np.sum(ts[-2::-1] * x + tt[-2::-1] * (x + y), dtype=np.uint32)
    return int(new_s), int(new_t)


@cache
def _powers(count: int) -> tuple[Words, Words, Words, Words]:
    """The entries of the matrix's powers 0 to count - 1."""
    a, b, c, d = 1, 0, 0, 1
    rows = []
    for _ in range(count):
        rows.append((a, b, c, d))
        a, b, c, d = (value & 0xFFFFFFFF for value in (a + c, b + d, a + 2 * c, b + 2 * d))
    ss, st, ts, tt = np.array(rows, np.uint32).T
    return ss, st, ts, tt
