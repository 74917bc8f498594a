"""The root: the only writer of a hull over shards, and the hull of the vertices of all shards."""

from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from typing import Any, assert_never

import numpy as np

from dynhull import DynamicHull, convex_hull
from dynhull_server.state.batch import NO_POINTS, Applied
from dynhull_server.state.errors import RefusedError
from dynhull_server.state.limits import Limits
from dynhull_server.state.producers import Producers
from dynhull_server.state.records import Cause, Contents, Division, HullSettings
from dynhull_server.state.sample import sample

from . import messages as say
from .logs import Decision, RootLog
from .messages import Corners, ShardTotals, VertexChange
from .moving import puts
from .parts import merged
from .placement import SLOTS, Piece, ShardAddress, pieces
from .planning import Plan, Planner
from .requests import AnyRootRequest, ExpirePoints, Read, Reshard, RootWrite

Round = dict[ShardAddress, say.Request]
Effects = Mapping[int, say.Effect]
Replies = dict[ShardAddress, Any]
Talk = Generator[Round, Any, Any]
Names = dict[tuple[float, float], list[Any]]

NOTHING = Corners(NO_POINTS, None)
# The points that go from shard to shard in one message, about.
PIECE_POINTS = 65_536


class ShardsDifferError(Exception):
    """A shard has not what was decided: data on a disk or in memory are damaged."""


class DivisionError(Exception):
    """The points have not arrived in the new shards as they were: nothing is decided, and the old ones go on."""


