"""Clients: each does one operation of its plan after the other, and compares every answer with the model.

They are coroutines that await nothing but the server, so that either layer can run them; a caller disconnects by a
CancelledError.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol, cast

import numpy as np

from dynhull.arrays import Points
from dynhull.keys import as_keys
from dynhull_server.engine.batch_stream import BatchStream
from dynhull_server.engine.watch_fence import Sent
from dynhull_server.state.alarms.rule import AlarmRule
from dynhull_server.state.alarms.status import AlarmStatus
from dynhull_server.state.batch import Applied, Batch, KeyedBatch, Write
from dynhull_server.state.contents.live import AnyKeyedHull
from dynhull_server.state.errors import (
    AlarmNotRaisedError,
    ConsumerNotFoundError,
    FenceExistsError,
    FenceNotFoundError,
    FenceReplacedError,
    HullExistsError,
    HullFencedError,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    InvalidBatchError,
    InvalidFenceError,
    KeyMissingError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    PointMissingError,
    RestoredError,
    RevisionForgottenError,
    SequenceAheadError,
    SequenceGapError,
    StoppingError,
)
from dynhull_server.state.fences.model.config import Area, CircleArea, FenceConfig, HullArea, PolygonArea
from dynhull_server.state.fences.model.fence import Fence
from dynhull_server.state.fences.model.records import Consumer, Inside
from dynhull_server.state.hull_state import Counts, HullState
from dynhull_server.state.records import NO_TIME, Center, HullSettings, Identity, QuarantineRules, Times, Window

from .cluster_plan import Operation
from .entities import Key, accuracy_of
from .fence_model import PREFIX
from .globe import CENTERS, FAR, GLOBE, places, points
from .model import SKIPS, Asked, Content, Model, tag
from .operations import TIMED

NO_POINTS = np.empty((0, 2))
# The points of one batch have an x of their own each, in eighths.
EIGHT = 8
# The fields of a batch that have points.
POINTS = "inserts", "puts.points"
# The strips of a fence end there; above and below there are no points.
LAST_STRIP, LOWEST, HIGHEST = 40, -1_000, 10**7


class Server(Protocol):
    """What clients ask of a server, in either layer."""

    def time(self) -> int:
        """Microseconds since 1970."""

    async def create(self, name: str, settings: HullSettings) -> str:
        """Make a hull; its uid."""

    async def delete(self, name: str) -> None:
        """Remove a hull."""

    async def recenter(self, name: str, center: Center | None, rows: int) -> Counts:
        """Move the centre of a hull."""

    async def delete_at_once(self, name: str, times: int) -> None:
        """Remove a hull repeatedly, and ignore the answers."""

    async def apply(self, write: Write, *, create: bool, uid: str = "") -> Applied:
        """Apply a batch, whose number may be one of the hull with a uid."""

    async def apply_together(self, writes: Sequence[Write], rows: int) -> list[Applied]:
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

    def fence(self, name: str) -> Fence:
        """A fence, or raise FenceNotFoundError."""

    async def create_fence(self, name: str, config: FenceConfig, rows: int) -> Fence:
        """Make a fence."""

    async def replace_fence(self, name: str, config: FenceConfig, rows: int) -> Fence:
        """Give a fence other settings."""

    async def delete_fence(self, name: str) -> None:
        """Remove a fence."""

    async def acknowledge(self, name: str, consumer: str, sequence: int | None, uid: str) -> Consumer:
        """Make a consumer, or acknowledge events; of the fence with a uid, or of any."""

    async def drop_consumer(self, name: str, consumer: str) -> None:
        """Remove a consumer."""

    async def who_is_inside(self, name: str, rows: int) -> tuple[Fence, Inside]:
        """Who is inside of a fence."""

    async def acknowledge_alarm(self, name: str, hull: str) -> AlarmStatus:
        """Take note that an alarm is raised for a hull."""

    async def mute_alarm(self, name: str, hull: str, until: int) -> AlarmStatus:
        """Mute an alarm for a hull."""

    async def follow(self, client: "Client", op: Operation, after: int) -> None:
        """Read the events of a fence after a sequence."""

    async def special(self, client: "Client", op: Operation) -> None:
        """What one layer has and the other has not."""


# The vertices of a hull, their keys if it has keys, and the centre.
Outline = tuple[Points, Sequence[Key] | None, Center | None]


def outline(state: HullState) -> Outline:
    """The vertices, their keys, and the centre."""
    keys = state.vertex_keys().tolist() if isinstance(state.hull, AnyKeyedHull) else None
    return state.vertices(), keys, state.center


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
        fences: the uid of each fence that it follows, and the last event that it has.
        uids: the uid of each hull of which its numbers are.
    """

    def __init__(self, number: int, server: Server, model: Model) -> None:
        self.producer = f"p{number}"
        self.server = server
        self.model = model
        self.calm = False
        self.seen: dict[str, list[tuple[str, int, Content]]] = {}
        self.fences: dict[str, tuple[str, int]] = {}
        self.uids: dict[str, str] = {}
        self._next: dict[str, int] = {}

    def remember(self, before: "Client") -> None:
        """Go on as the client that it was in the life before."""
        self.seen, self.fences, self.uids, self._next = before.seen, before.fences, before.uids, before._next

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
            case "recenter":
                await self.recenter(op)
            case "release" | "rules":
                await self.request(op)
            case "last":
                await self.last(op["name"])
            case "fence" | "refence" | "unfence" | "follow" | "ack" | "unack" | "inside" | "take" | "mute":
                await self.of_fence(op)
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
            self.refused(asked, error, (HullNotFoundError, HullFencedError))
        else:
            self.model.deleted(asked)

    async def recenter(self, op: Operation) -> None:
        name, center = op["name"], None if op["center"] is None else tuple(op["center"])
        asked = self.model.ask_recenter(name, center)
        try:
            counts = await self.server.recenter(name, center, op["rows"])
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError, HullUnsuitableError))
            if isinstance(error, HullUnsuitableError):
                self.model.not_recentered(asked, center)
        else:
            self.model.recentered(asked, center, counts)

    # Batches

    async def write(self, op: Operation) -> None:
        name, producer = op["name"], self._producer(op)
        sequence = self._numbers(op, producer)[0]
        attempt, write = self._batch(op, producer, sequence)
        uid, least = self.uids.get(name + producer, "") if producer else "", self.model.kept_last(name, producer)
        asked = self.model.ask(name, makes=op["create"])
        try:
            applied = await self.server.apply(write, create=op["create"], uid=uid)
        except RestoredError as error:
            self.model.restored(asked, error, least)
            self.refused(asked, error, (RestoredError,), [attempt])
            self._next[name + producer], self.uids[name + producer] = error.last + 1, error.uid
        except SequenceGapError as error:
            if not uid:
                self.model.unexplained(asked)
            self._batch_refused(op, asked, error, [attempt])
        except Exception as error:
            self._batch_refused(op, asked, error, [attempt])
        else:
            self.model.require_present(name, uid)
            self._applied(asked, attempt, applied, producer, sequence)
            if producer and not applied.duplicate:
                self.uids[name + producer] = self.model.uid_of(attempt)
            if name in TIMED:
                self._put(op, attempt, applied)

    async def request(self, op: Operation) -> None:
        """Let keys out of the quarantine, or change its rules."""
        name, kind = op["name"], TIMED[op["name"]]
        named = (str, int)[kind == "int"]
        releases, drops = (list(map(named, op.get(field, ()))) for field in ("releases", "drops"))
        rules = QuarantineRules(**op["rules"]) if "rules" in op else None
        batch = KeyedBatch(cast("Any", kind), as_keys([], kind), NO_POINTS, as_keys([], kind), rules=rules)
        if rules is None:
            batch.releases, batch.drops = as_keys(releases, kind), as_keys(drops, kind)
        else:
            self.model.ask_rules(name, rules)
        asked = self.model.ask(name)
        try:
            applied = await self.server.apply(Write(name, batch, self.server.time(), op["rows"]), create=False)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError,))
        else:
            self.model.requested(asked, set(releases), set(drops), applied)

    async def together(self, op: Operation) -> None:
        """A batch to each of several hulls; a fault of it is in the last one."""
        names = op["names"]
        producer = f"{self.producer}-{'-'.join(names)}" if op["numbered"] else ""
        sequence = self._next.get(producer, 1) if producer else 0
        attempts, parts = [], []
        for name in names:
            last = name == names[-1]
            part = {key: value for key, value in op.items() if last or key not in ("delete", "torn", "far")}
            attempt, write = self._batch(part | {"name": name}, producer, sequence)
            attempts.append(attempt)
            parts.append(write)
        self.model.bind(attempts)
        asked = [self.model.ask(name) for name in names]
        try:
            results = await self.server.apply_together(parts, op["rows"])
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
        numbers, message = self._numbers(op, producer), op.get("message", 1)
        under_way: deque[tuple[Asked, int, int]] = deque()
        try:
            for first in range(0, len(numbers), message):
                writes = []
                for sequence in numbers[first : first + message]:
                    attempt, write = self._batch(op, producer, sequence)
                    under_way.append((self.model.ask(name, makes=op["create"]), attempt, sequence))
                    writes.append(write)
                stream.write(writes)
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
        if "skips" in op:
            return f"{self.producer}{SKIPS}"
        return "shared" if op.get("shared") else self.producer

    def _numbers(self, op: Operation, producer: str) -> list[int]:
        """The numbers of the batches of an operation: one after the other, or with gaps and earlier ones again."""
        batches: int = op.get("batches", 1)
        if not producer:
            return [0] * batches
        first = self._next.get(op["name"] + producer, 1)
        numbers = []
        for skip in op.get("skips", [0] * batches):
            numbers.append(max(1, first + skip))
            first = numbers[-1] + 1
        return numbers

    def _batch(self, op: Operation, producer: str, sequence: int) -> tuple[int, Write]:
        attempt = self.model.attempt()
        self.model.sends(attempt, self.server.time())
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
        numbered = producer, sequence, self.producer, producer.endswith(SKIPS)
        return attempt, Write(op["name"], batch, self.server.time(), op["rows"], *numbered)

    def _points(self, op: Operation, attempt: int) -> Batch:
        deletes = NO_POINTS
        seen = self.seen.get(op["name"])
        if op.get("delete") == "nowhere" and attempt % 3:  # else nothing that is right would follow a refused batch
            deletes = np.array([[-1.0, 1.0]])
        elif "delete" in op and seen and seen[-1][2]:
            x = float(seen[-1][2][0])
            deletes = np.array([[x, x * x]])
        name, x = op["name"], float(attempt)
        inserts = places(name, np.array([[x, x * x]]))
        if op.get("far"):
            inserts = np.concatenate((inserts, [FAR]))
        return Batch(inserts, places(name, deletes), 0, op.get("delete") == "lenient")

    def _timed_points(self, op: Operation, attempt: int) -> Batch:
        """A batch to a window. It deletes a point that nobody inserts, and perhaps one that was there."""
        seen = self.seen.get(op["name"])
        leaving = seen[-1][2][: len(op["removes"])] if seen else ()
        deleted = np.array([-attempt, *leaving])
        inserts, times = self._new(op, attempt)
        return Batch(inserts, places(op["name"], np.column_stack((deleted, deleted**2))), 0, True, times)

    def _new(self, op: Operation, attempt: int, lift: float = 0.0) -> tuple[Points, Times | None]:
        """The point of each row, and the times."""
        x = attempt + np.arange(len(op["keys"])) / EIGHT
        new = places(op["name"], np.column_stack((x, x * x + lift)))
        if op.get("far") and len(new) > 1:  # one alone would be a centre
            new[-1] = FAR
        return new, np.full(len(x), self.server.time() + op["time"], np.int64) if "time" in op else None

    def _puts(self, op: Operation, attempt: int, kind: str) -> KeyedBatch:
        """A batch of keys; those that it puts are not among those that it removes."""
        new, times = self._new(op, attempt, op.get("lift", 0))
        named = (str, int)[kind == "int"]
        removes = [tag(attempt, kind), *(named(key) for key in op["removes"] if key not in op["keys"])]
        return KeyedBatch(
            cast("Any", kind),
            as_keys(list(map(named, op["keys"])), kind),
            new,
            as_keys(removes, kind),
            times,
            op.get("only"),
            op.get("ttl"),
            np.full(len(new), self.server.time() + op["deadline"], np.int64) if "deadline" in op else None,
            refuse_missing="refuse" in op,
            accuracies=np.array([accuracy_of(x) for x in new[:, 0].tolist()]),
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
        if isinstance(error, InvalidBatchError) and error.field in POINTS and not op.get("far"):
            self.model.out_of_reach(asked)
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
        vertices, keys, center = outline
        vertices = points(asked.name, vertices)
        seen = content(vertices)
        self.model.read(asked, uid, revision, seen)
        self.model.centered(uid, revision, center)
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
            self.model.recalled(uid, revision, content(points(name, vertices)))

    async def last(self, name: str) -> None:
        asked = self.model.ask(name)
        try:
            sequence = await self.server.last(name, self.producer)
        except Exception as error:
            self.refused(asked, error, (HullNotFoundError,))
        else:
            self.model.last(asked, self.producer, sequence)
            self._next[name + self.producer] = sequence + 1

    # Fences

    async def of_fence(self, op: Operation) -> None:
        """A request about a fence."""
        name, do = op["name"], op["do"]
        asked = self.model.ask(PREFIX + name, makes=do == "fence", removes=do == "unfence")
        try:
            await self._ask_of_fence(op, asked)
        except Exception as error:
            self.fence_refused(op, asked, error)

    async def _ask_of_fence(self, op: Operation, asked: Asked) -> None:
        server, name = self.server, op["name"]
        known = self.fences.get(name)
        fence: Fence | None = None
        match op["do"]:
            case "fence":
                fence = await server.create_fence(name, config_of(op), op["rows"])
            case "refence":
                fence = await server.replace_fence(name, config_of(op), op["rows"])
            case "unfence":
                await server.delete_fence(name)
                self.model.removed_fence(asked)
            case "follow":
                fence = server.fence(name)
                after = known[1] - op["back"] if known is not None and known[0] == fence.row.uid else 0
                await server.follow(self, op, max(after, 0))
            case "ack":
                fence = server.fence(name)
                sequence = None if op["back"] is None else max(0, fence.last - op["back"])
                consumer = await server.acknowledge(name, op["consumer"], sequence, fence.row.uid)
                self.model.fences.acked(fence.number, consumer, sequence)
            case "unack":
                self.model.fences.unacked[name].add(op["consumer"])
                await server.drop_consumer(name, op["consumer"])
            case "take":
                self.model.asks_alarm(name, op["hull"], None)
                self.model.fences.taken(name, await server.acknowledge_alarm(name, op["hull"]))
            case "mute":
                until = server.time() + op["until"]
                self.model.asks_alarm(name, op["hull"], until if op["until"] > 0 else NO_TIME)
                self.model.fences.taken(name, await server.mute_alarm(name, op["hull"], until))
            case "inside":
                fence, inside = await server.who_is_inside(name, op["rows"])
                self.model.fences.held(fence.number, inside.sequence, inside.members)
        if fence is not None:
            self.model.answered_fence(asked, fence.number, fence.last)

    def followed(self, asked: Asked, fence: Fence, after: int, sent: Sent, *, complete: bool) -> None:
        """Events of a fence were sent; with `complete` all that there were."""
        self.model.fences.seen(fence.number, fence.row.uid, after, sent)
        self.fences[fence.name] = fence.row.uid, sent.sequence
        if complete:
            self.model.answered_fence(asked, fence.number, sent.sequence)

    def fence_refused(self, op: Operation, asked: Asked, error: Exception) -> None:
        """A request about a fence failed: there must be a reason."""
        reasons: list[type[Exception]] = []
        match do := op["do"]:
            case "fence":
                reasons = [FenceExistsError, HullNotFoundError, LimitExceededError, HullUnsuitableError]
            case "refence":
                reasons = [FenceNotFoundError, HullNotFoundError, InvalidFenceError]
            case "ack":
                reasons = [FenceNotFoundError, FenceReplacedError, LimitExceededError]
            case "unack":
                reasons = [FenceNotFoundError, ConsumerNotFoundError]
            case "take" | "mute":
                reasons = [FenceNotFoundError, AlarmNotRaisedError if do == "take" else HullUnsuitableError]
                if isinstance(error, AlarmNotRaisedError):
                    self.model.not_raised(asked, op["hull"])
                elif isinstance(error, HullUnsuitableError):
                    self.model.not_watched(asked, op["hull"])
            case _:
                reasons = [FenceNotFoundError]
        if isinstance(error, SequenceAheadError):
            raise self.model.finds(f"{asked.name} has fewer events than it had: {error}") from error
        self.refused(asked, error, tuple(reasons))

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
            case HullNotFoundError() if HullNotFoundError in reasons and asked.name.startswith(PREFIX):
                self.model.unsure(error.name, asked)
            case HullNotFoundError() | FenceNotFoundError() if type(error) in reasons:
                self.model.not_found(asked)
            case HullExistsError() | FenceExistsError() if type(error) in reasons:
                self.model.exists(asked)
            case HullFencedError() if HullFencedError in reasons:
                self.model.fenced(asked)
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
    if "keys" in op or op["name"] in GLOBE:
        reasons.append(InvalidBatchError)
    if op["numbered"] and "skips" not in op:
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
    if op["name"] in ("w", "gw") and window is None:
        window = Window(max_points=2)
    more: dict[str, Any] = {name: op[name] for name in ("history", "history_bytes") if name in op}
    if op["name"] in GLOBE:
        center = op.get("center")
        more |= {"frame": "geographic", "center": None if center is None else tuple(center)}
    elif "quarantine" in op:
        more["quarantine"] = QuarantineRules(**op["quarantine"])
    return HullSettings(identity, op.get("max_points", 0), window, op.get("by_event_time", False), **more)


def config_of(op: Operation) -> FenceConfig:
    """The settings of a fence. All points are on a parabola or above it: so strips hold those of some batches."""
    config = op["config"]
    area: Area
    match config["area"]:
        case {"hull": name, **more}:
            area = HullArea(name, more.get("without_self", False))
        case {"strips": width, "holes": holes}:
            area = _strips(width, holes=holes)
        case {"circle": x, "radius": radius}:
            area = CircleArea(float(x), float(x * x), float(radius))
        case {"when": when, "clear": clear, "hold": hold}:
            area = AlarmRule(when, clear, hold)
    return FenceConfig(area, **{key: value for key, value in config.items() if key != "area"})


def _strips(width: int, *, holes: bool) -> PolygonArea:
    """Strips that hold every other range of x, up to a limit; or one area with these strips as its holes."""
    rings = [_ring(x, x + width, LOWEST, HIGHEST) for x in range(width, LAST_STRIP, 2 * width)]
    if holes:
        return PolygonArea(((_ring(0, LAST_STRIP + width, LOWEST - 1, HIGHEST + 1), *rings),))
    return PolygonArea(tuple((ring,) for ring in rings))


def _ring(left: int, right: int, low: int, high: int) -> bytes:
    return np.array([[left, low], [right, low], [right, high], [left, high]], "<f8").tobytes()


async def probe(server: Server, model: Model, name: str, *, anew: bool) -> None:
    """After all faults everything works: read, write, and perhaps remove the hull and make it again."""
    client = Client(0, server, model)
    client.producer = "probe"
    client.calm = True
    if name in model.alive:
        await client.read(name)
        if model.alive[name].center == FAR:
            await client.recenter({"name": name, "center": CENTERS[0], "rows": 1})
    write: Operation = {"do": "write", "name": name, "create": True, "numbered": False, "rows": 1}
    if name in TIMED:
        write |= {"do": "put", "keys": [0], "removes": [1], "time": 0}
    await client.write(write)
    if name not in model.alive:
        return  # there may be no more hulls
    await client.read(name)
    if anew and model.fences.needed(name):
        client.calm = False
        await client.delete(name)
        client.calm = True
        if name not in model.alive:
            raise model.finds(f"{name} was deleted, and a fence depends on it")
    elif anew:
        await client.delete(name)
        await client.create(name, _settings(write))
        await client.write(write | {"numbered": True})
        await client.read(name)


async def probe_fence(server: Server, model: Model, name: str, *, anew: bool) -> None:
    """After all faults a fence works: its events can be read and acknowledged; perhaps it is made anew."""
    client = Client(0, server, model)
    client.calm = True
    consumer = next(iter(model.fences.alive[name].consumers), "probe")
    of_fence: Operation = {"name": name, "rows": 1, "back": 0, "most": 1_000, "consumer": consumer}
    for do in ("inside", "follow", "ack", *(("unack",) if consumer == "probe" else ())):
        await client.of_fence(of_fence | {"do": do})
    if anew:
        config = server.fence(name).row.config
        await client.of_fence(of_fence | {"do": "unfence"})
        asked = model.ask(PREFIX + name, makes=True)
        fence = await server.create_fence(name, config, 1)
        model.answered_fence(asked, fence.number, fence.last)
