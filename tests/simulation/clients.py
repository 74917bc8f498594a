"""Clients: each does one operation of its plan after the other, and compares every answer with the model.

They are coroutines that await nothing but the server, so that either layer can run them; a caller disconnects by a
CancelledError.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from dynhull.arrays import Points
from dynhull_server.engine.batch_stream import BatchStream
from dynhull_server.state.batch import Applied, Batch
from dynhull_server.state.errors import (
    HullExistsError,
    HullNotFoundError,
    HullReplacedError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    PointMissingError,
    RevisionForgottenError,
    SequenceGapError,
    StoppingError,
)
from dynhull_server.state.events import WriteBatch

from .model import Asked, Content, Model
from .plan import Operation

NO_POINTS = np.empty((0, 2))


class Server(Protocol):
    """What clients ask of a server, in either layer."""

    async def create(self, name: str, max_points: int) -> str:
        """Make a hull; its uid."""

    async def delete(self, name: str) -> None:
        """Remove a hull."""

    async def delete_at_once(self, name: str, times: int) -> None:
        """Remove a hull repeatedly, and ignore the answers."""

    async def apply(self, name: str, write: WriteBatch, *, create: bool) -> Applied:
        """Apply a batch."""

    def stream(self, name: str, *, create: bool) -> BatchStream:
        """For many batches."""

    async def news(self, stream: BatchStream) -> None:
        """Wait until the stream has an answer."""

    async def vertices(self, name: str, rows: int) -> tuple[str, int, Points]:
        """The uid, a revision and its vertices."""

    async def recall(self, name: str, uid: str, revision: int) -> Points | None:
        """The vertices at an earlier revision."""

    async def last(self, name: str, producer: str) -> int:
        """The last number of a producer."""

    async def special(self, client: "Client", op: Operation) -> None:
        """What one layer has and the other has not."""


class TornBatch:
    """A batch for which memory runs out when its inserts are looked at for the nth time."""

    def __init__(self, batch: Batch, nth: int) -> None:
        self._batch, self._left = batch, nth
        self.deletes, self.moves, self.count_missing, self.growth = batch.deletes, 0, batch.count_missing, batch.growth

    @property
    def inserts(self) -> Points:
        self._left -= 1
        if not self._left:
            raise MemoryError("no memory, as planned")
        return self._batch.inserts


class Client:
    """One client of the server.

    Args:
        number: which one.
        server: the server.
        model: judges the answers.

    Attributes:
        producer: its name as a writer that numbers its batches.
        calm: whether nothing may be refused but for a limit.
        seen: what it has read of each hull.
    """

    def __init__(self, number: int, server: Server, model: Model) -> None:
        self.producer = f"p{number}"
        self.server = server
        self.model = model
        self.calm = False
        self.seen: dict[str, list[tuple[str, int, Content]]] = {}
        self._next: dict[str, int] = {}

    async def do(self, op: Operation) -> None:
        """Carry out one operation."""
        match op["do"]:
            case "create":
                await self.create(op["name"], op["max_points"])
            case "delete" if "crowd" in op:
                self.model.ask(op["name"], removes=True)
                await self.server.delete_at_once(op["name"], op["crowd"])
            case "delete":
                await self.delete(op["name"])
            case "write":
                await self.write(op)
            case "stream":
                await self.stream(op)
            case "read":
                await self.read(op["name"], op["rows"])
            case "recall":
                await self.recall(op)
            case "last":
                await self.last(op["name"])
            case _:
                await self.server.special(self, op)

    # Hulls

    async def create(self, name: str, max_points: int = 0) -> None:
        asked = self.model.ask(name, makes=True)
        try:
            uid = await self.server.create(name, max_points)
        except Exception as error:
            self.refused(asked, error, (HullExistsError, LimitExceededError))
        else:
            self.model.created(asked, uid)

    async def delete(self, name: str) -> None:
        asked = self.model.ask(name, removes=True)
        try:
            await self.server.delete(name)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError,))
        else:
            self.model.deleted(asked)

    # Batches

    async def write(self, op: Operation) -> None:
        name, producer = op["name"], self._producer(op)
        sequence = self._next.get(name + producer, 1) if producer else 0
        attempt, write = self._batch(op, producer, sequence)
        asked = self.model.ask(name, makes=op["create"])
        try:
            applied = await self.server.apply(name, write, create=op["create"])
        except Exception as error:
            self._batch_refused(op, asked, error, [attempt])
        else:
            self._applied(asked, attempt, applied, producer, sequence)

    async def stream(self, op: Operation) -> None:
        name, producer = op["name"], self._producer(op)
        opened = self.model.ask(name)
        try:
            stream = self.server.stream(name, create=op["create"])
        except HullNotFoundError:
            self.model.not_found(opened)
            return
        first = self._next.get(name + producer, 1) if producer else 0
        under_way: deque[tuple[Asked, int, int]] = deque()
        try:
            for i in range(op["batches"]):
                sequence = first + i if producer else 0
                attempt, write = self._batch(op, producer, sequence)
                under_way.append((self.model.ask(name, makes=op["create"]), attempt, sequence))
                stream.write(write)
                while len(under_way) >= op["window"] and self._take(op, opened, stream, under_way, producer):
                    await self.server.news(stream)
                if stream.refusal is not None and len(under_way) >= op["window"]:
                    return  # a smaller window goes on: what it writes must not be applied
            while under_way and self._take(op, opened, stream, under_way, producer):
                await self.server.news(stream)
        finally:
            stream.close()

    def _take(
        self,
        op: Operation,
        opened: Asked,
        stream: BatchStream,
        under_way: deque[tuple[Asked, int, int]],
        producer: str,
    ) -> bool:
        """Take the answers there are. Whether there are none, and some to come."""
        news = bool(stream.applied)
        while stream.applied:
            numbered, applied = stream.applied.popleft()
            asked, attempt, sequence = under_way.popleft()
            if numbered != sequence:
                raise self.model.finds(f"batch {sequence} got the answer to {numbered}")
            self._applied(asked, attempt, applied, producer, sequence)
        if stream.refusal is None:
            return not news
        if not under_way:
            raise self.model.finds("a stream was refused after all its batches had been applied")
        self._batch_refused(op, opened, stream.refusal, [attempt for _, attempt, _ in under_way])
        return False

    def _producer(self, op: Operation) -> str:
        if not op["numbered"]:
            return ""
        return "shared" if op.get("shared") else self.producer

    def _batch(self, op: Operation, producer: str, sequence: int) -> tuple[int, WriteBatch]:
        attempt = self.model.attempt()
        deletes = NO_POINTS
        seen = self.seen.get(op["name"])
        if op.get("delete") == "nowhere" and attempt % 3:  # else nothing that is right would follow a refused batch
            deletes = np.array([[-1.0, 1.0]])
        elif "delete" in op and seen and seen[-1][2]:
            x = float(seen[-1][2][0])
            deletes = np.array([[x, x * x]])
        x = float(attempt)
        batch: Any = Batch(np.array([[x, x * x]]), deletes, 0, op.get("delete") == "lenient")
        if "torn" in op:
            self.model.faulty = True
            batch = TornBatch(batch, op["torn"])
        return attempt, WriteBatch(op["rows"], lambda: batch, producer, sequence, self.producer)

    def _applied(self, asked: Asked, attempt: int, applied: Applied, producer: str, sequence: int) -> None:
        self.model.applied(asked, attempt, applied, producer, sequence)
        if producer:
            self._next[asked.name + producer] = sequence + 1

    def _batch_refused(self, op: Operation, asked: Asked, error: Exception, attempts: Sequence[int]) -> None:
        reasons: list[type[Exception]] = [LimitExceededError]
        if not op["create"] or op["do"] == "stream":
            reasons.append(HullNotFoundError)
        if "delete" in op:
            reasons.append(PointMissingError)
        if op["numbered"]:
            reasons.append(SequenceGapError)
        if "torn" in op:
            reasons.append(MemoryError)
        self.refused(asked, error, tuple(reasons), attempts)
        if isinstance(error, SequenceGapError):
            self._next[op["name"] + self._producer(op)] = error.expected

    # Reads

    async def read(self, name: str, rows: int = 1) -> None:
        asked = self.model.ask(name)
        try:
            uid, revision, vertices = await self.server.vertices(name, rows)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError,))
        else:
            self.saw(asked, uid, revision, vertices)

    def saw(self, asked: Asked, uid: str, revision: int, vertices: Points) -> None:
        """An answer has the vertices at a revision."""
        seen = content(vertices)
        self.model.read(asked, uid, revision, seen)
        self.seen.setdefault(asked.name, []).append((uid, revision, seen))

    async def recall(self, op: Operation) -> None:
        """Resume from something seen before, or from a revision in between."""
        name = op["name"]
        if not self.seen.get(name):
            await self.read(name)
        seen = self.seen.get(name)
        if not seen:
            return
        uid, revision, _ = seen[-1 - op["back"] % len(seen)]
        revision = max(min(1, revision), revision - op["back"])  # of revision 0 there is nothing to mistake
        asked = self.model.ask(name)
        try:
            vertices = await self.server.recall(name, uid, revision)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError, HullReplacedError, RevisionForgottenError))
            return
        if vertices is not None:
            self.model.recalled(uid, revision, content(vertices))

    async def last(self, name: str) -> None:
        asked = self.model.ask(name)
        try:
            sequence = await self.server.last(name, self.producer)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError,))
        else:
            self.model.last(asked, self.producer, sequence)
            self._next[name + self.producer] = sequence + 1

    # Refusals

    def refused(
        self, asked: Asked, error: Exception, reasons: tuple[type[Exception], ...], attempts: Sequence[int] = ()
    ) -> None:
        """A request failed: there must be a reason."""
        match error:
            case _ if self.calm and not (
                isinstance(error, LimitExceededError) and self.model.full(asked.name, error.limit)
            ):
                raise self.model.finds(f"after all faults: {error!r}") from error
            case OutcomeUnknownError() if self.model.faulty:
                return
            case NotStoredError() if self.model.faulty:
                pass
            case StoppingError() if self.model.stopping:
                pass
            case HullNotFoundError() if HullNotFoundError in reasons:
                self.model.not_found(asked)
            case HullExistsError() if HullExistsError in reasons:
                self.model.exists(asked)
            case _ if isinstance(error, reasons):
                pass
            case _:
                raise self.model.finds(f"without a reason: {error!r}") from error
        self.model.refused(asked, attempts)


def content(vertices: Points) -> Content:
    """The batches that made these vertices."""
    return tuple(sorted(map(int, vertices[:, 0].tolist())))


async def probe(server: Server, model: Model, name: str, *, anew: bool) -> None:
    """After all faults everything works: read, write, and perhaps remove the hull and make it again."""
    client = Client(0, server, model)
    client.producer = "probe"
    client.calm = True
    if name in model.alive:
        await client.read(name)
    write: Operation = {"do": "write", "name": name, "create": True, "numbered": False, "rows": 1}
    await client.write(write)
    if name not in model.alive:
        return  # there may be no more hulls
    await client.read(name)
    if anew:
        await client.delete(name)
        await client.create(name)
        await client.write(write | {"numbered": True})
        await client.read(name)
