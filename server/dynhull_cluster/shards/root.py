"""The root: the only writer of a hull over shards, and the hull of the vertices of all shards."""

from collections import deque
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, assert_never

import numpy as np

from dynhull import DynamicHull, convex_hull
from dynhull_server.state.batch import NO_POINTS, Applied, Batch, KeyedBatch
from dynhull_server.state.contents import keyed, replayed
from dynhull_server.state.errors import HullUnsuitableError, LimitExceededError, MisfitError, RefusedError
from dynhull_server.state.events import WriteBatch
from dynhull_server.state.limits import Limits
from dynhull_server.state.producers import Producers
from dynhull_server.state.records import HullSettings, Kept
from dynhull_server.state.sample import sample

from . import messages as say
from .logs import Decision, RootLog
from .messages import Corners, Totals
from .parts import Admitted, Part, divided, first_refusal, merged, most_growth, refusable, refuse_repeated

if TYPE_CHECKING:
    from dynhull_server.state.hull_state import Cause

Round = dict[int, say.Request]
Replies = dict[int, Any]
Talk = Generator[Round, Any, Any]
Names = dict[tuple[float, float], list[Any]]


class ShardsDifferError(Exception):
    """Shards have other vertices than they reported: data on a disk or in memory are damaged."""


@dataclass(slots=True, eq=False)
class Request:
    """A request of a caller.

    Attributes:
        answered: whether it is answered.
        result: the result, once it is.
        error: the reason of a refusal, once it is; None where it was not refused.
    """

    answered: bool = field(default=False, init=False)
    result: Any = field(default=None, init=False)
    error: Exception | None = field(default=None, init=False)


@dataclass(slots=True, eq=False)
class Write(Request):
    """Apply a batch that arrived at `now`, seconds on a monotonic clock. The result is an Applied."""

    batch: WriteBatch
    now: float


@dataclass(slots=True, eq=False)
class Expire(Request):
    """Make the points leave that leave at `clock`. The result is their number."""

    clock: int


@dataclass(slots=True, eq=False)
class Read(Request):
    """A question about all points. The result is the revision, and the answer; for StaticHull, whether it is equal."""

    question: say.Question


class _RefusedBatchError(Exception):
    """A batch is refused for this reason, which is the answer to the caller."""

    def __init__(self, reason: Exception) -> None:
        super().__init__(reason)
        self.reason = reason


