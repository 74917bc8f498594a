"""Clients: each does one operation of its plan after the other, and compares every answer with the model.

They are coroutines that await nothing but the server, so that either layer can run them; a caller disconnects by a
CancelledError.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol, cast

import numpy as np
import numpy.typing as npt

from dynhull import KeyedHull
from dynhull.arrays import Points
from dynhull.keys import as_keys
from dynhull_server.engine.batch_stream import BatchStream
from dynhull_server.state.batch import Applied, Batch, KeyedBatch
from dynhull_server.state.errors import (
    HullExistsError,
    HullNotFoundError,
    HullReplacedError,
    InvalidBatchError,
    KeyMissingError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    PointMissingError,
    RevisionForgottenError,
    SequenceGapError,
    StoppingError,
)
from dynhull_server.state.events import WriteBatch, WriteTogether
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.records import HullSettings, Identity, Times, Window

from .entities import Key
from .model import Asked, Content, Model, tag
from .plan import TIMED, Operation

NO_POINTS = np.empty((0, 2))
# The points of one batch have an x of their own each, in eighths.
EIGHT = 8


class Server(Protocol):
    """What clients ask of a server, in either layer."""

    def time(self) -> int:
        """Microseconds since 1970."""

    async def create(self, name: str, settings: HullSettings) -> str:
        """Make a hull; its uid."""

    async def delete(self, name: str) -> None:
        """Remove a hull."""

    async def delete_at_once(self, name: str, times: int) -> None:
        """Remove a hull repeatedly, and ignore the answers."""

    async def apply(self, name: str, write: WriteBatch, *, create: bool) -> Applied:
        """Apply a batch."""

    async def apply_together(self, write: WriteTogether) -> list[Applied]:
        """Apply a batch to each of several hulls."""

    def stream(self, name: str, *, create: bool) -> BatchStream:
        """For many batches."""

    async def news(self, stream: BatchStream) -> None:
        """Wait until the stream has an answer."""

    async def vertices(self, name: str, rows: int) -> tuple[str, int, "Outline"]:
        """The uid, a revision and its vertices."""

    async def recall(self, name: str, uid: str, revision: int) -> Points | None:
        """The vertices at an earlier revision."""

    async def last(self, name: str, producer: str) -> int:
        """The last number of a producer."""

    async def special(self, client: "Client", op: Operation) -> None:
        """What one layer has and the other has not."""


# The vertices of a hull, and their keys if it has keys.
Outline = tuple[Points, Sequence[Key] | None]


def outline(state: HullState) -> Outline:
    """The vertices, and their keys."""
    return state.vertices(), state.vertex_keys().tolist() if isinstance(state.hull, KeyedHull) else None


class TornBatch:
    """A batch for which memory runs out when its inserts are looked at for the nth time."""

    def __init__(self, batch: Batch, nth: int) -> None:
        self._batch, self._left = batch, nth
        self.deletes, self.moves, self.count_missing, self.growth = batch.deletes, 0, batch.count_missing, batch.growth
        self.times = batch.times

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
                await self.create(op["name"], _settings(op))
            case "delete" if "crowd" in op:
                self.model.ask(op["name"], removes=True)
                await self.server.delete_at_once(op["name"], op["crowd"])
            case "delete":
                await self.delete(op["name"])
            case "write" | "put":
                await self.write(op)
            case "together":
                await self.together(op)
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

    async def create(self, name: str, settings: HullSettings) -> None:
        asked = self.model.ask(name, makes=True)
        try:
            uid = await self.server.create(name, settings)
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
            if name in TIMED:
                self._put(op, attempt, applied)

    async def together(self, op: Operation) -> None:
        """A batch to each of several hulls; a fault of it is in the last one."""
        names = op["names"]
        producer = f"{self.producer}-{'-'.join(names)}" if op["numbered"] else ""
        sequence = self._next.get(producer, 1) if producer else 0
        attempts, parts = [], []
        for name in names:
            last = name == names[-1]
            part = {key: value for key, value in op.items() if last or key not in ("delete", "torn")}
            attempt, write = self._batch(part | {"name": name}, producer, sequence)
            write.name = name
            attempts.append(attempt)
            parts.append(write)
        self.model.bind(attempts)
        asked = [self.model.ask(name) for name in names]
        try:
            results = await self.server.apply_together(WriteTogether(parts, rows=op["rows"]))
        except Exception as error:
            missing = error.name if isinstance(error, HullNotFoundError) else names[0]
            about = asked[names.index(missing)]
            self.refused(about, error, (HullNotFoundError, *_reasons(op)), attempts)
            if isinstance(error, SequenceGapError):
                self._next[producer] = error.expected
            return
        for each, attempt, applied in zip(asked, attempts, results, strict=True):
            self.model.applied(each, attempt, applied, producer, sequence)
            if each.name in TIMED:
                self._put(op, attempt, applied)
        if len({applied.duplicate for applied in results}) > 1:
            raise self.model.finds(f"batches {attempts} are a duplicate in one hull alone: {results}")
        if producer:
            self._next[producer] = sequence + 1

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

    def _put(self, op: Operation, attempt: int, applied: Applied) -> None:
        self.model.put(attempt, applied, len(op["keys"]), timed="time" in op or "deadline" in op)

    def _producer(self, op: Operation) -> str:
        if not op["numbered"]:
            return ""
        return "shared" if op.get("shared") else self.producer

    def _batch(self, op: Operation, producer: str, sequence: int) -> tuple[int, WriteBatch]:
        attempt = self.model.attempt()
        batch: Any
        match TIMED.get(op["name"]):
            case None:
                batch = self._points(op, attempt)
            case "multiset":
                batch = self._timed_points(op, attempt)
            case kind:
                batch = self._puts(op, attempt, kind)
        if "torn" in op and isinstance(batch, Batch):
            self.model.faulty = True
            batch = TornBatch(batch, op["torn"])
        return attempt, WriteBatch(op["rows"], lambda: batch, producer, sequence, self.producer)

    def _points(self, op: Operation, attempt: int) -> Batch:
        deletes = NO_POINTS
        seen = self.seen.get(op["name"])
        if op.get("delete") == "nowhere" and attempt % 3:  # else nothing that is right would follow a refused batch
            deletes = np.array([[-1.0, 1.0]])
        elif "delete" in op and seen and seen[-1][2]:
            x = float(seen[-1][2][0])
            deletes = np.array([[x, x * x]])
        x = float(attempt)
        return Batch(np.array([[x, x * x]]), deletes, 0, op.get("delete") == "lenient")

    def _timed_points(self, op: Operation, attempt: int) -> Batch:
        """A batch to a window. It deletes a point that nobody inserts, and perhaps one that was there."""
        seen = self.seen.get(op["name"])
        leaving = seen[-1][2][: len(op["removes"])] if seen else ()
        deleted = np.array([-attempt, *leaving])
        x, times = self._new(op, attempt)
        return Batch(np.column_stack((x, x * x)), np.column_stack((deleted, deleted**2)), 0, True, times)

    def _new(self, op: Operation, attempt: int) -> tuple[npt.NDArray[np.float64], Times | None]:
        """The x of each row, and the times."""
        x = attempt + np.arange(len(op["keys"])) / EIGHT
        return x, np.full(len(x), self.server.time() + op["time"], np.int64) if "time" in op else None

    def _puts(self, op: Operation, attempt: int, kind: str) -> KeyedBatch:
        """A batch of keys; those that it puts are not among those that it removes."""
        x, times = self._new(op, attempt)
        named = (str, int)[kind == "int"]
        removes = [tag(attempt, kind), *(named(key) for key in op["removes"] if key not in op["keys"])]
        return KeyedBatch(
            cast("Any", kind),
            as_keys(list(map(named, op["keys"])), kind),
            np.column_stack((x, x * x)),
            as_keys(removes, kind),
            times,
            op.get("only"),
            op.get("ttl"),
            np.full(len(x), self.server.time() + op["deadline"], np.int64) if "deadline" in op else None,
            refuse_missing="refuse" in op,
        )

    def _applied(self, asked: Asked, attempt: int, applied: Applied, producer: str, sequence: int) -> None:
        self.model.applied(asked, attempt, applied, producer, sequence)
        if producer:
            self._next[asked.name + producer] = sequence + 1

    def _batch_refused(self, op: Operation, asked: Asked, error: Exception, attempts: Sequence[int]) -> None:
        reasons = _reasons(op)
        if not op["create"] or op["do"] == "stream":
            reasons.append(HullNotFoundError)
        self.refused(asked, error, tuple(reasons), attempts)
        if isinstance(error, SequenceGapError):
            self._next[op["name"] + self._producer(op)] = error.expected

    # Reads

    async def read(self, name: str, rows: int = 1) -> None:
        asked = self.model.ask(name)
        try:
            uid, revision, seen = await self.server.vertices(name, rows)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError,))
        else:
            self.saw(asked, uid, revision, seen)

    def saw(self, asked: Asked, uid: str, revision: int, outline: Outline) -> None:
        """An answer has the vertices at a revision."""
        vertices, keys = outline
        seen = content(vertices)
        self.model.read(asked, uid, revision, seen)
        if keys is not None:
            self.model.named(uid, revision, vertices[:, 0].tolist(), keys)
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


def _reasons(op: Operation) -> list[type[Exception]]:
    """Why batches to a hull may be refused."""
    reasons: list[type[Exception]] = [LimitExceededError]
    if "delete" in op:
        reasons.append(PointMissingError)
    if "refuse" in op:
        reasons.append(KeyMissingError)
    if "keys" in op:
        reasons.append(InvalidBatchError)
    if op["numbered"]:
        reasons.append(SequenceGapError)
    if "torn" in op:
        reasons.append(MemoryError)
    return reasons


def content(vertices: Points) -> Content:
    """The batches that made these vertices."""
    return tuple(sorted(vertices[:, 0].tolist()))


def _settings(op: Operation) -> HullSettings:
    identity = cast("Identity", TIMED.get(op["name"], "multiset"))
    window = Window(**op["window"]) if "window" in op else None
    if op["name"] == "w" and window is None:
        window = Window(max_points=2)
    return HullSettings(identity, op.get("max_points", 0), window, op.get("by_event_time", False))


async def probe(server: Server, model: Model, name: str, *, anew: bool) -> None:
    """After all faults everything works: read, write, and perhaps remove the hull and make it again."""
    client = Client(0, server, model)
    client.producer = "probe"
    client.calm = True
    if name in model.alive:
        await client.read(name)
    write: Operation = {"do": "write", "name": name, "create": True, "numbered": False, "rows": 1}
    if name in TIMED:
        write |= {"do": "put", "keys": [0], "removes": [1], "time": 0}
    await client.write(write)
    if name not in model.alive:
        return  # there may be no more hulls
    await client.read(name)
    if anew:
        await client.delete(name)
        await client.create(name, _settings(write))
        await client.write(write | {"numbered": True})
        await client.read(name)
