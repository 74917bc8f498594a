"""Reads of the past of hulls, as the server's handlers make them, and what each answer must be."""

import asyncio
from collections.abc import Coroutine, Iterator
from contextlib import aclosing, nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np

from dynhull.keys import as_keys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.live_hull import LiveHull
from dynhull_server.engine.replay import Pace, replay
from dynhull_server.engine.tracks import tracks
from dynhull_server.engine.views import Change, Progress, Snapshot, VerticesView
from dynhull_server.state.errors import (
    ConsumerNotFoundError,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    MomentForgottenError,
    RevisionForgottenError,
)
from dynhull_server.state.feed_consumers import ConsumerId
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.records import Keys
from dynhull_server.state.tracks import Moves
from dynhull_server.storage.past import Erasure

from .clients import Client, Outline, content, outline
from .cluster_plan import Operation
from .entities import Entity, Key, loaded
from .globe import points
from .model import Model, Truth
from .operations import TIMED
from .past_model import ERASED, NOBODY, consumer_of, plain
from .quarantine_model import waiting_of
from .schedule import Schedule

if TYPE_CHECKING:
    from dynhull.arrays import Points

# As fast as it can be read, an event for each revision.
AT_ONCE = Pace(0.0, 0, 0.0, None)
# The keys that are followed: those that clients put.
FOLLOWED = range(4)
# How the past is read in a last look at brisk lives, beside its batches.
WAYS = "as_of", "replay", "track"


