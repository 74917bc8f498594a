"""Events of many fences as columns: what a trip makes, what is stored in one row, and what recent reads are made from.

No event needs a Python object before somebody reads it.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys

from ..records import Keys, Times
from .records import EventType, FenceEvent, Key, Members, Origin

Integers = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]

# The keys of a run: none, strings, or integers of 8 bytes, little-endian.
NO_KEY, STRING_KEY, INTEGER_KEY = 0, 1, 2
INTEGER_BYTES = 8
MANY = 2**62
TYPES = {kind.value: kind for kind in EventType}
# Bytes that an event and a run take in memory, about, without keys.
EVENT_BYTES, RUN_BYTES = 67, 57


@dataclass(slots=True, eq=False)
class EventBlock:
    """m runs of n events in the order in which they were made. A run: consecutive events of one fence and one moment.

    Attributes:
        fences: (m,) the numbers of the fences.
        firsts: (m,) the sequence of the first event of each run.
        counts: (m,) the number of its events.
        hulls: (m,) the places of the names of the hulls of the subjects in `names`.
        kinds: (m,) whether its events have keys, and which.
        subject_revisions, area_revisions, times: (m,) as in `FenceEvent`.
        types, causes: (n,) as in `FenceEvent`.
        lengths: (n,) the bytes of each key.
        keys: the bytes of all keys.
        points, previous: (n, 2) positions, and those before; NaN where there is none.
        distances: (n,) distances, NaN where there is none.
        event_times, first_times: (n,) as in `FenceEvent`.
        names: the names of hulls.
        inside: by row, the subjects that were inside.
        origins: by row, where subjects come from that have changed hulls.
    """

    fences: Integers
    firsts: Integers
    counts: Integers
    hulls: Integers
    kinds: Bytes
    subject_revisions: Integers
    area_revisions: Integers
    times: Times
    types: Bytes
    causes: Bytes
    lengths: Bytes
    keys: bytes
    points: Points
    previous: Points
    distances: npt.NDArray[np.float64]
    event_times: Times
    first_times: Times
    names: tuple[str, ...]
    inside: dict[int, tuple[Members, ...]] = field(default_factory=dict)
    origins: dict[int, Origin] = field(default_factory=dict)
    _ends: Integers | None = field(default=None, init=False)
    _places: Integers | None = field(default=None, init=False)

    def __len__(self) -> int:
        """The number of events."""
        return len(self.types)

    @property
    def ends(self) -> Integers:
        """(m,) the row after the last one of each run."""
        if self._ends is None:
            self._ends = np.cumsum(self.counts)
        return self._ends

    @property
    def bytes(self) -> int:
        """The memory that it takes, about."""
        members = sum(_bytes_of(each.keys) for found in self.inside.values() for each in found)
        return EVENT_BYTES * len(self) + RUN_BYTES * len(self.fences) + len(self.keys) + members

    def events(self, run: int, skipped: int = 0, most: int = MANY) -> list[FenceEvent]:
        """The events of a run after some of them, at most that many: O(their number), and O(n) the first time."""
        end = int(self.ends[run])
        start, first = end - int(self.counts[run]) + skipped, int(self.firsts[run]) + skipped
        end = min(end, start + most)
        rows = slice(start, end)
        columns = zip(
            range(first, first + end - start),
            [TYPES[kind] for kind in self.types[rows].tolist()],
            self.causes[rows].tolist(),
            self._keys(run, start, end),
            self.points[rows].tolist(),
            self.previous[rows].tolist(),
            self.distances[rows].tolist(),
            self.event_times[rows].tolist(),
            self.first_times[rows].tolist(),
            range(start, end),
            strict=True,
        )
        hull, time = self.names[self.hulls[run]], int(self.times[run])
        revision, area_revision = int(self.subject_revisions[run]), int(self.area_revisions[run])
        return [
            FenceEvent(
                sequence,
                kind,
                causes,
                hull,
                key,
                revision,
                area_revision,
                None if x != x else (x, y),  # NaN
                None if before_x != before_x else (before_x, before_y),
                None if distance != distance else distance,
                event_time,
                time,
                first_time,
                self.inside.get(row, ()),
                self.origins.get(row),
            )
            for sequence, kind, causes, key, (x, y), (
                before_x,
                before_y,
            ), distance, event_time, first_time, row in columns
        ]

    def by_fence(self) -> dict[int, list[FenceEvent]]:
        """The events of each fence, by number."""
        found: dict[int, list[FenceEvent]] = {}
        for run, number in enumerate(self.fences.tolist()):
            found.setdefault(number, []).extend(self.events(run))
        return found

    def rows(self, start: int, end: int) -> Self:
        """Some consecutive events. O(size of the result + m)."""
        first, last = np.searchsorted(self.ends, [start, end - 1], "right").tolist()
        runs = slice(first, last + 1)
        ends = self.ends[runs]
        starts = ends - self.counts[runs]
        cut = np.maximum(starts, start)
        places = self._offsets()
        return replace(
            self,
            fences=self.fences[runs],
            firsts=self.firsts[runs] + cut - starts,
            counts=np.minimum(ends, end) - cut,
            hulls=self.hulls[runs],
            kinds=self.kinds[runs],
            subject_revisions=self.subject_revisions[runs],
            area_revisions=self.area_revisions[runs],
            times=self.times[runs],
            **{name: getattr(self, name)[start:end] for name in OF_EVENTS},
            keys=self.keys[places[start] : places[end]],
            inside={row - start: each for row, each in self.inside.items() if start <= row < end},
            origins={row - start: each for row, each in self.origins.items() if start <= row < end},
        )

    def runs(self, wanted: npt.NDArray[np.bool_]) -> Self:
        """Those runs that are wanted. O(n)."""
        rows = np.repeat(wanted, self.counts)
        numbers = np.flatnonzero(rows).tolist() if self.inside or self.origins else []
        keys = np.frombuffer(self.keys, np.uint8)[np.repeat(rows, self.lengths)]
        return replace(
            self,
            **{name: getattr(self, name)[wanted] for name in OF_RUNS},
            **{name: getattr(self, name)[rows] for name in OF_EVENTS},
            keys=keys.tobytes(),
            inside={new: self.inside[row] for new, row in enumerate(numbers) if row in self.inside},
            origins={new: self.origins[row] for new, row in enumerate(numbers) if row in self.origins},
        )

    def _keys(self, run: int, start: int, end: int) -> Sequence[Key | None]:
        kind = self.kinds[run]
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
            np.cumsum(self.lengths, out=self._places[1:])
        return self._places


OF_RUNS = ("fences", "firsts", "counts", "hulls", "kinds", "subject_revisions", "area_revisions", "times")
OF_EVENTS = ("types", "causes", "lengths", "points", "previous", "distances", "event_times", "first_times")


def joined(blocks: Sequence[EventBlock]) -> EventBlock:
    """Blocks as one. O(size of them)."""
    if len(blocks) == 1:
        return blocks[0]
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    columns = {name: np.concatenate([getattr(block, name) for block in blocks]) for name in (*OF_RUNS, *OF_EVENTS)}
    return replace(
        blocks[0],
        **(columns | _hulls(blocks)),
        keys=b"".join(block.keys for block in blocks),
        inside={
            start + row: each
            for start, block in zip(starts, blocks, strict=False)
            for row, each in block.inside.items()
        },
        origins={
            start + row: each
            for start, block in zip(starts, blocks, strict=False)
            for row, each in block.origins.items()
        },
    )


def _hulls(blocks: Sequence[EventBlock]) -> dict[str, Any]:
    """The hulls of blocks, among their names together."""
    names = tuple(dict.fromkeys(name for block in blocks for name in block.names))
    if all(block.names == names for block in blocks):
        return {}
    place = {name: row for row, name in enumerate(names)}
    hulls = [np.array([place[name] for name in block.names], np.int64)[block.hulls] for block in blocks]
    return {"hulls": np.concatenate(hulls), "names": names}


def block_of(events: Mapping[int, Iterable[FenceEvent]]) -> EventBlock:
    """The events of some fences, by number. O(events)."""
    runs: list[tuple[int, int, str, int, int, int, int]] = []
    counts: list[int] = []
    ordered: list[FenceEvent] = []
    for number, made in events.items():
        expected, before = 0, None
        for event in made:
            ordered.append(event)
            moment = _kind(event.key), event.subject_revision, event.area_revision, event.time
            if (event.hull, moment) != before or event.sequence != expected:
                runs.append((number, event.sequence, event.hull, *moment))
                counts.append(0)
                before = event.hull, moment
            counts[-1] += 1
            expected = event.sequence + 1
    keys = [_key_bytes(event.key) for event in ordered]
    nowhere = np.nan, np.nan
    columns = zip(*runs, strict=True) if runs else ((),) * 7
    numbers, firsts, hulls, kinds, subject_revisions, area_revisions, times = columns
    names = tuple(dict.fromkeys(hulls))
    return EventBlock(
        np.array(numbers, np.int64),
        np.array(firsts, np.int64),
        np.array(counts, np.int64),
        np.array([names.index(hull) for hull in hulls], np.int64),
        np.array(kinds, np.uint8),
        np.array(subject_revisions, np.int64),
        np.array(area_revisions, np.int64),
        np.array(times, np.int64),
        np.array([event.type for event in ordered], np.uint8),
        np.array([event.causes for event in ordered], np.uint8),
        np.array([len(key) for key in keys], np.uint8),
        b"".join(keys),
        np.array([event.position or nowhere for event in ordered], np.float64).reshape(-1, 2),
        np.array([event.previous or nowhere for event in ordered], np.float64).reshape(-1, 2),
        np.array([np.nan if event.distance is None else event.distance for event in ordered], np.float64),
        np.array([event.event_time for event in ordered], np.int64),
        np.array([event.first_time for event in ordered], np.int64),
        names,
        {row: event.inside for row, event in enumerate(ordered) if event.inside},
        {row: event.origin for row, event in enumerate(ordered) if event.origin is not None},
    )


def key_columns(keys: Keys) -> tuple[int, Bytes, bytes]:
    """The kind of keys, their lengths, and their bytes. O(size of the keys)."""
    if isinstance(keys, PackedKeys):
        return STRING_KEY, np.frombuffer(keys.lengths, np.uint8), keys.data
    return INTEGER_KEY, np.full(len(keys), INTEGER_BYTES, np.uint8), keys.astype("<u8", copy=False).tobytes()


def _kind(key: Key | None) -> int:
    return NO_KEY if key is None else STRING_KEY if isinstance(key, str) else INTEGER_KEY


def _key_bytes(key: Key | None) -> bytes:
    if key is None:
        return b""
    return key.encode() if isinstance(key, str) else key.to_bytes(INTEGER_BYTES, "little")


def _bytes_of(keys: Keys) -> int:
    return len(keys.data) + len(keys) if isinstance(keys, PackedKeys) else keys.nbytes
