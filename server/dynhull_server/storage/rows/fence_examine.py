"""Examination of the rows of fences: are all present and intact?"""

import struct
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import count, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ...state.alarms.rule import called
from ...state.fences.model.records import Consumer
from .encoding import checksum, weight
from .event_blocks import Runs, decode_runs
from .event_rows import decode_delay
from .feed_rows import NO_FENCE, feed_consumer_from
from .fence_ledger import DropInside, DropStaged, FenceStep
from .fence_rows import consumer_values, found_fences
from .fence_runs import FenceRows, Staged, Start
from .tables import DELAYS_SINCE, STARTS_SINCE, Reader

if TYPE_CHECKING:
    from .ledger import Ledger


@dataclass(slots=True)
class FoundFences:
    """What there is of fences.

    Attributes:
        rows, sum: the number of all rows, and the sum of their weights.
        next_number: a number greater than that of any fence found.
        fatal: damage that prevents serving the database.
        gaps: events that are missing before others. Unless other rows are missing, these are staged, and not valid yet.
        repairs: steps that drop unfinished rows.
        starts: where the events of fences begin that have dropped some, in a format that does not store it.
    """

    rows: int = 0
    sum: int = 0
    next_number: int = 1
    fatal: list[str] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)
    repairs: list[FenceStep] = field(default_factory=list)
    starts: dict[int, int] = field(default_factory=dict)


