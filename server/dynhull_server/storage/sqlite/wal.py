"""Is the write-ahead log whole? SQLite itself drops everything after a damaged frame, and does not say so.

The format is SQLite's own, https://www.sqlite.org/fileformat2.html, section 4. A log may end in a commit that did not
finish when the power failed: nobody was told of that one. Damage before the last commit is another matter.
"""

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .errors import JournalDamagedError

HEADER_BYTES, FRAME_HEADER_BYTES = 32, 24
MAGIC = (0x377F0682, 0x377F0683)  # checksums over little-endian, over big-endian words

Words = npt.NDArray[np.uint32]


def check_log(path: Path) -> str | None:
    """What was lost at the end of the log, in words; None where it is whole, or not there.

    Raises:
        JournalDamagedError: a frame before the last commit is not what was written.
    """
    if not path.exists() or path.stat().st_size < HEADER_BYTES:
        return None
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
        magic, _, page_bytes, _, *salt, sum0, sum1 = struct.unpack(">8I", header)
        if magic not in MAGIC:
            return None  # never begun: SQLite writes the header before the first frame
        order = "<u4" if magic == MAGIC[0] else ">u4"
        state = _Checksum(0, 0).over(header[:24], order)
        if state.words != (sum0, sum1):
            return None
        number = 0
        damaged: int | None = None
        commits_since = 0
        while len(frame := file.read(FRAME_HEADER_BYTES + page_bytes)) >= FRAME_HEADER_BYTES:
            number += 1
            _, commit, *frame_salt, sum0, sum1 = struct.unpack(">6I", frame[:FRAME_HEADER_BYTES])
            if frame_salt != salt:
                break  # of an earlier use of the file
            if commits_since:
                raise JournalDamagedError(
                    f"{path}: frame {damaged} is damaged, and whole commits follow it: restore a backup"
                )
            if damaged is None:
                state = state.over(frame[:8] + frame[FRAME_HEADER_BYTES:], order)
                if len(frame) < FRAME_HEADER_BYTES + page_bytes or state.words != (sum0, sum1):
                    damaged = number
            if damaged is not None:
                commits_since += commit != 0
        if damaged is None:
            return None
        return (
            f"{path.name}: the last commit is incomplete or damaged from frame {damaged} on and was dropped; "
            "its writer was not told of it, unless the disk lost it afterwards"
        )


class _Checksum:
    """SQLite's running checksum: for each pair of words (x, y): s += x + t, then t += y + s, modulo 2**32."""

    _factors: dict[int, tuple[Words, Words, Words, Words]] = {}  # noqa: RUF012  (a cache of powers, the same for all)

    def __init__(self, s: int, t: int) -> None:
        self.words = (s, t)

    def over(self, data: bytes, order: str) -> "_Checksum":
        """The checksum after more data: the recurrence is linear, so it is a sum of words times fixed factors."""
        words = np.frombuffer(data[: len(data) // 8 * 8], order).astype(np.uint32)
        x, y = words[::2], words[1::2]
        ss, st, ts, tt = self._powers(len(x) + 1)
        # The pair k of n passes through the matrix ((1, 1), (1, 2)) n - k times: y enters after its first row.
        s, t = (np.uint32(word) for word in self.words)
        with np.errstate(over="ignore"):
            new_s = ss[-1] * s + st[-1] * t + np.sum(ss[-2::-1] * x + st[-2::-1] * (x + y), dtype=np.uint32)
            new_t = ts[-1] * s + tt[-1] * t + np.sum(ts[-2::-1] * x + tt[-2::-1] * (x + y), dtype=np.uint32)
        return _Checksum(int(new_s), int(new_t))

    @classmethod
    def _powers(cls, count: int) -> tuple[Words, Words, Words, Words]:
        """The entries of the matrix's powers 0 to count - 1."""
        if count not in cls._factors:
            a, b, c, d = 1, 0, 0, 1
            rows = []
            for _ in range(count):
                rows.append((a, b, c, d))
                a, b, c, d = (value & 0xFFFFFFFF for value in (a + c, b + d, a + 2 * c, b + 2 * d))
            ss, st, ts, tt = np.array(rows, np.uint32).T
            cls._factors[count] = ss, st, ts, tt
        return cls._factors[count]
