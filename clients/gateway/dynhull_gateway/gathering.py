"""Small changes of many requests, gathered into batches.

While batches of a hull are on their way, the requests for this hull that arrive meanwhile wait and then go together:
many callers cost the server few batches, and a single one waits for nobody. Two are on their way at a time, so that one
is read and answered while the other is applied. Requests that are not answered have no order, as if each had a
connection of its own.
"""

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dynhull_client import Applied, AsyncHullClient, DynhullError, OutcomeUnknownError, UnavailableError

from .changes import apply, encoded
from .problems import ProblemError
from .schemas import Batch, Key

MOST_ROWS = 8192
SMALL_ROWS = 1024
IN_FLIGHT = 2

GATHERED = ({"insert"}, {"insert", "times"}, {"keys", "points"}, {"keys", "points", "times"})


@dataclass(slots=True)
class _Waiting:
    """A batch that waits. `kind`: batches of the same kind can go together."""

    batch: Batch
    kind: frozenset[object]
    rows: int
    answer: asyncio.Future[bytes]


@dataclass(slots=True)
class _Lane:
    """What one caller sends to one hull."""

    waiting: deque[_Waiting] = field(default_factory=deque)
    tasks: set[asyncio.Task[None]] = field(default_factory=set)


def _kind(batch: Batch) -> frozenset[object] | None:
    """What distinguishes batches that can go together; None for one that goes alone."""
    given = {name for name in batch.model_fields_set if getattr(batch, name) is not None}
    rows = batch.insert if batch.keys is None else batch.keys
    if given not in GATHERED or not rows or len(rows) > SMALL_ROWS:
        return None
    count = len(rows)
    if (batch.points is not None and len(batch.points) != count) or (
        batch.times is not None and len(batch.times) != count
    ):
        return None  # the server's error is about this batch alone
    return frozenset((*given, None if batch.keys is None else type(batch.keys[0])))


class Gatherer:
    """Applies batches, several together where that changes nothing but the number of revisions."""

    def __init__(self) -> None:
        self._lanes: dict[tuple[str | None, str], _Lane] = {}

    async def apply(self, client: AsyncHullClient, token: str | None, name: str, batch: Batch) -> bytes:
        """The effect of a batch, as JSON."""
        kind = _kind(batch)
        if kind is None:
            return encoded(await apply(client, name, batch), 1)
        lane = self._lanes.setdefault((token, name), _Lane())
        rows = len(batch.insert or batch.keys or ())
        waiting = _Waiting(batch, kind, rows, asyncio.get_running_loop().create_future())
        lane.waiting.append(waiting)
        if len(lane.tasks) < IN_FLIGHT:
            task = asyncio.create_task(self._run(client, token, name, lane), name=f"gathering for {name}")
            lane.tasks.add(task)
            task.add_done_callback(lane.tasks.discard)
        return await waiting.answer

    async def _run(self, client: AsyncHullClient, token: str | None, name: str, lane: _Lane) -> None:
        """Send what waits until nothing does."""
        together: list[_Waiting] = []
        try:
            while lane.waiting:
                together = _next(lane.waiting)
                await _send(client, name, together)
        finally:
            for each in together:  # if the task was cancelled: nobody else would answer them
                _fail(each, ProblemError(503, "the gateway stops", "DRAINING"))
            if not lane.waiting and len(lane.tasks) == 1:
                self._lanes.pop((token, name), None)


def _next(waiting: deque[_Waiting]) -> list[_Waiting]:
    """The longest run of batches that can go together: of one kind, and no key twice."""
    together = [waiting.popleft()]
    rows = together[0].rows
    keys: set[Key] = set(together[0].batch.keys or ())
    while waiting and waiting[0].kind == together[0].kind and rows + waiting[0].rows <= MOST_ROWS:
        more = waiting[0].batch.keys or ()
        if not keys.isdisjoint(more):
            break
        keys.update(more)
        rows += waiting[0].rows
        together.append(waiting.popleft())
    return together


async def _send(client: AsyncHullClient, name: str, together: Sequence[_Waiting]) -> None:
    """Apply batches together and answer them; after a refusal, each half on its own, so that each has its own error."""
    try:
        applied = await apply(client, name, _joined([each.batch for each in together]))
    except (DynhullError, ValueError, TypeError) as error:
        uncertain = isinstance(error, DynhullError) and (
            not error.reason or isinstance(error, OutcomeUnknownError | UnavailableError)
        )
        if len(together) == 1 or uncertain:
            for each in together:
                _fail(each, error)
            return
        middle = len(together) // 2
        await _send(client, name, together[:middle])
        await _send(client, name, together[middle:])
        return
    first = 0
    answer = encoded(applied, len(together))
    for each in together:
        if applied.held:  # each has rows of its own
            answer = encoded(_with_rows_from(applied, first, first + each.rows), len(together))
        if not each.answer.done():
            each.answer.set_result(answer)
        first += each.rows


def _with_rows_from(applied: Applied, first: int, end: int) -> Applied:
    """The effect for the request that brought the rows from `first` to before `end`."""
    return replace(applied, held_rows=tuple(row - first for row in applied.held_rows if first <= row < end))


def _fail(waiting: _Waiting, error: Exception) -> None:
    if not waiting.answer.done():
        waiting.answer.set_exception(error)


def _joined(batches: Sequence[Batch]) -> Batch:
    """One batch with the rows of all these, which are of one kind."""
    if len(batches) == 1:
        return batches[0]
    rows: dict[str, Any] = {
        name: [row for batch in batches for row in getattr(batch, name)]
        for name in batches[0].model_fields_set
        if getattr(batches[0], name) is not None
    }
    return Batch.model_construct(set(rows), **rows)