class FenceExamination:
    """Reads every row of the fences, and fills the ledger. Without `contents`, payloads are not read.

    Args:
        reader: reads the rows.
        ledger: receives the rows.
        version: the format.
        contents: whether to read payloads.
    """

    def __init__(self, reader: Reader, ledger: "Ledger", version: int, *, contents: bool) -> None:
        self._reader = reader
        self._ledger = ledger
        self._fences = ledger.fences
        self._contents = contents
        self._has_delays = version >= DELAYS_SINCE
        self._has_starts = version >= STARTS_SINCE
        self._lasts: defaultdict[int, array[int]] = defaultdict(lambda: array("q"))
        self._found = FoundFences()

    def run(self) -> FoundFences:
        """Read everything once."""
        found = self._found
        ledger = self._ledger
        self._fence_rows()
        if self._has_starts:
            ledger.start_ids = self._each("starts", "first, checksum", self._take_start)
        self._events()
        payload = "payload" if self._contents else "NULL"
        ledger.inside_ids = self._each("insides", f"sequence, part, parts, checksum, {payload}", self._take_inside)
        of_consumers = "name, acknowledged, lost, checksum"
        ledger.consumer_ids = self._each("consumers", of_consumers, self._take_consumer, self._take_feed_consumer)
        if self._has_delays:
            ledger.delay_ids = self._each("delays", "checksum, payload", self._take_delay)
        for number, fence in self._fences.items():
            self._judge(fence)
            self._ledger.runs.begin(number)
        consumers = ledger.feed_consumers.values()
        found.rows = sum(fence.count for fence in self._fences.values()) + len(ledger.events) + len(consumers)
        found.sum = sum(fence.sum for fence in self._fences.values()) + ledger.events.sum
        found.sum += sum(each.weight for each in consumers)
        found.next_number = max((number + 1 for number in self._fences), default=1)
        names = Counter(fence.row.name for fence in self._fences.values())
        found.fatal += [f"{times} fences have the name {name!r}" for name, times in names.items() if times > 1]
        return found

    def _fence_rows(self) -> None:
        for each in found_fences(self._reader):
            if each.row is None:
                self._found.fatal.append(f"the row of fence {each.number}, {each.name!r}, is damaged")
                continue
            found = weight(each.checksum, each.number)
            self._fences[each.number] = FenceRows(each.row, found, found)

    def _each(
        self, table: str, columns: str, take: Callable[..., None], of_no_fence: Callable[..., None] | None = None
    ) -> "count[int]":
        """Take the rows of a table with their fences; the others are dead. Returns the numbers of rows to come."""
        newest = 0
        for newest, number, *values in self._reader.every(table, f"rowid, fence, {columns}"):
            fence = self._fences.get(number)
            if number == NO_FENCE and of_no_fence is not None:
                of_no_fence(newest, *values)
            elif fence is None:
                self._ledger.dead[table].append(newest)
            else:
                take(newest, fence, *values)
        return count(newest + 1)

    def _take_start(self, place: int, fence: FenceRows, first: Any, stored: Any) -> None:
        number = fence.row.number
        if fence.start is not None or not _begins(number, first, stored):
            self._blame(fence, "where its events begin is damaged")
            return
        start, _ = Start.at(place, number, first)
        fence.begin(start, 0)

    def _events(self) -> None:
        column = "payload" if self._contents else "CASE fence WHEN 0 THEN payload END"
        columns = f"rowid, fence, first, last, checksum, {column}"
        newest = 0
        for place, number, first, last, stored, payload in self._reader.every("events", columns):
            newest = place
            try:
                whole = (number != 0 and not self._contents) or checksum(payload, number, first, last) == stored
                each = weight(stored, number, first, last)
                if not whole:
                    runs = []
                elif number == 0:
                    runs = [column.tolist() for column in decode_runs(payload)]
                else:
                    runs = [[number], [first], [last - first + 1]]
            except (ValueError, TypeError, struct.error):
                whole = False
            if whole:
                self._place(place, each, zip(*runs, strict=True))
            elif number in self._fences:
                self._blame(self._fences[number], f"events {first} to {last}: damaged")
            elif number == 0:
                self._found.fatal.append(f"row {place} of events is damaged")
            else:
                self._ledger.dead["events"].append(place)
        self._ledger.event_ids = count(newest + 1)

    def _place(self, place: int, weight: int, runs: Iterable[tuple[int, int, int]]) -> None:
        """Assign the runs of a row to their fences: the number of the fence, the first sequence and the count."""
        needed = stored = 0
        for number, first, many in runs:
            stored += 1
            fence = self._fences.get(number)
            if fence is not None and first + many > fence.first:
                fence.firsts.append(first)
                fence.places.append(place)
                self._lasts[number].append(first + many - 1)
                needed += 1
        if needed:
            self._ledger.events.add(place, weight, needed, stored)
        else:
            self._ledger.dead["events"].append(place)

    def _take_inside(
        self, place: int, fence: FenceRows, sequence: Any, part: Any, parts: Any, stored: Any, payload: Any
    ) -> None:
        keys = fence.row.number, sequence, part, parts
        each = self._weight(fence, f"who was inside after event {sequence}", stored, payload, *keys)
        if each is not None:
            fence.put_inside(sequence, parts, part, place, each)

    def _take_consumer(
        self, place: int, fence: FenceRows, name: Any, acknowledged: Any, lost: Any, stored: Any
    ) -> None:
        number, consumer = fence.row.number, Consumer(name, acknowledged, lost)
        if not _whole(number, consumer, stored):
            self._blame(fence, f"the consumer {name!r} is damaged")
            return
        fence.put_consumer(consumer, place, weight(stored, number))

    def _take_feed_consumer(self, place: int, text: Any, acknowledged: Any, time: Any, stored: Any) -> None:
        try:
            found = feed_consumer_from(text, acknowledged, time, stored, place)
        except (ValueError, TypeError, AttributeError, struct.error) as error:
            self._found.fatal.append(f"row {place} of consumers of feeds is damaged ({error})")
            return
        if found.consumer.id in self._ledger.feed_consumers:
            self._found.fatal.append(f"the consumer {found.consumer.id.name!r} of a feed is stored twice")
        self._ledger.feed_consumers[found.consumer.id] = found

    def _take_delay(self, place: int, fence: FenceRows, stored: Any, payload: Any) -> None:
        try:
            whole = checksum(payload, fence.row.number) == stored
            subject, _ = decode_delay(payload)
            each = weight(stored, fence.row.number)
        except (ValueError, TypeError, struct.error):
            whole = False
        if not whole:
            self._blame(fence, "a delay is damaged")
            return
        if subject in fence.delays:
            self._blame(fence, f"the key {subject[1]!r} of the hull {subject[0]!r} has two delays")
        fence.put_delay(subject, place, each)

    def _weight(self, fence: FenceRows, what: str, stored: Any, payload: Any, *keys: Any) -> int | None:
        """The weight of a row; None if it is damaged."""
        try:
            whole = not self._contents or checksum(payload, *keys) == stored
            each = weight(stored, *keys)
        except (TypeError, struct.error):
            whole = False
        if not whole:
            self._blame(fence, f"{what}: damaged")
            return None
        return each

    def _judge(self, fence: FenceRows) -> None:
        """Determine whether it is known who is inside."""
        for sequence, rows in fence.insides.items():
            if not rows.complete:
                self._found.repairs.append(DropInside(fence.row.number, sequence))
        lasts = self._lasts[fence.row.number]
        if any(first != last + 1 for first, last in zip(fence.firsts[1:], lasts, strict=False)):
            self._judge_order(fence, lasts)
        base = fence.base
        if self._has_starts:
            self._set_aside(fence, lasts, min(fence.first, base + 1))
        fence.last = max(lasts[-1] if lasts else fence.first - 1, base)
        oldest = fence.firsts[0] if fence.firsts else fence.last + 1
        if not self._has_starts and oldest > 1:
            self._found.starts[fence.row.number] = oldest
        known = min(fence.first if self._has_starts else oldest, base + 1)
        if max(oldest, fence.first) > known:
            self._blame(fence, f"events {known} to {max(oldest, fence.first) - 1} are missing")

    def _judge_order(self, fence: FenceRows, lasts: "array[int]") -> None:
        """Bring the runs in order, and blame what is missing or there twice."""
        ordered = sorted(zip(fence.firsts, fence.places, lasts, strict=True))
        for (_, _, last), (first, _, _) in pairwise(ordered):
            if first > last + 1 and not self._has_starts:
                self._blame(fence, f"events {last + 1} to {first - 1} are missing")
            elif first <= last:
                self._blame(fence, f"events {first} to {last} are stored twice")
        fence.firsts, fence.places, lasts[:] = (array("q", column) for column in zip(*ordered, strict=True))

    def _set_aside(self, fence: FenceRows, lasts: "array[int]", expected: int) -> None:
        """Events behind a gap, or behind `expected`, are staged: the commit that makes them valid is missing."""
        gap = 0
        while gap < len(lasts) and fence.firsts[gap] <= expected:
            expected = lasts[gap] + 1
            gap += 1
        if gap == len(lasts):
            return
        text = f"events {expected} to {fence.firsts[gap] - 1} are missing"
        places, counts = np.unique(np.frombuffer(fence.places[gap:], np.int64), return_counts=True)
        needed, weights = self._ledger.events.left(places)
        if (needed != counts).any():  # such rows have no events of others
            self._blame(fence, text)
            return
        number = fence.row.number
        of_runs, firsts, ends = (np.array(column[gap:]) for column in (fence.places, fence.firsts, lasts))
        rows = []
        for place, each in zip(places.tolist(), weights.tolist(), strict=True):
            own = of_runs == place
            runs = Runs(np.full(own.sum(), number), firsts[own], ends[own] - firsts[own] + 1)
            rows.append(Staged(runs, place, each))
        self._ledger.staged[number] = sorted(rows, key=lambda row: row.first)
        self._ledger.events.release(places, counts)
        del fence.firsts[gap:], fence.places[gap:], lasts[gap:]
        self._found.gaps.append(f"{called(fence.row.name)}: {text}")
        self._found.repairs.append(DropStaged(number))

    def _blame(self, fence: FenceRows, text: str) -> None:
        self._found.fatal.append(f"{called(fence.row.name)}: {text}")


def _begins(number: int, first: int, stored: object) -> bool:
    try:
        return checksum(b"", number, first) == stored
    except (TypeError, struct.error):
        return False


def _whole(number: int, consumer: Consumer, stored: object) -> bool:
    try:
        *_, expected = consumer_values(number, consumer)
    except (ValueError, TypeError, AttributeError, struct.error):
        return False
    return expected == stored