class Root:
    """The root of a hull over shards. Its hull is that of the last decision.

    Args:
        settings: the settings of the hull.
        limits: the limits on it.
        shards: the number of shards.
        log: the decisions.
        now: seconds on a monotonic clock.

    Attributes:
        revision: the revision of the hull.
        cause: what made it; None for revision 0.
        clock: the clock of the hull, None for a hull without a clock.
        hull: the hull of the vertices of all shards; None until all are open.

    Raises:
        ValueError: hulls with these settings cannot be divided.
    """

    def __init__(self, settings: HullSettings, limits: Limits, shards: int, log: RootLog, now: float) -> None:
        if settings.geographic:
            raise ValueError("frame is geographic: the points of such a hull share one centre, so it has no shards")
        if settings.window is not None and settings.window.max_points:
            raise ValueError("window.max_points is set: no shard knows the oldest points of all, so use max_age")
        if settings.quarantine is not None:
            raise ValueError("quarantine is set: no shard knows the hull that its rules compare with")
        self._gate = replayed(Kept(), settings)  # admits batches as a hull does; has no points
        self._most_points = min(settings.max_points or limits.max_points, limits.max_points)
        self._log = log
        self._epoch, decisions = log.begin(None)
        last = {each.producer: each.sequence for each in decisions if each.producer}
        skipping = {each.producer for each in decisions if each.may_skip}
        self._producers = Producers(limits.max_producers, limits.max_producers_per_caller, last, skipping, now)
        self._number, self.revision = (decisions[-1].number, decisions[-1].revision) if decisions else (0, 0)
        self.cause: Cause | None = decisions[-1].cause if decisions else None
        self.clock: int | None = decisions[-1].clock if decisions else None
        self.hull: DynamicHull | None = None
        self._names: Names = {}  # the key of each shard that has this vertex
        self._totals = [Totals(0, 0, None)] * shards
        self._waiting: deque[Request] = deque()
        self._current: Request | None = None
        self._ticket = 0
        self._talk: Talk | None = self._open()
        self._sent: Round = {}
        self._replies: Replies = {}
        self._go_on(self._talk, None)

    # Requests and messages

    def submit(self, request: Request) -> None:
        """Serve the request after those before it."""
        self._waiting.append(request)
        if self._talk is None:
            self._go_on(self._next(), None)

    def messages(self) -> list[tuple[int, say.Request]]:
        """The messages without a reply, each with its shard: send them, and again after a while."""
        return [(shard, each) for shard, each in self._sent.items() if shard not in self._replies]

    def receive(self, shard: int, reply: say.Reply) -> None:
        """Handle a reply of a shard.

        Raises:
            FencedError: another root has begun, so this one must end.
            ShardsDifferError: a shard has lost or changed points.
            Exception: memory or the log failed: this root must be replaced by a new one.
        """
        sent = self._sent.get(shard)
        if sent is None or shard in self._replies or (reply.epoch, reply.ticket) != (sent.epoch, sent.ticket):
            return
        if isinstance(reply, say.Closed):
            self._begin_again()
            return
        self._replies[shard] = reply
        if len(self._replies) == len(self._sent):
            self._go_on(self._talk, self._replies)

    def _begin_again(self) -> None:
        """Open all shards in a new epoch, and serve the current request anew: it has decided nothing."""
        if self._current is not None:
            self._waiting.appendleft(self._current)
            self._current = None
        self._epoch, _ = self._log.begin(self._epoch)
        self._ticket = 0
        self._go_on(self._open(), None)

    def _go_on(self, talk: Talk | None, replies: Replies | None) -> None:
        """Go on with what is under way, then with what waits, until a round needs replies or nothing waits."""
        while talk is not None:
            self._talk, self._sent, self._replies = talk, {}, {}
            self._ticket += 1
            try:
                self._sent = talk.send(replies)
            except StopIteration:
                talk, replies = self._next(), None
                continue
            if self._sent:
                return
            replies = {}
        self._talk = None

    def _next(self) -> Talk | None:
        if not self._waiting:
            return None
        self._current = self._waiting.popleft()
        return self._serve(self._current)

    def _serve(self, request: Request) -> Talk:
        try:
            match request:
                case Write():
                    request.result = yield from self._write(request.batch, request.now)
                case Expire():
                    request.result = yield from self._expire(request.clock)
                case Read():
                    request.result = yield from self._read(request.question)
        except _RefusedBatchError as refusal:
            request.error = refusal.reason
        request.answered = True
        self._current = None

    # Reads

    @property
    def points(self) -> int:
        """The number of points."""
        return sum(each.points for each in self._totals)

    @property
    def distinct(self) -> int | None:
        """The number of different points; None with keys, where several shards may have points at one place."""
        if isinstance(self._gate, keyed.Keyed):
            return None
        return sum(each.distinct for each in self._totals)

    @property
    def due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        return min((each.due for each in self._totals if each.due is not None), default=None)

    def vertex_keys(self) -> list[Any]:
        """The key at each vertex of a keyed hull, the least one where several are. O(h)."""
        assert self.hull is not None  # asked once it is open
        return [min(self._names[x, y]) for x, y in self.hull.vertices().tolist()]

    def _read(self, question: say.Question) -> Talk:
        everywhere = range(len(self._totals))
        replies = yield {shard: say.Ask(self._epoch, self._ticket, question) for shard in everywhere}
        answers = [replies[shard].answer for shard in everywhere]
        return self.revision, self._composed(question, answers)

    def _composed(self, question: say.Question, answers: Sequence[Any]) -> Any:
        match question:
            case say.SampleOf(size):
                points = np.concatenate(answers)
                points = points[np.lexsort((points[:, 1], points[:, 0]))]
                return points if len(points) <= size else sample(points, size)
            case say.CountOf():
                return sum(answers)
            case say.PositionsOf():
                return np.fmax.reduce(answers)  # a key is in one shard, others answer NaN
            case say.StaticHull():
                assert self.hull is not None  # questions wait until it is open
                return np.array_equal(convex_hull(np.concatenate(answers)), self.hull.vertices())
        assert_never(question)

    # Changes

    def _open(self) -> Talk:
        everywhere = range(len(self._totals))
        replies = yield {shard: say.Open(self._epoch, self._ticket, self._number) for shard in everywhere}
        hull = DynamicHull()
        names: Names = {}
        for shard in everywhere:
            self._totals[shard] = replies[shard].totals
            _take(hull, names, [say.Change(NOTHING, replies[shard].corners)])
        if self.hull is not None and not (
            np.array_equal(hull.points(), self.hull.points()) and _same(names, self._names)
        ):
            raise ShardsDifferError("shards have other vertices after a restart than before")
        self.hull, self._names = hull, names

    def _write(self, write: WriteBatch, now: float) -> Talk:
        try:
            if not self._is_new(write, now):
                return Applied(self.revision, 0, 0, 0, False, self.points, duplicate=True, clock=self.clock)
            admitted, clock = self._admitted(write)
        except Exception as error:  # any error is the answer to the caller
            raise _RefusedBatchError(error) from error
        parts = divided(admitted, len(self._totals))
        concerned = range(len(self._totals)) if clock != self.clock else parts
        suspect = self.points + most_growth(admitted) > self._most_points
        undoable = suspect or (refusable(admitted) and len(concerned) > 1)
        header = self._epoch, self._ticket, self._number + 1
        replies = yield {
            shard: say.Step(*header, parts[shard].admitted if shard in parts else None, clock, undoable)
            for shard in concerned
        }
        reason = self._reason_to_refuse(admitted, parts, replies)
        if reason is not None:
            stepped = [shard for shard, reply in replies.items() if reply.error is None]
            yield {shard: say.Undo(self._epoch, self._ticket, self._number + 1) for shard in stepped}
            raise _RefusedBatchError(reason)
        expired = sum(reply.expired for reply in replies.values())
        revision = self.revision + (2 if expired else 1)
        numbered = write.producer, write.sequence, write.may_skip
        self._log.decide(self._epoch, Decision(self._number + 1, revision, "batch", clock, *numbered))
        self._number, self.revision, self.cause, self.clock = self._number + 1, revision, "batch", clock
        if write.producer:
            self._producers.applied(write.producer, write.sequence, write.owner, now, may_skip=write.may_skip)
        self._take_totals(replies)
        self._take_changes(reply.left for reply in replies.values())
        hull_changed = self._take_changes(reply.changed for reply in replies.values())
        effects = [reply.applied for reply in replies.values() if reply.applied is not None]
        applied = merged(admitted, effects, revision, hull_changed=hull_changed, points=self.points)
        applied.expired = expired
        return applied

    def _expire(self, clock: int) -> Talk:
        clock = clock if self.clock is None else max(clock, self.clock)
        step = say.Step(self._epoch, self._ticket, self._number + 1, None, clock, undoable=False)
        replies = yield dict.fromkeys(range(len(self._totals)), step)
        expired = sum(reply.expired for reply in replies.values())
        if expired:
            decision = Decision(self._number + 1, self.revision + 1, "expiry", clock)
            self._log.decide(self._epoch, decision)
            self._number, self.revision, self.cause, self.clock = decision.number, decision.revision, "expiry", clock
            self._take_totals(replies)
            self._take_changes(reply.left for reply in replies.values())
        return expired

    def _is_new(self, write: WriteBatch, now: float) -> bool:
        """Whether a batch is the next one of its producer, or not numbered; or raise what refuses it."""
        return not write.producer or self._producers.is_new(
            write.producer, write.sequence, write.owner, now, may_skip=write.may_skip, after=write.after
        )

    def _admitted(self, write: WriteBatch) -> tuple[Admitted, int | None]:
        """The batch as one hull admits it, and the clock that it leads to; or raise what refuses it."""
        self._gate.clock = self.clock
        batch = write.make()
        try:
            if isinstance(batch, KeyedBatch) and batch.of_quarantine:
                raise MisfitError(batch.field, "has shards, so it has no quarantine")
            admitted: Admitted = self._gate.admit(batch, write.arrived)
        except MisfitError as misfit:
            raise HullUnsuitableError(write.name, str(misfit), field=f"batch.{misfit.field}") from None
        if isinstance(admitted, Batch):
            if self.points + admitted.growth > self._most_points:
                raise LimitExceededError("max_points", self._most_points)
            return admitted, None
        if isinstance(admitted, keyed.Admitted):
            refuse_repeated(admitted.rows)
        return admitted, admitted.clock

    def _reason_to_refuse(self, admitted: Admitted, parts: Mapping[int, Part], replies: Replies) -> RefusedError | None:
        """Why a batch is refused, if it is: by a shard, or because of the limit on points."""
        refusals = [(parts[shard], reply.error) for shard, reply in replies.items() if reply.error is not None]
        if refusals:
            return first_refusal(admitted, refusals)
        after = self.points - sum(reply.expired for reply in replies.values())
        if isinstance(admitted, keyed.Admitted):
            effects = [reply.applied for reply in replies.values() if reply.applied is not None]
            new = sum(each.inserted for each in effects)
            after += new - sum(each.deleted for each in effects)
            grows = new > 0 and admitted.rows.condition != "present"
        else:
            after += most_growth(admitted)
            grows = True
        return LimitExceededError("max_points", self._most_points) if grows and after > self._most_points else None

    def _take_totals(self, replies: Replies) -> None:
        for shard, reply in replies.items():
            self._totals[shard] = reply.totals

    def _take_changes(self, changes: Iterable[say.Change | None]) -> bool:
        """Bring the hull to what the shards have. Returns whether it has changed."""
        assert self.hull is not None  # requests wait until it is open
        before = self.hull.changes
        _take(self.hull, self._names, [each for each in changes if each is not None])
        return self.hull.changes != before


NOTHING = Corners(NO_POINTS, None)


def _take(hull: DynamicHull, names: Names, changes: Sequence[say.Change]) -> None:
    """Apply changes of shards' vertices to the hull of all, as one batch."""
    if not changes:
        return
    come, gone = [each.come.points for each in changes], [each.gone.points for each in changes]
    counts = [sum(map(len, come)), sum(map(len, gone))]
    hull.apply(np.repeat(np.array([1, -1], np.int8), counts), np.concatenate([*come, *gone]))
    for each in changes:
        for place, key in _named(each.gone):
            names[place].remove(key)
            if not names[place]:
                del names[place]
        for place, key in _named(each.come):
            names.setdefault(place, []).append(key)


def _named(corners: Corners) -> Iterable[tuple[tuple[float, float], Any]]:
    return zip(((x, y) for x, y in corners.points.tolist()), corners.keys or (), strict=False)


def _same(names: Names, others: Names) -> bool:
    return {place: sorted(keys) for place, keys in names.items()} == {at: sorted(keys) for at, keys in others.items()}
