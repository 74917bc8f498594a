"""Rows of a body on their way to a hull, in batches."""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from dynhull_client import Applied, AsyncHullClient, DynhullError
from dynhull_surface.counts import COUNTS

from .problems import ProblemError
from .rows import KEY_AND_TIME, Row, RowError
from .schemas import Uploaded

BATCH_ROWS = 8192

KINDS = {type(None): "absent", str: "a string", int: "an integer", datetime: "there"}


@dataclass(frozen=True, slots=True)
class Numbering:
    """The numbers of rows: that of the first row, and the last one of the producer that was applied."""

    producer: str
    first: int
    applied: int


class Upload:
    """Sends rows in batches, one after the other; the next is read while one is on its way.

    Where a batch ends depends on the rows after the one before alone, and its number is that of its last row. So a body
    that is sent again has the same batches, also if it is continued after the last number that was applied, and the
    hull applies each once.

    Args:
        client: the caller's client.
        name: the hull.
        numbering: the numbers of the rows; None for none.
        delete: whether to delete the points or keys.
        keep_last: whether only the last of several positions of a key in a batch is put; otherwise a key that comes
            again begins a batch.
    """

    def __init__(
        self, client: AsyncHullClient, name: str, numbering: Numbering | None, *, delete: bool, keep_last: bool
    ) -> None:
        self._client = client
        self._name = name
        self._numbering = numbering
        self._delete = delete
        self._keep_last = keep_last
        self._waiting: list[Row] = []
        self._read = 0
        self._shape: tuple[type, type] | None = None
        self._sending: asyncio.Task[Applied] | None = None
        self._sent_rows = 0
        self._last: Applied | None = None
        self._sums = dict.fromkeys(COUNTS, 0)
        self._batches = 0
        self._repeated = 0
        self.settled = 0

    @property
    def read(self) -> int:
        """The rows that were added."""
        return self._read

    async def add(self, rows: Sequence[Row]) -> None:
        """Add rows, and send the batches that are complete."""
        self._check(rows)
        before = 0 if self._numbering is None else self._numbering.applied - self._numbering.first + 1 - self._read
        self._read += len(rows)
        if before > 0:  # applied by an earlier request
            known = min(before, len(rows))
            self._repeated += known
            self.settled += known
            rows = rows[known:]
        self._waiting += rows
        while len(self._waiting) >= BATCH_ROWS:
            await self._send(self._cut())

    async def finish(self) -> Uploaded:
        """Send what is left, and return the effect of all."""
        while self._waiting:
            await self._send(self._cut())
        await self.settle()
        last, numbering = self._last, self._numbering
        return Uploaded(
            rows=self._read,
            repeated=self._repeated,
            batches=self._batches,
            revision=None if last is None else last.revision,
            points=None if last is None else last.points,
            **self._sums,
            last_sequence=None if numbering is None else numbering.first + self._read - 1,
        )

    async def settle(self) -> None:
        """Wait for the batch that is on its way."""
        sending, self._sending = self._sending, None
        if sending is None:
            return
        applied = await sending
        self.settled += self._sent_rows
        self._last = applied
        self._batches += 1
        if applied.duplicate:
            self._repeated += self._sent_rows
        for name in COUNTS:
            self._sums[name] += getattr(applied, name)

    async def close(self) -> None:
        """Wait for the batch that is on its way, whatever becomes of it."""
        if self._sending is not None:
            with suppress(DynhullError, ValueError):
                await self.settle()

    def _check(self, rows: Sequence[Row]) -> None:
        """Raise RowError if the rows are not all alike."""
        for number, row in enumerate(rows):
            shape = type(row.key), type(row.time)
            if self._shape is None:
                self._shape = shape
            if shape != self._shape:
                column = 0 if shape[0] is not self._shape[0] else 1
                here, first = KINDS[shape[column]], KINDS[self._shape[column]]
                detail = f"is {here}, and {first} in the first row: all rows are alike"
                raise RowError(number, detail, KEY_AND_TIME[column])

    def _cut(self) -> list[Row]:
        """The next batch: up to its length, or to a key that comes again."""
        rows = self._waiting[:BATCH_ROWS]
        if rows[0].key is not None and not self._keep_last:
            keys = {row.key for row in rows}
            if len(keys) < len(rows):
                rows = rows[: _first_repetition(rows)]
        del self._waiting[: len(rows)]
        return rows

    async def _send(self, rows: list[Row]) -> None:
        await self.settle()
        self._sent_rows = len(rows)
        numbered: dict[str, Any] = {}
        if self._numbering is not None:
            number = self._numbering.first + self.settled + len(rows) - 1
            numbered = {"producer": self._numbering.producer, "sequence": number, "may_skip": True}
        self._sending = asyncio.create_task(self._apply(rows, numbered), name=f"rows for {self._name}")

    async def _apply(self, rows: list[Row], numbered: dict[str, Any]) -> Applied:
        keyed = rows[0].key is not None
        if not (keyed and self._keep_last):
            return await self._send_rows(rows, numbered)
        last = list({row.key: number for number, row in enumerate(rows)}.values())
        try:
            return await self._send_rows([rows[number] for number in last], numbered)
        except DynhullError as error:
            error.row = None if error.row is None else last[error.row]
            raise

    async def _send_rows(self, rows: list[Row], numbered: dict[str, Any]) -> Applied:
        keyed = rows[0].key is not None
        keys = [row.key for row in rows] if keyed else None
        if self._delete and keyed:
            return await self._client.remove(self._name, keys, **numbered)
        points = np.array([row.point for row in rows])
        times = None if rows[0].time is None else [row.time for row in rows]
        if self._delete:
            return await self._client.apply(self._name, delete=points, missing="count", **numbered)
        if keyed:
            return await self._client.put(self._name, keys, points, times, **numbered)
        return await self._client.apply(self._name, insert=points, times=times, **numbered)


async def numbering(client: AsyncHullClient, name: str, producer: str, first: int, *, may_skip: bool) -> Numbering:
    """The numbers of a body's rows; ProblemError if they leave a gap after the last that was applied."""
    applied = await client.last_sequence(name, producer)
    if first > applied + 1 and not may_skip:
        detail, reason = f"the producer {producer!r} continues with {applied + 1}, not with {first}", "SEQUENCE_GAP"
        if (await client.get_hull(name)).info.restored:
            detail, reason = f"the hull {name!r} was restored from a backup: {detail}", "RESTORED"
        raise ProblemError(409, detail, reason, field="Idempotency-Key", expected=applied + 1)
    return Numbering(producer, first, applied)


def _first_repetition(rows: Sequence[Row]) -> int:
    seen: set[str | int | None] = set()
    for number, row in enumerate(rows):
        if row.key in seen:
            return number
        seen.add(row.key)
    return len(rows)
