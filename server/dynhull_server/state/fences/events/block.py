"""Events of many fences as columns: what a trip makes, what is stored in one row, and what recent reads are made from.

No event needs a Python object before somebody reads it.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from dynhull.keys import PackedKeys

from ...records import Keys
from ..model.records import EventType, FenceEvent, Key, Members, Origin
from .format import EVENT_FIELDS, INTEGER_BYTES, INTEGER_KEY, NO_KEY, RUN_FIELDS, STRING_KEY

Integers = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Records = npt.NDArray[np.void]

INTEGER_LENGTH = bytes([INTEGER_BYTES])
MANY = 2**62
TYPES = {kind.value: kind for kind in EventType}
NOWHERE = math.nan, math.nan
COUNT = 2  # the place of that field of a run
RUN, EVENT = np.dtype(RUN_FIELDS), np.dtype(EVENT_FIELDS)


@dataclass(slots=True, eq=False)
class EventBlock:
    """m runs of n events in the order in which they were made. A run: consecutive events of one fence and one moment.

    Attributes:
        runs: (m,) a RUN each: the number of the fence, the sequence of its first event, their number, and the moment.
        rows: (n,) an EVENT each.
        keys: the bytes of all keys.
        names: the names of hulls.
        inside: by row, the subjects that were inside.
        origins: by row, where subjects come from that have changed hulls.
    """

    runs: Records
    rows: Records
    keys: bytes
    names: tuple[str, ...]
    inside: dict[int, tuple[Members, ...]] = field(default_factory=dict)
    origins: dict[int, Origin] = field(default_factory=dict)
    _ends: Integers | None = field(default=None, init=False)
    _places: Integers | None = field(default=None, init=False)

    def __len__(self) -> int:
        """The number of events."""
        return len(self.rows)

    @property
    def fences(self) -> Integers:
        """(m,) the numbers of the fences."""
        return self.runs["fence"]

    @property
    def firsts(self) -> Integers:
        """(m,) the sequence of the first event of each run."""
        return self.runs["first"]

    @property
    def counts(self) -> Integers:
        """(m,) the number of events of each run."""
        return self.runs["count"]

    @property
    def types(self) -> Bytes:
        """(n,) what happened."""
        return self.rows["type"]

    @property
    def ends(self) -> Integers:
        """(m,) the row after the last one of each run."""
        if self._ends is None:
            self._ends = np.cumsum(self.counts)
        return self._ends

    @property
    def bytes(self) -> int:
        """The memory that it takes, about."""
        size = self.rows.nbytes + self.runs.nbytes + len(self.keys)
        return size + sum([_bytes_of(each.keys) for found in self.inside.values() for each in found])

    def events(self, run: int, skipped: int = 0, most: int = MANY) -> list[FenceEvent]:
        """The events of a run after some of them, at most that many: O(their number), and O(n) the first time."""
        fence_first, count, hull, kind, revision, area_revision, time = self.runs[run].item()[1:]
        end = int(self.ends[run])
        start, first = end - count + skipped, fence_first + skipped
        end = min(end, start + most)
        rows = zip(self.rows[start:end].tolist(), self._keys(kind, start, end), strict=True)
        return [
            FenceEvent(
                first + number,
                TYPES[kind],
                causes,
                self.names[hull],
                key,
                revision,
                area_revision,
                None if x != x else (x, y),  # NaN
                None if before_x != before_x else (before_x, before_y),
                None if distance != distance else distance,
                event_time,
                time,
                first_time,
                self.inside.get(start + number, ()),
                self.origins.get(start + number),
            )
            for number, (
                (kind, causes, _, x, y, before_x, before_y, distance, event_time, first_time),
                key,
            ) in enumerate(rows)
        ]

    def by_fence(self) -> dict[int, list[FenceEvent]]:
        """The events of each fence, by number."""
        found: dict[int, list[FenceEvent]] = {}
        for run, number in enumerate(self.fences.tolist()):
            found.setdefault(number, []).extend(self.events(run))
        return found

    def part(self, start: int, end: int) -> Self:
        """Some consecutive events. O(size of the result + m)."""
        first, last = np.searchsorted(self.ends, [start, end - 1], "right").tolist()
        runs = self.runs[first : last + 1].copy()
        ends = self.ends[first : last + 1]
        starts = ends - runs["count"]
        cut = np.maximum(starts, start)
        runs["first"] += cut - starts
        runs["count"] = np.minimum(ends, end) - cut
        places = self._offsets()
        return replace(
            self,
            runs=runs,
            rows=self.rows[start:end],
            keys=self.keys[places[start] : places[end]],
            inside={row - start: each for row, each in self.inside.items() if start <= row < end},
            origins={row - start: each for row, each in self.origins.items() if start <= row < end},
        )

    def only(self, wanted: npt.NDArray[np.bool_]) -> Self:
        """Those runs that are wanted. O(n)."""
        rows = np.repeat(wanted, self.counts)
        numbers = np.flatnonzero(rows).tolist() if self.inside or self.origins else []
        keys = np.frombuffer(self.keys, np.uint8)[np.repeat(rows, self.rows["length"])]
        return replace(
            self,
            runs=self.runs[wanted],
            rows=self.rows[rows],
            keys=keys.tobytes(),
            inside={new: self.inside[row] for new, row in enumerate(numbers) if row in self.inside},
            origins={new: self.origins[row] for new, row in enumerate(numbers) if row in self.origins},
        )

    def _keys(self, kind: int, start: int, end: int) -> Sequence[Key | None]:
        if kind == NO_KEY:
            return [None] * (end - start)
        places = self._offsets()[start : end + 1].tolist()
        data = self.keys[places[0] : places[-1]]
        if kind == INTEGER_KEY:
            found: list[Key | None] = np.frombuffer(data, "<u8").tolist()
            return found
        base = places[0]
        return [str(data[a - base : b - base], "utf-8") for a, b in itertools.pairwise(places)]

    def _offsets(self) -> Integers:
        """(n + 1,) where the key of each event begins."""
        if self._places is None:
            self._places = np.zeros(len(self) + 1, np.int64)
            np.cumsum(self.rows["length"], out=self._places[1:])
        return self._places


@dataclass(frozen=True, slots=True)
class AppendEvents:
    """Events of fences; those of each fence have the sequences after its last event."""

    block: EventBlock


def joined(blocks: Sequence[EventBlock]) -> EventBlock:
    """Blocks as one. O(size of them)."""
    if len(blocks) == 1:
        return blocks[0]
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    names = tuple(dict.fromkeys(name for block in blocks for name in block.names))
    return EventBlock(
        np.frombuffer(b"".join([_runs(block, names).tobytes() for block in blocks]), RUN),
        np.frombuffer(b"".join([block.rows.tobytes() for block in blocks]), EVENT),
        b"".join([block.keys for block in blocks]),
        names,
        {start + row: each for start, block in zip(starts, blocks, strict=False) for row, each in block.inside.items()},
        {
            start + row: each
            for start, block in zip(starts, blocks, strict=False)
            for row, each in block.origins.items()
        },
    )


def _runs(block: EventBlock, names: tuple[str, ...]) -> Records:
    """The runs of a block, with the places of their hulls among these names."""
    if block.names == names[: len(block.names)]:
        return block.runs
    runs = block.runs.copy()
    runs["hull"] = np.array([names.index(name) for name in block.names], np.int64)[runs["hull"]]
    return runs


def block_of(events: Mapping[int, Iterable[FenceEvent]]) -> EventBlock:
    """The events of some fences, by number. O(events)."""
    runs: list[list[int]] = []
    ordered: list[FenceEvent] = []
    names: dict[str, int] = {}
    for number, made in events.items():
        expected, before = 0, None
        for event in made:
            ordered.append(event)
            hull = names.setdefault(event.hull, len(names))
            moment = hull, _kind(event.key), event.subject_revision, event.area_revision, event.time
            if moment != before or event.sequence != expected:
                runs.append([number, event.sequence, 0, *moment])
                before = moment
            runs[-1][COUNT] += 1
            expected = event.sequence + 1
    keys = [_key_bytes(event.key) for event in ordered]
    return EventBlock(
        run_array(runs),
        np.array(
            [
                (
                    event.type,
                    event.causes,
                    len(key),
                    *(event.position or NOWHERE),
                    *(event.previous or NOWHERE),
                    math.nan if event.distance is None else event.distance,
                    event.event_time,
                    event.first_time,
                )
                for event, key in zip(ordered, keys, strict=True)
            ],
            EVENT,
        ),
        b"".join(keys),
        tuple(names),
        {row: event.inside for row, event in enumerate(ordered) if event.inside},
        {row: event.origin for row, event in enumerate(ordered) if event.origin is not None},
    )


def run_array(runs: Iterable[Sequence[int]]) -> Records:
    """(m,) runs whose fields are in the order of RUN."""
    return np.array([tuple(run) for run in runs], RUN)


def key_columns(keys: Keys) -> tuple[int, bytes, bytes]:
    """The kind of keys, the length of each as a byte, and their bytes. O(size of the keys)."""
    if isinstance(keys, np.ndarray):
        return INTEGER_KEY, INTEGER_LENGTH * len(keys), keys.astype("<u8", copy=False).tobytes()
    return STRING_KEY, keys.lengths, keys.data


def _kind(key: Key | None) -> int:
    return NO_KEY if key is None else STRING_KEY if isinstance(key, str) else INTEGER_KEY


def _key_bytes(key: Key | None) -> bytes:
    if key is None:
        return b""
    return key.encode() if isinstance(key, str) else key.to_bytes(INTEGER_BYTES, "little")


def _bytes_of(keys: Keys) -> int:
    return len(keys.data) + len(keys) if isinstance(keys, PackedKeys) else keys.nbytes
