"""Sends the rows of a load in numbered batches, each exactly once, and sets those aside that the server refuses."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from dynhull_client import Applied, DynhullError, HullClient, InvalidRequestError, Writer

from ..counts import Counts
from ..keyed_rows import known_hull
from ..reading.times import as_times
from .bad_rows import BadRows
from .chunks import Rows
from .refusals import TOO_FAR, refused_rows

if TYPE_CHECKING:
    from concurrent.futures import Future


class LoadedBeforeError(ValueError):
    """The hull has batches of this load already."""


class _RefusedError(Exception):
    """The first batch that is not acknowledged has been refused for a row."""

    def __init__(self, error: InvalidRequestError) -> None:
        super().__init__(str(error))
        self.error = error


@dataclass(slots=True)
class _Sent:
    """A batch that is not acknowledged; without an outcome, it is to be sent."""

    number: int
    rows: Rows
    outcome: "Future[Applied] | None" = None


class Sending:
    """Sends batches to a hull.

    A batch keeps its number when rows of it are left out: the number says which rows of the file it is about, so that
    an interrupted load is continued after the last number that the hull has. The writer ends with a refused batch,
    and the next one goes on with what is left of it: rows are applied in the order of the file.

    Args:
        client: the client.
        name: the hull.
        producer: the name of the load; None for one that cannot be continued.
        patience: seconds to wait for a server that does not answer.
        resume: whether batches that the hull has already are passed over; otherwise LoadedBeforeError if it has some.
        bad: takes the rows that are refused.
        conditions: which keys are put, and when they leave: arguments of a put.

    Attributes:
        counts: what became of the rows.
        points: the number of points in the hull after the last batch; None before.
        rows: the number of rows that were not refused.
        known: the number of the last batch that the hull had already.
    """

    def __init__(
        self,
        client: HullClient,
        name: str,
        producer: str | None,
        patience: float,
        *,
        resume: bool,
        bad: BadRows,
        conditions: Mapping[str, Any],
    ) -> None:
        self.counts = Counts()
        self.points: int | None = None
        self.rows = 0
        self.known = 0
        self._client = client
        self._name = name
        self._producer = f"load-{uuid4().hex}" if producer is None else producer
        self._patience = patience
        self._resume = resume
        self._bad = bad
        self._conditions = conditions
        self._uid = ""
        self._begun = False  # whether the first writer has been opened
        self._waiting: deque[_Sent] = deque()

    def run(self, batches: Iterable[Rows], read: Callable[[int], None]) -> None:
        """Send batches, numbered from 1; `read` is called with the number of rows of each.

        Raises:
            LoadedBeforeError: see above.
            ValueError: too many rows are bad.
            DynhullError: the server refuses a batch as a whole, or does not answer.
        """
        numbered = enumerate(batches, start=1)
        while True:
            writer = self._client.writer(
                self._name,
                producer=self._producer,
                batch_points=1,  # each put is a batch
                stop_on_error=True,
                patience=self._patience,
                uid=self._uid,
            )
            try:
                with writer:
                    self._send(writer, numbered, read)
            except _RefusedError as refused:
                self._set_aside(refused.error)
            else:
                return

    def _send(self, writer: Writer, numbered: Iterator[tuple[int, Rows]], read: Callable[[int], None]) -> None:
        if not self._begun:
            self._begun, self.known = True, writer.sequence
            if self.known and not self._resume:
                raise LoadedBeforeError(
                    "loaded before, at least in part: --resume loads what is missing, --again all points once more, "
                    "--replace deletes the hull first"
                )
        elif writer.sequence != self._waiting[0].number - 1:
            raise LoadedBeforeError(f"another load has the name {self._producer} and goes on: --resume after its end")
        self._uid = writer.uid
        try:
            for index, each in enumerate(self._waiting):
                each.outcome = self._put(writer, each.rows)
                if not index:
                    each.outcome.result()  # another row of it may be refused
            for number, rows in numbered:
                read(len(rows))
                if number > self.known:
                    self._waiting.append(_Sent(number, rows))
                    self._waiting[-1].outcome = self._put(writer, rows)
                    self._settle()
            writer.flush()
        except DynhullError as error:
            self._settle(wait=True)
            if self._waiting and isinstance(error, InvalidRequestError) and error.row is not None:
                raise _RefusedError(error) from None
            raise
        self._settle(wait=True)

    def _settle(self, *, wait: bool = False) -> None:
        """Count the batches that are acknowledged; with `wait`, up to one that is not applied."""
        waiting = self._waiting
        while waiting and (outcome := waiting[0].outcome) is not None and (wait or outcome.done()):
            if outcome.exception() is not None:
                return
            applied = outcome.result()
            self.rows += len(waiting.popleft().rows)
            self.counts.add(applied)
            self.points = applied.points

    def _set_aside(self, error: InvalidRequestError) -> None:
        """Take the rows at fault out of the refused batch."""
        first = self._waiting[0]
        info = known_hull(self._client, self._name) if TOO_FAR in str(error) else None
        refused = refused_rows(first.rows, error, None if info is None else info.center)
        self._bad.add([first.rows.bad(row, refused[row]) for row in sorted(refused)])
        first.rows = first.rows.without(refused)
        for each in self._waiting:
            each.outcome = None

    def _put(self, writer: Writer, rows: Rows) -> "Future[Applied]":
        if not len(rows):  # its number is taken all the same
            outcome = writer.put(insert=rows.points)
            writer.flush()
            return outcome
        times = None if rows.times is None else as_times(rows.times)
        if rows.keys is None:
            return writer.put(insert=rows.points, times=times)
        expires = None if rows.expires is None else as_times(rows.expires)
        accuracies = None if rows.accuracies is None else [each or 0.0 for each in rows.accuracies]
        columns: dict[str, Any] = {"times": times, "expire_times": expires, "accuracies": accuracies}
        return writer.put(keys=rows.keys, points=rows.points, **columns, **self._conditions)
