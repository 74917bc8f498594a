"""The measures of hulls over the last hour: of each that changes, a sample about every ten seconds.

Samples are made between the requests, at most a tenth of a processor's time, and a hull without changes has none. They
are kept in memory. If there are too many of them, the oldest of all hulls go first.
"""

import asyncio
import logging
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from struct import Struct
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..state.errors import HullNotFoundError
from ..state.hull import Hull
from ..state.records import NO_TIME
from .driver import Driver
from .live_hull import LiveHull
from .server_time import MICROSECONDS
from .steps import SLICE, Slices

# Seconds between two samples of a hull, and between looks whether it is time for them.
SERIES_SECONDS, LOOK_SECONDS = 10, 0.25
# The share of a processor that samples may take: one slice in ten.
REST = 9.0
# Seconds to wait for a hull that is busy.
BUSY_SECONDS = 1.0

_PACKED = Struct("<qqQQIdddd")
_TIME = Struct("<q")
SAMPLE = np.dtype(
    [
        ("time", "<i8"),
        ("changed", "<i8"),
        ("revision", "<u8"),
        ("points", "<u8"),
        ("vertices", "<u4"),
        *((name, "<f8") for name in ("area", "perimeter", "diameter", "width")),
    ]
)
# What a sample takes, with room to grow and its place in a round, and what a hull takes beside its samples.
SAMPLE_BYTES, HULL_BYTES = _PACKED.size * 9 // 8 + 8, 400

Samples = npt.NDArray[np.void]

log = logging.getLogger(__name__)


class Series(NamedTuple):
    """The samples of a hull.

    Attributes:
        since: the time from which on they are kept, or asked for, in microseconds since 1970.
        rows: the samples, of the type `SAMPLE`; the last one is of now.
    """

    since: int
    rows: Samples


@dataclass(slots=True, eq=False)
class _HullSeries:
    samples: bytearray = field(default_factory=bytearray)


@dataclass(slots=True, eq=False)
class _Round:
    """What was sampled together, and the time of its last sample."""

    time: int
    hulls: list[_HullSeries] = field(default_factory=list)


