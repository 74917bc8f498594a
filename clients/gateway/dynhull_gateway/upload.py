"""Rows of a body on their way to a hull, in batches."""

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull_cli.counts import Counts
from dynhull_cli.reading.times import as_times
from dynhull_client import Applied, AsyncHullClient, DynhullError, InvalidRequestError

from .problems import ProblemError
from .refusals import COLUMNS, value_of
from .rows import LABELS, Found, Row, RowError
from .schemas import BadRow, Uploaded

BATCH_ROWS = 8192
SHOWN_BAD = 10
NO_POINTS = np.empty((0, 2))

KINDS = {type(None): "absent", str: "a string", int: "an integer"}
PRESENT = "there"


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
        max_bad: the number of rows that may be bad, and are left out. A bad row has its number all the same.
        conditions: `only` and `ttl` for keys to put.
    """

    def __init__(
        self,
        client: AsyncHullClient,
        name: str,
        numbering: Numbering | None,
        *,
        delete: bool,
        keep_last: bool,
        max_bad: int = 0,
        conditions: Mapping[str, Any] | None = None,
    ) -> None:
        self._client = client
        self._name = name
        self._numbering = numbering
        self._delete = delete
        self._keep_last = keep_last
        self._max_bad = max_bad
        self._conditions = {name: each for name, each in (conditions or {}).items() if each is not None}
        self._waiting: list[Row | None] = []
        self._read = 0
        self._shape: tuple[type, ...] | None = None
        self._sending: asyncio.Task[Applied | None] | None = None
        self._sent_rows = 0
        self._last: Applied | None = None
        self._counts = Counts()
        self._bad_count = 0
        self._bad: list[BadRow] = []
        self._batches = 0
        self._repeated = 0
        self.settled = 0

    @property
    def read(self) -> int:
        """The rows that were added."""
        return self._read

    async def add(self, found: Found) -> None:
        """Add rows, and send the batches that are complete; RowError if more are bad than may be."""
        self._check(found)
        self._leave_out(found.bad, self._read)
        rows = found.rows
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
            **self._counts,
            bad_rows=self._bad_count,
            bad=self._bad,
            last_sequence=None if numbering is None else numbering.first + self._read - 1,
        )

    async def settle(self) -> None:
        """Wait for the batch that is on its way."""
        sending, self._sending = self._sending, None
        if sending is None:
            return
        applied = await sending
        self.settled += self._sent_rows
        if applied is None:  # all rows were bad
            return
        self._last = applied
        self._batches += 1
        if applied.duplicate:
            self._repeated += self._sent_rows
        self._counts.add(applied)

    async def close(self) -> None:
        """Wait for the batch that is on its way, whatever becomes of it."""
        if self._sending is not None:
            with suppress(DynhullError, ValueError):
                await self.settle()

    def _check(self, found: Found) -> None:
        """Refuse rows that are not like the first one."""
        for number, row in enumerate(found.rows):
            if row is None:
                continue
            shape = type(row.key), type(row.time), type(row.expires)
            if self._shape is None:
                self._shape = shape
            if shape != self._shape:
                column = next(column for column in range(len(shape)) if shape[column] is not self._shape[column])
                here, first = (_kind(each[column], LABELS[column]) for each in (shape, self._shape))
                found.refuse(number, f"is {here}, and {first} in the first row: all rows are alike", LABELS[column])
            elif row.key is None and (row.expires is not None or row.accuracy):
                field = "expires" if row.expires is not None else "accuracy"
                found.refuse(number, "is for rows with a key", field)
        found.bad.sort(key=lambda error: error.row)

    def _leave_out(self, bad: Iterable[RowError], first: int) -> None:
        """Count and keep bad rows, numbered from `first`; RowError, with the number in the body, for one too many."""
        for error in bad:
            error.row += first
            if self._bad_count == self._max_bad:
                raise error
            self._bad_count += 1
            if len(self._bad) < SHOWN_BAD:
                self._bad.append(BadRow(row=error.row, detail=error.detail, field=error.field, value=error.value))

    def _cut(self) -> list[Row | None]:
        """The next batch: up to its length, or to a key that comes again."""
        rows = self._waiting[:BATCH_ROWS]
        if not self._keep_last:
            keys = [row.key for row in rows if row is not None and row.key is not None]
            if len(set(keys)) < len(keys):
                rows = rows[: _first_repetition(rows)]
        del self._waiting[: len(rows)]
        return rows

    async def _send(self, rows: list[Row | None]) -> None:
        await self.settle()
        self._sent_rows = len(rows)
        numbered: dict[str, Any] = {}
        if self._numbering is not None:
            number = self._numbering.first + self.settled + len(rows) - 1
            numbered = {"producer": self._numbering.producer, "sequence": number, "may_skip": True}
        self._sending = asyncio.create_task(self._apply(rows, numbered), name=f"rows for {self._name}")

    async def _apply(self, rows: list[Row | None], numbered: dict[str, Any]) -> Applied | None:
        """Apply a batch, without the rows that the server refuses, as far as these may be left out.

        Its number stays: so it is the same batch when the body is sent again.
        """
        begin = self.settled
        while True:
            places, there = _good(rows)
            if self._keep_last:
                last = {
                    place if row.key is None else row.key: at
                    for at, (place, row) in enumerate(zip(places, there, strict=True))
                }
                places, there = [places[at] for at in last.values()], [there[at] for at in last.values()]
            try:
                return await self._send_rows(there, numbered)
            except DynhullError as error:
                if error.row is None:
                    raise
                place = error.row = places[error.row]
                if not isinstance(error, InvalidRequestError) or self._bad_count == self._max_bad:
                    raise
                column = COLUMNS.get((error.field or "").removeprefix("batch."))
                self._leave_out([RowError(place, error.problem, column, value_of(error))], begin)
                rows[place] = None

    async def _send_rows(self, rows: list[Row], numbered: dict[str, Any]) -> Applied | None:
        if not rows:  # the number is taken, so that later rows leave no gap
            return await self._client.apply(self._name, insert=NO_POINTS, **numbered) if numbered else None
        keyed = rows[0].key is not None
        keys = [row.key for row in rows] if keyed else None
        if self._delete and keyed:
            return await self._client.remove(self._name, keys, **numbered)
        points = np.array([row.point for row in rows])
        if self._delete:
            return await self._client.apply(self._name, delete=points, missing="count", **numbered)
        times = _times([row.time for row in rows])
        if keyed:
            accuracies = [row.accuracy or 0.0 for row in rows]
            columns: dict[str, Any] = {
                "expire_times": _times([row.expires for row in rows]),
                "accuracies": accuracies if any(accuracies) else None,
            }
            return await self._client.put(self._name, keys, points, times, **columns, **self._conditions, **numbered)
        if self._conditions:
            raise ValueError(f"{' and '.join(self._conditions)} are for rows with keys to put")
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


def _first_repetition(rows: Sequence[Row | None]) -> int:
    seen: set[str | int] = set()
    for number, row in enumerate(rows):
        if row is None or row.key is None:
            continue
        if row.key in seen:
            return number
        seen.add(row.key)
    return len(rows)


def _good(rows: Sequence[Row | None]) -> tuple[list[int], list[Row]]:
    """The places of the rows that are not bad, and these rows."""
    good = [row for row in rows if row is not None]
    if len(good) == len(rows):
        return list(range(len(rows))), good
    return [place for place, row in enumerate(rows) if row is not None], good


def _times(times: list[int | None]) -> npt.NDArray[np.datetime64] | None:
    """The times of rows that are alike."""
    return None if times[0] is None else as_times(times)


def _kind(kind: type, column: str) -> str:
    """A value of a column in messages."""
    return PRESENT if kind is int and column != "key" else KINDS[kind]
