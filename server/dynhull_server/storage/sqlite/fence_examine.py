"""Examination of the rows of fences: are all present and intact?"""

import sqlite3
import struct
from collections import Counter
from dataclasses import dataclass, field
from itertools import count
from typing import TYPE_CHECKING, Any

from ...state.fences.records import Consumer
from .encoding import checksum, weight
from .event_rows import decode_delay
from .fence_ledger import DropInside, FenceRows, FenceStep
from .fence_rows import consumer_values, found_fences

if TYPE_CHECKING:
    from .ledger import Ledger


@dataclass(slots=True)
class FoundFences:
    """What there is of fences.

    Attributes:
        rows, sum: the number of all rows, and the sum of their weights.
        next_number: a number greater than that of any fence found.
        fatal: damage that prevents serving the database.
        repairs: steps that drop unfinished rows.
    """

    rows: int = 0
    sum: int = 0
    next_number: int = 1
    fatal: list[str] = field(default_factory=list)
    repairs: list[FenceStep] = field(default_factory=list)


class FenceExamination:
    """Reads every row of the fences, and fills the ledger. Without `contents`, payloads are not read.

    Args:
        connection: a connection with an open transaction.
        ledger: receives the rows.
        contents: whether to read payloads.
        delays: whether the format has delays.
    """

    def __init__(self, connection: sqlite3.Connection, ledger: "Ledger", *, contents: bool, delays: bool) -> None:
        self._connection = connection
        self._ledger = ledger
        self._fences = ledger.fences
        self._contents = contents
        self._has_delays = delays
        self._found = FoundFences()

    def run(self) -> FoundFences:
        """Read everything once."""
        found = self._found
        self._fence_rows()
        self._events()
        self._insides()
        self._consumers()
        if self._has_delays:
            self._delays()
        for fence in self._fences.values():
            self._judge(fence)
        found.rows = sum(fence.count for fence in self._fences.values())
        found.sum = sum(fence.sum for fence in self._fences.values())
        found.next_number = max((number + 1 for number in self._fences), default=1)
        names = Counter(fence.row.name for fence in self._fences.values())
        found.fatal += [f"{times} fences have the name {name!r}" for name, times in names.items() if times > 1]
        return found

    def _fence_rows(self) -> None:
        for each in found_fences(self._connection):
            if each.row is None:
                self._found.fatal.append(f"the row of fence {each.number}, {each.name!r}, is damaged")
                continue
            found = weight(each.checksum, each.number)
            self._fences[each.number] = FenceRows(each.row, found, found)

    def _events(self) -> None:
        column = "payload" if self._contents else "NULL"
        query = f"SELECT rowid, fence, first, last, checksum, {column} FROM events ORDER BY rowid"  # noqa: S608  (ours)
        newest = 0
        for place, number, first, last, stored, payload in self._connection.execute(query):
            newest = place
            fence = self._fences.get(number)
            if fence is None:
                self._ledger.dead["events"].append(place)
                continue
            each = self._weight(fence, f"events {first} to {last}", stored, payload, number, first, last)
            if each is None:
                continue
            if fence.firsts and first != fence.last + 1:
                self._blame(fence, f"events {fence.last + 1} to {first - 1} are missing")
            fence.append(first, last, place, each)
        self._ledger.event_ids = count(newest + 1)

    def _insides(self) -> None:
        column = "payload" if self._contents else "NULL"
        query = f"SELECT rowid, fence, sequence, part, parts, checksum, {column} FROM insides ORDER BY rowid"  # noqa: S608  (ours)
        newest = 0
        for place, number, sequence, part, parts, stored, payload in self._connection.execute(query):
            newest = place
            fence = self._fences.get(number)
            if fence is None:
                self._ledger.dead["insides"].append(place)
                continue
            keys = number, sequence, part, parts
            each = self._weight(fence, f"who was inside after event {sequence}", stored, payload, *keys)
            if each is not None:
                fence.put_inside(sequence, parts, part, place, each)
        self._ledger.inside_ids = count(newest + 1)

    def _consumers(self) -> None:
        query = "SELECT rowid, fence, name, acknowledged, lost, checksum FROM consumers ORDER BY rowid"
        newest = 0
        for place, number, name, acknowledged, lost, stored in self._connection.execute(query):
            newest = place
            fence = self._fences.get(number)
            if fence is None:
                self._ledger.dead["consumers"].append(place)
                continue
            consumer = Consumer(name, acknowledged, lost)
            if not _whole(number, consumer, stored):
                self._blame(fence, f"the consumer {name!r} is damaged")
                continue
            fence.put_consumer(consumer, place, weight(stored, number))
        self._ledger.consumer_ids = count(newest + 1)

    def _delays(self) -> None:
        newest = 0
        query = "SELECT rowid, fence, checksum, payload FROM delays ORDER BY rowid"
        for place, number, stored, payload in self._connection.execute(query):
            newest = place
            fence = self._fences.get(number)
            if fence is None:
                self._ledger.dead["delays"].append(place)
                continue
            try:
                whole = checksum(payload, number) == stored
                subject, _ = decode_delay(payload)
                each = weight(stored, number)
            except (ValueError, TypeError, struct.error):
                whole = False
            if not whole:
                self._blame(fence, "a delay is damaged")
                continue
            if subject in fence.delays:
                self._blame(fence, f"the key {subject[1]!r} of the hull {subject[0]!r} has two delays")
            fence.put_delay(subject, place, each)
        self._ledger.delay_ids = count(newest + 1)

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
        base = fence.base
        if fence.firsts and fence.firsts[0] > base + 1:
            self._blame(fence, f"events {base + 1} to {fence.firsts[0] - 1} are missing")
        fence.last = max(fence.last, base)

    def _blame(self, fence: FenceRows, text: str) -> None:
        self._found.fatal.append(f"fence {fence.row.name!r}: {text}")


def _whole(number: int, consumer: Consumer, stored: object) -> bool:
    try:
        *_, expected = consumer_values(number, consumer)
    except (TypeError, AttributeError, struct.error):
        return False
    return expected == stored