class Root:
    """The root of a hull over shards. Its hull is that of the last decision.

    Args:
        settings: the settings of the hull.
        limits: the limits on it.
        shards: the number of shards at the creation of the hull.
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
        self._keyed = settings.identity != "multiset"
        self._most_points = limits.points_of(settings)
        self._log = log
        self._epoch, decided = log.begin(None)
        most, most_of_one = limits.max_producers, limits.max_producers_per_caller
        self._producers = Producers(most, most_of_one, decided.producers, decided.skipping, now)
        self._division = decided.division or Division(shards)
        self._arising: Division | None = None  # what replaces it, once that is decided
        shards = self._division.shards
        self._planner = Planner(settings, self._most_points, self._producers, shards)
        self._number, self.revision = decided.number, decided.revision
        self.cause: Cause | None = decided.cause
        self.clock: int | None = decided.clock
        self.hull: DynamicHull | None = None
        self._names: Names = {}  # the key of each shard that has this vertex
        self._totals = [ShardTotals(0, 0, None)] * shards
        self._numbers = [decided.steps.get(shard, 0) for shard in range(shards)]  # the last step in the log of each
        self._waiting: deque[AnyRootRequest] = deque()
        self._current: list[AnyRootRequest] = []
        self._ticket = 0
        self._talk: Talk | None = self._open()
        self._sent: Round = {}
        self._replies: Replies = {}
        self._go_on(self._talk, None)

    # Requests and messages

    def submit(self, request: AnyRootRequest) -> None:
        """Serve the request after those before it.

        Raises:
            ValueError: it asks for the positions of keys, and the hull has none.
        """
        if isinstance(request, Read) and isinstance(request.question, say.PositionsOf) and not self._keyed:
            raise ValueError("question asks for the positions of keys, and the points of this hull have none")
        self._waiting.append(request)
        if self._talk is None:
            self._go_on(self._next(), None)

    def messages(self) -> list[tuple[ShardAddress, say.Request]]:
        """The messages without a reply, each with its shard: send them, and again after a while."""
        return [(place, each) for place, each in self._sent.items() if place not in self._replies]

    @property
    def generations(self) -> frozenset[int]:
        """The generations whose shards are needed; the shards of all others are not."""
        return frozenset(each.generation for each in (self._division, self._arising) if each is not None)

    def receive(self, place: ShardAddress, reply: say.Reply) -> None:
        """Handle a reply of a shard.

        Raises:
            FencedError: another root has begun, so this one must end.
            ShardsDifferError: a shard has lost or changed points.
            Exception: memory or the log failed: this root must be replaced by a new one.
        """
        sent = self._sent.get(place)
        if sent is None or place in self._replies or (reply.epoch, reply.ticket) != (sent.epoch, sent.ticket):
            return
        if isinstance(reply, say.Closed):
            self._begin_again()
            return
        self._replies[place] = reply
        if len(self._replies) == len(self._sent):
            self._go_on(self._talk, self._replies)

    @property
    def waits(self) -> bool:
        """Whether any request is not answered."""
        return bool(self._current or self._waiting)

    def give_up(self, error: Exception) -> None:
        """Refuse all requests, and open the shards anew: nothing of them has happened.

        Raises:
            Exception: as `receive`.
        """
        begun, refused = bool(self._current), [*self._current, *self._waiting]
        self._current = []
        self._waiting.clear()
        for request in refused:
            request.answer(error=error)
        if begun:  # otherwise they are being opened
            self._begin_again()

    def leave(self) -> tuple[list[AnyRootRequest], list[AnyRootRequest]]:
        """The requests under way, and those that wait, for another root to serve: this one has failed."""
        current, waiting = self._current, list(self._waiting)
        self._current = []
        self._waiting.clear()
        return current, waiting

    def _begin_again(self) -> None:
        """Open all shards in a new epoch, and serve the current requests anew: nothing is decided about them."""
        self._waiting.extendleft(reversed(self._current))
        self._current = []
        self._arising = None
        self._begin_epoch()
        self._go_on(self._open(), None)

    def _begin_epoch(self) -> None:
        self._epoch, _ = self._log.begin(self._epoch)
        self._ticket = 0

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
        self._drop_abandoned()
        if not self._waiting:
            return None
        request = self._waiting.popleft()
        self._current = [request]
        match request:
            case RootWrite():
                return self._write(request)
            case ExpirePoints():
                return self._expire(request)
            case Reshard():
                return self._reshard(request)
            case Read():
                return self._read(request)
            case _:
                assert_never(request)

    def _drop_abandoned(self) -> None:
        while self._waiting and (first := self._waiting[0]) and isinstance(first, RootWrite) and first.abandoned:
            self._waiting.popleft()

    def _answer(self, request: AnyRootRequest, result: Any = None, error: Exception | None = None) -> None:
        self._current.remove(request)
        request.answer(result, error)

    # Reads

    @property
    def points(self) -> int:
        """The number of points."""
        return sum(each.points for each in self._totals)

    @property
    def distinct(self) -> int | None:
        """The number of different points; None with keys, where several shards may have points at one place."""
        if self._keyed:
            return None
        return sum(each.distinct for each in self._totals)

    @property
    def due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        return min((each.due for each in self._totals if each.due is not None), default=None)

    def due_of_shards(self) -> dict[int, int | None]:
        """Of each shard, the time by the server's clock before which none of its points leaves; None for any time."""
        return {shard: totals.due for shard, totals in enumerate(self._totals)}

    def vertex_keys(self) -> list[Any]:
        """The key at each vertex of a keyed hull, the least one where several are. O(h)."""
        assert self.hull is not None  # asked once it is open
        return [min(self._names[x, y]) for x, y in self.hull.vertices().tolist()]

    def _read(self, request: Read) -> Talk:
        everywhere = range(self._division.shards)
        replies = yield from self._round(
            dict.fromkeys(everywhere, say.Ask(self._epoch, self._ticket, request.question))
        )
        answers = [replies[shard].answer for shard in everywhere]
        self._answer(request, (self.revision, self._composed(request.question, answers)))

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
            case say.FoundOf() | say.AllOf() | say.Recompute():
                assert self.hull is not None  # likewise
                return answers, self.hull.vertices()
            case say.SlotsOf():
                raise AssertionError("only the root itself asks for slots")
        assert_never(question)

    # Changes

    def _open(self) -> Talk:
        everywhere = range(self._division.shards)
        replies = yield from self._round(dict.fromkeys(everywhere, say.Open(self._epoch, self._ticket, self._number)))
        hull = DynamicHull()
        names: Names = {}
        for shard in everywhere:
            if replies[shard].number != self._numbers[shard]:
                steps = f"is at step {replies[shard].number}, not {self._numbers[shard]}"
                raise ShardsDifferError(f"shard {shard} {steps}: its log has lost steps, or is that of another hull")
            self._totals[shard] = replies[shard].totals
            _take(hull, names, [say.VertexChange(NOTHING, replies[shard].corners)])
        if self.hull is not None and not (
            np.array_equal(hull.points(), self.hull.points()) and _same(names, self._names)
        ):
            raise ShardsDifferError("shards have other vertices after a restart than before")
        self.hull, self._names = hull, names

    def _write(self, first: RootWrite) -> Talk:
        try:
            plan = self._planner.begin(first, self._number, self.points, self.clock)
        except Exception as error:  # any error is the answer to the caller
            self._answer(first, error=error)
            return
        if plan is None:
            applied = Applied(self.revision, 0, 0, 0, False, self.points, duplicate=True, clock=self.clock)
            self._answer(first, applied)
            return
        plans = [plan, *self._joining()]
        steps: dict[int, list[say.Step]] = {}
        for plan in plans:
            for shard in plan.shards:
                steps.setdefault(shard, []).append(plan.step(shard))
        replies = yield from self._round(
            {shard: say.Apply(self._epoch, self._ticket, tuple(each)) for shard, each in steps.items()}
        )
        by_shard = {shard: {each.number: each for each in reply.effects} for shard, reply in replies.items()}
        effects = [{shard: own[plan.number] for shard, own in by_shard.items() if plan.number in own} for plan in plans]
        refused, reason = self._first_refused(plans, effects)
        self._decide(plans[:refused], effects)
        if reason is not None:
            request, number = plans[refused].request, plans[refused].number
            behind = [plan.request for plan in plans[refused + 1 :]]
            self._current = [request]
            self._waiting.extendleft(reversed(behind))
            undo = say.Undo(self._epoch, self._ticket, number)
            yield from self._round(
                {
                    shard: undo
                    for shard, own in by_shard.items()
                    if any(each >= number and effect.error is None for each, effect in own.items())
                }
            )
            self._answer(request, error=reason)

    def _joining(self) -> Iterator[Plan]:
        """The plans of the batches behind the first one that make the round with it."""
        while True:
            self._drop_abandoned()
            if not self._waiting or not isinstance(self._waiting[0], RootWrite):
                return
            plan = self._planner.join(self._waiting[0])
            if plan is None:
                return
            self._current.append(self._waiting.popleft())
            yield plan

    def _first_refused(self, plans: Sequence[Plan], effects: Sequence[Effects]) -> tuple[int, RefusedError | None]:
        """The place of the first batch that is refused, or the number of batches; and the reason."""
        points, totals = self.points, list(self._totals)
        for place, (plan, own) in enumerate(zip(plans, effects, strict=True)):
            reason = plan.reason_to_refuse(own, points, self._most_points)
            if reason is not None:
                return place, reason
            for shard, effect in own.items():
                points += effect.totals.points - totals[shard].points
                totals[shard] = effect.totals
        return len(plans), None

    def _decide(self, plans: Sequence[Plan], effects: Sequence[Effects]) -> None:
        """Decide that batches are applied, and answer them."""
        decisions: list[Decision] = []
        revision = self.revision
        for plan, own in zip(plans, effects, strict=False):
            revision += 2 if any(effect.expired for effect in own.values()) else 1
            write = plan.request.batch.write
            numbered = write.producer, write.sequence, write.may_skip
            decisions.append(Decision(plan.number, revision, "batch", plan.clock, _logged(own), *numbered, own))
        if decisions:
            self._log.decide(self._epoch, decisions)
        for plan, own, decision in zip(plans, effects, decisions, strict=False):
            write = plan.request.batch.write
            if write.producer:
                number = write.producer, write.sequence, write.owner
                self._producers.applied(*number, plan.request.now, may_skip=write.may_skip)
            hull_changed = self._follow(decision, own)
            applied = [effect.applied for effect in own.values() if effect.applied is not None]
            revision, points = decision.revision, self.points
            result = merged(plan.admitted, applied, revision, hull_changed=hull_changed, points=points)
            result.expired = sum(effect.expired for effect in own.values())
            self._answer(plan.request, result)

    def _expire(self, request: ExpirePoints) -> Talk:
        clock = request.clock if self.clock is None else max(request.clock, self.clock)
        number = self._number + 1
        step = say.Step(number, None, clock, undoable=False)
        everywhere = range(self._division.shards)
        replies = yield from self._round(dict.fromkeys(everywhere, say.Apply(self._epoch, self._ticket, (step,))))
        effects = {shard: replies[shard].effects[0] for shard in everywhere}
        expired = sum(effect.expired for effect in effects.values())
        if expired:
            decision = Decision(number, self.revision + 1, "expiry", clock, _logged(effects), effects=effects)
            self._log.decide(self._epoch, [decision])
            self._follow(decision, effects)
        for shard, effect in effects.items():  # they may know better when points leave next
            self._totals[shard] = effect.totals
        self._answer(request, expired)

    def _round(self, messages: Mapping[int, say.Request]) -> Generator[Round, Any, dict[int, Any]]:
        """The replies to messages to shards of the present division."""
        generation = self._division.generation
        replies = yield {ShardAddress(generation, shard): each for shard, each in messages.items()}
        return {place.number: each for place, each in replies.items()}

    # Another division

    def _reshard(self, request: Reshard) -> Talk:
        """Have other shards take over all points, and decide that these are the shards from now on.

        Their generation is an epoch of its own, which the old shards know of before any new one does: so shards that a
        root leaves half-filled, because it dies or gives up, are never taken for those of another attempt.
        """
        if request.shards == self._division.shards:
            self._answer(request, self.revision)
            return
        self._begin_epoch()
        self._ticket = 1
        yield from self._open()
        self._arising = arising = Division(request.shards, self._epoch)
        new = [ShardAddress(arising.generation, number) for number in range(arising.shards)]
        yield dict.fromkeys(new, say.Open(self._epoch, self._ticket, 0))
        filled = yield from self._fill(arising)
        assert self.hull is not None  # all shards are open
        points = sum(each.points for each in filled.totals)
        if points != self.points or not np.array_equal(filled.hull.vertices(), self.hull.vertices()):
            raise DivisionError(f"{points} of {self.points} points have arrived, or other vertices")
        decision = Decision(
            filled.number,
            self.revision + 1,
            "division",
            self.clock,
            frozenset(shard for shard, number in enumerate(filled.numbers) if number),
            effects={shard: say.Effect(filled.numbers[shard], each) for shard, each in enumerate(filled.totals)},
            division=arising,
            replaced=VertexChange(_corners(self.hull, self._names), _corners(filled.hull, filled.names)),
        )
        self._log.decide(self._epoch, [decision])
        self._division, self._arising = arising, None
        self._planner.shards = arising.shards
        self._number, self.revision, self.cause = decision.number, decision.revision, decision.cause
        self._totals, self._numbers = filled.totals, filled.numbers
        self.hull, self._names = filled.hull, filled.names
        self._answer(request, self.revision)

    def _fill(self, arising: Division) -> Generator[Round, Any, "_Filled"]:
        """Bring all points to new shards, a piece to and from each shard at a time."""
        filled = _Filled(self._number, arising.shards)
        most_slots = max(1, PIECE_POINTS * SLOTS // max(1, self.points))
        left: dict[int, deque[Piece]] = {}
        for piece in pieces(self._division.shards, arising.shards, most_slots):
            left.setdefault(piece.source, deque()).append(piece)
        under_way: list[tuple[Piece, Contents]] = []
        while left or under_way:
            asked = {source: waiting.popleft() for source, waiting in left.items()}
            left = {source: waiting for source, waiting in left.items() if waiting}
            steps: dict[int, list[say.Step]] = {}
            for piece, contents in under_way:
                for part in puts(contents, self.clock):
                    filled.number += 1
                    steps.setdefault(piece.target, []).append(say.Step(filled.number, part, None, undoable=False))
            round_of_both: Round = {
                ShardAddress(self._division.generation, source): say.Ask(
                    self._epoch, self._ticket, say.SlotsOf(piece.first, piece.end)
                )
                for source, piece in asked.items()
            }
            for target, some in steps.items():
                apply = say.Apply(self._epoch, self._ticket, tuple(some))
                round_of_both[ShardAddress(arising.generation, target)] = apply
            replies = yield round_of_both
            for target in steps:
                filled.take(target, replies[arising.generation, target].effects)
            under_way = [(piece, replies[self._division.generation, source].answer) for source, piece in asked.items()]
        return filled

    def _follow(self, decision: Decision, effects: Effects) -> bool:
        """Bring the hull to what was decided. Returns whether it has changed after points had left because of age."""
        self._number, self.revision = decision.number, decision.revision
        self.cause, self.clock = decision.cause, decision.clock
        for shard, effect in effects.items():
            self._totals[shard] = effect.totals
        for shard in decision.shards:
            self._numbers[shard] = decision.number
        self._take_changes(effect.left for effect in effects.values())
        return self._take_changes(effect.changed for effect in effects.values())

    def _take_changes(self, changes: Iterable[say.VertexChange | None]) -> bool:
        """Bring the hull to what the shards have. Returns whether it has changed."""
        assert self.hull is not None  # requests wait until it is open
        before = self.hull.changes
        _take(self.hull, self._names, [each for each in changes if each is not None])
        return self.hull.changes != before


class _Filled:
    """What has arrived in new shards.

    Attributes:
        number: the number of the last step.
        numbers: the last step of each shard, 0 for none.
        totals: the counts of each shard.
        hull, names: the hull of their vertices, and the keys at these.
    """

    def __init__(self, number: int, shards: int) -> None:
        self.number = number
        self.numbers = [0] * shards
        self.totals = [ShardTotals(0, 0, None)] * shards
        self.hull = DynamicHull()
        self.names: Names = {}

    def take(self, shard: int, effects: Sequence[say.Effect]) -> None:
        """Take note of what steps have done in a shard."""
        for effect in effects:
            if effect.error is not None:
                raise DivisionError(f"shard {shard} refuses points: {effect.error}")
            self.numbers[shard], self.totals[shard] = effect.number, effect.totals
        _take(self.hull, self.names, [each.changed for each in effects if each.changed is not None])


def _logged(effects: Effects) -> frozenset[int]:
    return frozenset(shard for shard, effect in effects.items() if effect.logged)


def _take(hull: DynamicHull, names: Names, changes: Sequence[say.VertexChange]) -> None:
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


def _corners(hull: DynamicHull, names: Names) -> Corners:
    """The vertices of all shards."""
    if not names:
        return Corners(hull.points(), None)
    rows = [(*place, key) for place, keys in names.items() for key in keys]
    return Corners(np.array([row[:2] for row in rows], float), tuple(row[2] for row in rows))


def _named(corners: Corners) -> Iterable[tuple[tuple[float, float], Any]]:
    return zip(((x, y) for x, y in corners.points.tolist()), corners.keys or (), strict=False)


def _same(names: Names, others: Names) -> bool:
    return {place: sorted(keys) for place, keys in names.items()} == {at: sorted(keys) for at, keys in others.items()}
