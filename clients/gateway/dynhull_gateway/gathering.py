"""Small requests of many callers, gathered into calls.

While calls about a hull are on their way, the requests of the same kind for this hull that arrive meanwhile wait and
then go together: many callers cost the server few calls, and a single one waits for nobody. Two calls are on their way
at a time, so that one is read and answered while the other is carried out. Requests that are not answered have no
order, as if each had a connection of its own.
"""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Collection, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from dynhull_client import Applied, AsyncHullClient, DynhullError, OutcomeUnknownError, UnavailableError

from .changes import apply, encoded
from .problems import ProblemError
from .schemas import Batch, Key, Located, Points

MOST_ROWS = 8192
SMALL_ROWS = 1024
IN_FLIGHT = 2

GATHERED = ({"insert"}, {"insert", "times"}, {"keys", "points"}, {"keys", "points", "times"})


@dataclass(slots=True)
class _Waiting:
    """A request that waits. `kind`: those of the same kind can go together, unless they have a key in common."""

    content: Any
    kind: Hashable
    rows: int
    keys: Collection[Key]
    answer: asyncio.Future[bytes]


_Ask = Callable[[Sequence[_Waiting]], Awaitable[list[bytes]]]
"""Carries out some requests as one call: the answer to each."""


@dataclass(slots=True)
class _Lane:
    """What one caller asks of one hull."""

    waiting: deque[_Waiting] = field(default_factory=deque)
    tasks: set[asyncio.Task[None] | None] = field(default_factory=set)


class Gatherer:
    """Carries out requests, several together where that changes nothing but the number of revisions."""

    def __init__(self) -> None:
        self._lanes: dict[Hashable, _Lane] = {}

    async def apply(self, client: AsyncHullClient, token: str | None, name: str, batch: Batch) -> bytes:
        """The effect of a batch, as JSON."""
        kind = _kind(batch)
        if kind is None:
            return encoded(await apply(client, name, batch), 1)
        rows = len(batch.insert or batch.keys or ())
        return await self._gather(
            (token, name, apply), partial(_apply, client, name), batch, kind, rows, batch.keys or ()
        )

    async def locate(self, client: AsyncHullClient, token: str | None, name: str, points: Points) -> bytes:
        """The sides of points, as JSON."""
        return await self._gather((token, name, Located), partial(_locate, client, name), points, None, len(points))

    async def _gather(
        self, to: Hashable, ask: _Ask, content: Any, kind: Hashable, rows: int, keys: Collection[Key] = ()
    ) -> bytes:
        lane = self._lanes.setdefault(to, _Lane())
        waiting = _Waiting(content, kind, rows, keys, asyncio.get_running_loop().create_future())
        lane.waiting.append(waiting)
        if len(lane.tasks) < IN_FLIGHT:
            task = asyncio.create_task(self._run(to, ask, lane), name="gathered requests")
            lane.tasks.add(task)
        return await waiting.answer

    async def _run(self, to: Hashable, ask: _Ask, lane: _Lane) -> None:
        """Ask what waits until nothing does."""
        together: list[_Waiting] = []
        try:
            while lane.waiting:
                together = _next(lane.waiting)
                await _send(ask, together)
        finally:
            # Not when the task is done, a turn later: a request that arrives in between would wait for an ended task.
            lane.tasks.discard(asyncio.current_task())
            if not lane.tasks:
                self._lanes.pop(to)
                together.extend(lane.waiting)
            for each in together:  # if the task was cancelled: nobody else would answer them
                _fail(each, ProblemError(503, "the gateway stops", "DRAINING"))


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


def _next(waiting: deque[_Waiting]) -> list[_Waiting]:
    """The longest run of requests that can go together: of one kind, and no key twice."""
    together = [waiting.popleft()]
    rows = together[0].rows
    keys: set[Key] = set(together[0].keys)
    while waiting and waiting[0].kind == together[0].kind and rows + waiting[0].rows <= MOST_ROWS:
        more = waiting[0].keys
        if more:
            if not keys.isdisjoint(more):
                break
            keys.update(more)
        rows += waiting[0].rows
        together.append(waiting.popleft())
    return together


async def _send(ask: _Ask, together: Sequence[_Waiting]) -> None:
    """Ask together and answer each; after a refusal, each half on its own, so that each has its own error."""
    try:
        answers = await ask(together)
    except Exception as error:
        unlike = not isinstance(error, DynhullError | ValueError | TypeError)
        uncertain = isinstance(error, DynhullError) and (
            not error.reason or isinstance(error, OutcomeUnknownError | UnavailableError)
        )
        if len(together) == 1 or uncertain or unlike:
            for each in together:
                _fail(each, error)
            return
        middle = len(together) // 2
        await _send(ask, together[:middle])
        await _send(ask, together[middle:])
        return
    for each, answer in zip(together, answers, strict=True):
        if not each.answer.done():
            each.answer.set_result(answer)


def _fail(waiting: _Waiting, error: Exception) -> None:
    if not waiting.answer.done():
        waiting.answer.set_exception(error)


async def _apply(client: AsyncHullClient, name: str, together: Sequence[_Waiting]) -> list[bytes]:
    applied = await apply(client, name, _joined([each.content for each in together]))
    if not applied.held:
        return [encoded(applied, len(together))] * len(together)
    answers, first = [], 0
    for each in together:
        answers.append(encoded(_with_rows_from(applied, first, first + each.rows), len(together)))
        first += each.rows
    return answers


def _with_rows_from(applied: Applied, first: int, end: int) -> Applied:
    """The effect for the request that brought the rows from `first` to before `end`."""
    return replace(applied, held_rows=tuple(row - first for row in applied.held_rows if first <= row < end))


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


async def _locate(client: AsyncHullClient, name: str, together: Sequence[_Waiting]) -> list[bytes]:
    located = await client.locate(name, [point for each in together for point in each.content])
    revision, sides = located.revision, located.sides.tolist()
    answers, first = [], 0
    # All but the sides is the same, and a model of each answer would take longer than all else that is done for it.
    like = Located.model_construct(revision=revision, sides=[], keys_revision=None).model_dump_json()
    before, after = like.split("[]")
    for each in together:
        own = ",".join(map(str, sides[first : first + each.rows]))
        answers.append(f"{before}[{own}]{after}\n".encode())
        first += each.rows
    return answers