class KeptSeries:
    """The series of all hulls: none until `begin`.

    Args:
        find: returns a hull of the core as its callers use it, or raises HullNotFoundError.
        driver: drives the core that has the hulls.

    Attributes:
        seconds: for which samples are kept; 0 for none.
        interval: seconds between two samples of a hull that changes all the time; longer if a round takes longer.
        bytes: those of the samples that are kept, about.
        lost: the number of samples that were dropped early, or not kept, because there were too many.
    """

    def __init__(self, find: Callable[[Hull], LiveHull], driver: Driver) -> None:
        self.seconds = 0.0
        self.interval = float(SERIES_SECONDS)
        self.bytes = 0
        self.lost = 0
        self._find = find
        self._driver = driver
        self._most = 0
        self._begun = self._next = 0
        self._moved: dict[Hull, None] = {}
        self._series: dict[int, _HullSeries] = {}
        self._rounds: deque[_Round] = deque()
        self._short = False
        self._spent = 0.0

    def begin(self, seconds: float, most: int) -> None:
        """Keep samples for these seconds, in at most so many bytes."""
        self.seconds, self._most = seconds, most
        self._begun = self._driver.time()

    def __len__(self) -> int:
        """The number of hulls that have samples."""
        return len(self._series)

    @property
    def reach(self) -> float:
        """The seconds that samples go back, of all hulls."""
        return (self._driver.time() - self._since) / MICROSECONDS

    @property
    def _kept(self) -> int:
        return round(self.seconds * MICROSECONDS)

    @property
    def _since(self) -> int:
        return max(self._begun, self._driver.time() - self._kept)

    def moved(self, hulls: Sequence[Hull]) -> None:
        """Note that hulls have changed, or were deleted, while any is kept. O(1) each."""
        for hull in hulls:
            if hull.ended:
                self._moved.pop(hull, None)
                self._forget(hull.row.number)
            else:
                self._moved[hull] = None

    async def round(self) -> None:
        """Sample what has changed since the last round, if it is time for that."""
        now = self._driver.time()
        await self._trim(now)
        if now < self._next:
            return
        self._next = now + SERIES_SECONDS * MICROSECONDS
        moved, self._moved = self._moved, {}
        if not moved:
            return
        current = _Round(now)
        self._rounds.append(current)
        clock = self._driver.machine.clock
        self._spent = 0.0
        for hull in moved:
            try:
                async with asyncio.timeout(BUSY_SECONDS):
                    sample = await self._sample(self._find(hull))
            except HullNotFoundError:
                continue
            except TimeoutError:  # in the next round
                self._moved[hull] = None
                continue
            if not hull.ended:
                self._keep(hull.row.number, sample, current)
            if self._spent > SLICE:
                await clock.sleep(self._spent * REST)
                self._spent = 0.0
        self.interval = max(float(SERIES_SECONDS), (self._driver.time() - now) / MICROSECONDS)

    async def _sample(self, hull: LiveHull) -> bytes:
        """A sample of now. Raises HullNotFoundError if the hull is gone."""
        counts, vertices = await hull.vertices()
        changed = NO_TIME if hull.committed is None else hull.committed.time
        begun = self._driver.machine.clock.monotonic()  # a hull that is busy was waited for: that is no work
        found = await hull.measures(vertices)
        diameter = math.nan if found.diameter is None else found.diameter
        width = math.nan if found.width is None else found.width
        sizes = counts.revision, counts.points, len(vertices)
        self._spent += self._driver.machine.clock.monotonic() - begun
        return _PACKED.pack(self._driver.time(), changed, *sizes, found.area, found.perimeter, diameter, width)

    async def read(self, hull: LiveHull, last: float | None) -> Series:
        """The samples of a hull of the last seconds, and the one before them; None for all. The last one is of now."""
        now = await self._sample(hull)
        kept = self._series.get(hull.number)
        rows = np.frombuffer((b"" if kept is None else bytes(kept.samples)) + now, SAMPLE)
        since = max(self._since, round(hull.created.timestamp() * MICROSECONDS))
        if last is not None:
            since = max(since, self._driver.time() - round(last * MICROSECONDS))
        first = max(int(np.searchsorted(rows["time"], since)) - 1, 0)
        return Series(since, rows[first:])

    def _keep(self, number: int, sample: bytes, current: _Round) -> None:
        kept = self._series.get(number)
        need = SAMPLE_BYTES + (HULL_BYTES if kept is None else 0)
        while self.bytes + need > self._most and len(self._rounds) > 1:
            self._say_short()
            self._begun = self._rounds[0].time
            self.lost += self._drop_some()
        if self.bytes + need > self._most:
            self._say_short()
            self.lost += 1
            return
        if kept is None:
            kept = self._series[number] = _HullSeries()
        kept.samples += sample
        self.bytes += need
        current.time = self._driver.time()
        current.hulls.append(kept)

    async def _trim(self, now: int) -> None:
        slices = Slices()
        while self._rounds and self._rounds[0].time < now - self._kept:
            self._drop_some()
            await slices.others()

    def _drop_some(self) -> int:
        """Drop what a hull of the oldest round had before it: that sample lasts. Returns how many were dropped."""
        oldest = self._rounds[0]
        if not oldest.hulls:
            self._rounds.popleft()
            return 0
        samples, dropped = oldest.hulls.pop().samples, 0
        while len(samples) > _PACKED.size and _TIME.unpack_from(samples, _PACKED.size)[0] <= oldest.time:
            del samples[: _PACKED.size]
            dropped += 1
        self.bytes -= SAMPLE_BYTES * dropped
        return dropped

    def _forget(self, number: int) -> None:
        kept = self._series.pop(number, None)
        if kept is not None:
            self.bytes -= HULL_BYTES + SAMPLE_BYTES * (len(kept.samples) // _PACKED.size)
            kept.samples.clear()

    def _say_short(self) -> None:
        if not self._short:
            self._short = True
            log.warning(
                "measures are kept for less time than --series-kept says: they take --series-bytes",
                extra={"series_bytes": self._most, "hulls": len(self._series)},
            )