class PastReader:
    """Asks for the past of hulls.

    Args:
        engine: the server.
        model: judges the answers.
        schedule: draws what is looked at in brisk lives.
    """

    def __init__(self, engine: Engine, model: Model, schedule: Schedule) -> None:
        self._engine = engine
        self._model = model
        self._schedule = schedule

    async def ask(self, client: Client, op: Operation) -> None:
        """Carry out one operation of a client."""
        asked = self._model.ask(op["name"])
        try:
            live = self._engine.hulls.get(op["name"])
            truth = self._model.truth_of(live.number)
            try:
                await self._ask(live, truth, op)
            except (RevisionForgottenError, MomentForgottenError) as error:
                self._forgotten(truth, error)
                raise
        except Exception as error:
            reasons: list[type[Exception]] = [HullNotFoundError, RevisionForgottenError, MomentForgottenError]
            if op["do"] in ("track", "erase", "keep_past"):
                reasons.append(HullUnsuitableError)
            if op["do"] in ("consume", "unconsume"):
                reasons += [HullReplacedError, ConsumerNotFoundError]
            client.refused(asked, error, tuple(reasons))

    async def _ask(self, live: LiveHull, truth: Truth, op: Operation) -> None:
        last = live.counts.revision
        first = int(op.get("at", 0.0) * last)
        match op["do"]:
            case "as_of" if "by" in op:
                await self._as_of_time(live, truth, truth.past.times[first] + op["by"])
            case "as_of":
                await self.as_of(live, truth, first)
            case "feed":
                await self.feed(live, truth, first, op["most"])
            case "consume":
                await self._consume(live, truth, op["consumer"], op["most"])
            case "unconsume":
                await self.unconsume(consumer_of(live.name, op["consumer"]))
            case "replay":
                await self._replay(live, truth, first, last)
            case "track":
                await self._track(live, truth, first, last)
            case "keep_past":
                await self._engine.hulls.set_history(live.name, op["history"], op["history_bytes"])
            case _:
                await self._erase(live, op)

    def _forgotten(self, truth: Truth, error: RevisionForgottenError | MomentForgottenError) -> None:
        """Something of the past is not kept, or has not come."""
        if isinstance(error, RevisionForgottenError):
            lost = truth.past.whole and error.revision <= error.newest
        else:
            lost = truth.past.whole and error.oldest is not None and truth.past.at(error.time) is not None
        if lost:
            raise self._model.finds(f"the past of {truth.row.name} was to be kept for ever: {error!r}") from error

    # As of a moment

    async def as_of(self, live: LiveHull, truth: Truth, revision: int) -> None:
        """Read a hull at a revision."""
        past = await self._engine.hulls.past(live, revision, 0, nullcontext)
        counts, seen = await past.read(_whole)
        if counts.revision != revision:
            raise self._model.finds(f"{live.name} was read at {counts.revision}, asked for was {revision}")
        committed = past.committed
        time = truth.past.times[revision]
        if committed is None or committed.time != time:
            raise self._model.finds(
                f"revision {revision} of {live.name} is said to be of {committed}, and is of {time}"
            )
        self._compare(truth, revision, seen)

    async def _as_of_time(self, live: LiveHull, truth: Truth, time: int) -> None:
        past = await self._engine.hulls.past(live, None, time, nullcontext)
        counts, seen = await past.read(_whole)
        if counts.revision != truth.past.at(time):
            raise self._model.finds(
                f"{live.name} was read at {counts.revision} as of {time}, and was at {truth.past.at(time)}: "
                f"{truth.past.times}"
            )
        self._compare(truth, counts.revision, seen)

    def _compare(self, truth: Truth, revision: int, seen: "_Seen") -> None:
        """Compare all that was read of a revision with what it was."""
        name, erased = truth.row.name, revision <= truth.past.erased
        expected = truth.contents[revision], truth.centers[revision]
        if erased:
            left = {key: each for key, each in truth.held[revision].items() if int(key) != ERASED}
            expected = tuple(sorted(each.x for each in left.values())), expected[1]
        found = content(points(name, seen.points)), seen.outline[2]
        if found != expected:
            raise self._model.finds(f"revision {revision} of {name} was read as {found} from the past: {expected}")
        if not erased:
            self._outlined(truth, revision, seen.outline)
        if truth.timed:
            entities, waiting = truth.held[revision], truth.past.waiting[revision]
            if erased:
                entities, waiting = _without(entities), _without(waiting)
            held = loaded(name, seen.contents)
            if (held, seen.waiting) != (entities, waiting):
                raise self._model.finds(
                    f"revision {revision} of {name} held {held, seen.waiting} in the past: {entities, waiting}"
                )

    def _outlined(self, truth: Truth, revision: int, seen: Outline) -> None:
        vertices, keys, _ = seen
        vertices = points(truth.row.name, vertices)
        if content(vertices) != truth.outline(revision):
            raise self._model.finds(f"revision {revision} of {truth.row.name} had the vertices {vertices} in the past")
        if keys is not None:
            self._model.named(truth.row.uid, revision, vertices[:, 0].tolist(), keys)

    # From revision to revision

    async def feed(self, live: LiveHull, truth: Truth, after: int, most: int) -> int:
        """Follow the batches after a revision, as long as they come at once. The revision that they lead to."""
        async with aclosing(self._engine.hulls.feeds.follow(live, after, progress_interval=0.1)) as parts:
            async for part in parts:
                if part.lost is not None:
                    if truth.past.whole or part.lost != (after + 1, part.revision):
                        raise self._model.finds(f"the feed of {live.name} after {after} has lost {part.lost}")
                    after = part.revision
                for record in part.records:
                    after += 1
                    self.fed(truth, after, record)
                if part.revision != after:
                    raise self._model.finds(f"the feed of {live.name} has come to {part.revision}, and has {after}")
                most -= 1
                if not most or after >= truth.revision:
                    break
        return after

    async def _consume(self, live: LiveHull, truth: Truth, number: int, most: int) -> None:
        """Go on where a consumer has stopped, and acknowledge what has come."""
        ident = consumer_of(live.name, number)
        consumers, truths = self._engine.hulls.feed_consumers, self._model.consumers
        asked = truths.ask(ident)
        try:
            after = await consumers.revision(live, ident.name)
            self._consumer(live, truths.since(ident, asked), after)
            after = await self.feed(live, truth, after, most)
            asked = truths.ask(ident)
            state = await consumers.acknowledge(ident.name, live.name, live.uid, after)
        except HullReplacedError as error:
            if not truth.deleted and all(each is None or each.uid == live.uid for each in truths.since(ident, asked)):
                raise self._model.finds(f"{ident} is of {live.uid}: {error!r}") from error
            raise
        if state.consumer not in truths.since(ident, asked) or state.consumer.acknowledged < after:
            raise self._model.finds(f"{ident} has acknowledged {after}, and is {state}: {truths.since(ident, asked)}")

    def _consumer(self, live: LiveHull, states: list[Any], after: int) -> None:
        if not any(each is not None and (each.uid, each.acknowledged) == (live.uid, after) for each in states):
            raise self._model.finds(f"a consumer of {live.name} goes on after {after}, and was {states}")
        if after > live.counts.revision:
            raise self._model.finds(f"a consumer of {live.name} goes on after {after} of {live.counts.revision}")

    async def unconsume(self, ident: ConsumerId) -> None:
        """Delete a consumer."""
        asked = self._model.consumers.ask(ident)
        try:
            await self._engine.hulls.feed_consumers.delete(ident)
        except ConsumerNotFoundError as error:
            if None not in self._model.consumers.since(ident, asked):
                raise self._model.finds(f"{ident} was not deleted: {error!r}") from error
            raise
        if None not in self._model.consumers.since(ident, asked):
            raise self._model.finds(f"{ident} is said to be deleted")

    def fed(self, truth: Truth, revision: int, record: Any) -> None:
        """Compare a batch of a feed with what was committed."""
        time = truth.past.times[revision]
        if record.revision != revision or record.committed is None or record.committed.time != time:
            raise self._model.finds(
                f"the feed of {truth.row.name} has revision {record.revision} of {record.committed}, "
                f"and should have {revision} of {time}"
            )
        expected = truth.past.batches(revision)
        if plain(record) not in expected:
            raise self._model.finds(
                f"revision {revision} of {truth.row.name} is {plain(record)} in the feed: {expected}"
            )

    async def _replay(self, live: LiveHull, truth: Truth, first: int, last: int) -> None:
        """Replay a part, an event for each revision."""
        await self._engine.hulls.pasts.moment(live, first, 0)
        hull = await self._engine.hulls.replayed(live, first, last)
        view = VerticesView(hull, keys=live.keyed)
        held: tuple[Points, Any] | None = None
        played = first - 1
        async with aclosing(replay(hull, view, AT_ONCE, origin=None, resumed=False, outline_only=False)) as events:
            async for event in events:
                played += 1
                match event:
                    case Snapshot() | Change():
                        held = event.vertices, None if event.keys is None else event.keys.tolist()
                    case Progress():
                        pass
                assert held is not None
                if event.counts.revision != played:
                    raise self._model.finds(f"the replay of {live.name} has {event.counts.revision} for {played}")
                if played > truth.past.erased:
                    self._outlined(truth, played, (*held, event.counts.center))
        if played != last:
            raise self._model.finds(f"the replay of {live.name} ends at {played}, and should at {last}")

    async def _track(self, live: LiveHull, truth: Truth, first: int, last: int) -> None:
        """Follow keys through a part: at each revision they must be where they were."""
        live.require_keys("keys")
        window = live.settings.window
        if live.geographic or (window is not None and window.max_points):
            return
        names = list(map(str if TIMED[live.name] == "str" else int, FOLLOWED))
        pasts = self._engine.hulls.pasts
        await pasts.moment(live, first, 0)
        rows = [
            row
            async for moves in tracks(pasts, live, _keys(live, names), first, last, truth.past.times[first], 0)
            for row in _rows(moves)
        ]
        at: dict[Key, tuple[float, float, int]] = {}
        for revision in range(first, last + 1):
            while rows and rows[0][0] <= revision:
                _, time, key, place = rows.pop(0)
                if time != truth.past.times[revision]:
                    raise self._model.finds(f"a move of {live.name} at {revision} is of {time}: {truth.past.times}")
                at[names[key]] = place
            there = {key: each for key, each in at.items() if not np.isnan(each[0])}
            expected = {key: _place(each) for key, each in truth.held[revision].items() if key in names}
            if there != expected:
                raise self._model.finds(f"the keys of {live.name} at {revision} are tracked to {there}: {expected}")
        if rows:
            raise self._model.finds(f"the track of {live.name} goes on after {last}: {rows}")

    async def _erase(self, live: LiveHull, op: Operation) -> None:
        """Erase a key from the past. Others ask for it at once, or for a key that never was, and one may go away."""
        live.require_keys("keys")

        def ask(key: int) -> Coroutine[Any, Any, Erasure | None]:
            name = str(key) if TIMED[live.name] == "str" else key
            return self._engine.hulls.filing.erase(live, _keys(live, [name]))

        if op.get("goes"):
            gone = asyncio.get_running_loop().create_task(ask(ERASED))
            await asyncio.sleep(0)
            gone.cancel()
        others = op.get("others", [])
        answers = await asyncio.gather(ask(ERASED), *map(ask, others), return_exceptions=True)
        past = self._model.truth_of(live.number).past
        found = [each for each in answers if isinstance(each, Erasure)]
        past.gone = max([past.gone, *(each.last for each in found)])
        if len({each.last for each in found}) < len(found):
            raise self._model.finds(f"{live.name} was erased from more than once: {found}")
        for key, answer in zip([ERASED, *others], answers, strict=True):
            if key == NOBODY and isinstance(answer, Erasure):
                raise self._model.finds(f"a key that {live.name} never had is said to be erased: {answer}")
            if isinstance(answer, BaseException):
                raise answer

    async def probe(self, name: str) -> None:
        """After all faults, the whole past that is to be there is there."""
        live = self._engine.hulls.get(name)
        truth = self._model.truth_of(live.number)
        last = live.counts.revision
        _, found = await self._engine.hulls.history(name)
        if truth.past.whole and found.first.revision:
            raise self._model.finds(f"the past of {name} was to be kept for ever, and begins with {found.first}")
        if not last <= found.last.revision <= truth.revision:
            raise self._model.finds(f"the past of {name} ends with {found.last}, kept is {truth.revision}")
        try:
            await self._all(live, truth, found.first.revision, last)
        except RevisionForgottenError as error:  # one more snapshot, or what has become too old
            self._forgotten(truth, error)

    async def _all(self, live: LiveHull, truth: Truth, first: int, last: int) -> None:
        """Read all there is from one revision to another one; in brisk lives each batch, and the rest in one way."""
        await self.feed(live, truth, first, last + 1)
        way = self._schedule.random.choice(WAYS) if self._schedule.brisk else None
        if way in (None, "as_of"):
            for revision in {first, (first + last) // 2, last}:
                await self.as_of(live, truth, revision)
        if way in (None, "replay"):
            await self._replay(live, truth, first, last)
        if live.keyed and way in (None, "track"):
            await self._track(live, truth, first, last)


class _Seen:
    """All that is read of a hull at once."""

    def __init__(self, state: HullState) -> None:
        self.outline: Outline = outline(state)
        self.points = state.hull.points()
        self.contents = state.kept().contents
        self.waiting = {} if state.quarantine is None else waiting_of(state.quarantine.stored())


def _whole(state: HullState) -> _Seen:
    return _Seen(state)


def _keys(live: LiveHull, names: list[Any]) -> Keys:
    kind = live.settings.identity
    assert kind != "multiset"
    return as_keys(names, kind)


def _rows(moves: Moves) -> Iterator[tuple[int, int, int, tuple[float, float, int]]]:
    """The revision, the time, the key, and the place of each move."""
    columns = moves.revisions, moves.times, moves.rows, moves.points, moves.event_times
    for revision, time, row, (x, y), event_time in zip(*(each.tolist() for each in columns), strict=True):
        yield revision, time, row, (x, y, event_time)


def _place(entity: Entity) -> tuple[float, float, int]:
    return entity.x, entity.y, entity.time


def _without(held: dict[Key, Any]) -> dict[Key, Any]:
    return {key: each for key, each in held.items() if int(key) != ERASED}
