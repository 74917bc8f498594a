"""Consumers of the feeds of all hulls with a prefix, and what must hold of what they get.

* A consumer is where it was last committed to be, over kills, too.
* Batches come in the order of their commits, and those of each hull follow one another, as they were committed.
* Up to a position nothing is missing of what was committed before it, unless that is said. Who is gone was deleted.
"""

from contextlib import aclosing
from dataclasses import dataclass, field
from typing import Any

from dynhull_server.engine.engine import Engine
from dynhull_server.engine.feed_consumers import standing_of
from dynhull_server.engine.feed_many import Gap, ManyFeedPart, OfHull
from dynhull_server.engine.positions import Standing, decode_standings
from dynhull_server.engine.roster import Roster, RosterLimits
from dynhull_server.engine.rosters import Choice
from dynhull_server.rpc.many import HullStates
from dynhull_server.state.errors import ConsumerNotFoundError, PositionForgottenError
from dynhull_server.state.feed_consumers import ConsumerId, FedBy

from .clients import Client
from .cluster_plan import Operation
from .model import Model, Truth
from .past_reader import PastReader

# Seconds without a batch after which a reader has all that there is.
IDLE = 0.1
# More hulls, and bytes of their states, than there are.
MANY = 10**9


@dataclass(slots=True)
class _Read:
    """What a reader has got since its start.

    Attributes:
        start: where it begins.
        position: where it is; nothing after this is acknowledged.
        at: the last revision of each hull, by its uid.
        number, more: of the last batch: its commit, and whether there is more of that.
    """

    start: Standing
    position: Standing
    at: dict[str, int] = field(default_factory=dict)
    number: int = 0
    more: bool = False

    def before(self, truth: Truth) -> int:
        """The last revision of a hull that the start has, at most."""
        if not self.start.number:
            return 0
        return max(
            revision for revision, time in enumerate(truth.past.times) if not revision or time <= self.start.time
        )


class PrefixReader:
    """Reads the feeds of prefixes.

    Args:
        engine: the server.
        model: judges what comes.
        past: judges each batch.
    """

    def __init__(self, engine: Engine, model: Model, past: PastReader) -> None:
        self._engine, self._model, self._past = engine, model, past

    async def ask(self, client: Client, op: Operation) -> None:
        """Carry out one operation of a client."""
        asked = self._model.ask(op["name"])
        ident = ConsumerId(FedBy(op["name"], True), f"reader {op['consumer']}")
        try:
            if op["do"] == "consume_many":
                await self._consume(ident, op["most"])
            else:
                await self._past.unconsume(ident)
        except Exception as error:
            client.refused(asked, error, (ConsumerNotFoundError, PositionForgottenError))

    async def _consume(self, ident: ConsumerId, most: int) -> None:
        """Go on where a consumer has stopped, and acknowledge what has come."""
        consumers, truths = self._engine.hulls.feed_consumers, self._model.consumers
        asked = truths.ask(ident)
        try:
            start = await consumers.place(ident.feed.name, ident.name)
        except PositionForgottenError as error:
            now = str(self._engine.hulls.standing.incarnation)
            if all(each is None or each.uid == now for each in truths.since(ident, asked)):
                raise self._model.finds(f"{ident} is of these data: {truths.since(ident, asked)}") from error
            raise
        states = truths.since(ident, asked)
        if not any(each is not None and standing_of(each) == start for each in states):
            raise self._model.finds(f"{ident} goes on after {start}, and was {states}")
        position = await self._follow(ident.feed.name, start, most)
        asked = truths.ask(ident)
        state = await consumers.acknowledge_many(ident.name, ident.feed.name, position)
        if state.consumer not in truths.since(ident, asked) or state.consumer.acknowledged < position.number:
            raise self._model.finds(f"{ident} has acknowledged {position}, and is {state}")

    async def _follow(self, prefix: str, start: Standing, most: int) -> Standing:
        """Read some parts, or all that there is. How far they lead."""
        hulls, read = self._engine.hulls, _Read(start, start)
        encoding: Any = 0
        states = HullStates(hulls, encoding, outline=False, most=0)
        with hulls.rosters.use("feeds", Choice(prefix), lambda: Roster(states, RosterLimits(MANY, MANY))) as roster:
            async with aclosing(hulls.feed(roster).follow(start, IDLE)) as parts:
                async for part in parts:
                    self._part(prefix, read, part)
                    most -= part.there is None
                    if part.position and (most <= 0 or not (part or part.there is not None)):
                        break
        return read.position

    def _part(self, prefix: str, read: _Read, part: ManyFeedPart) -> None:
        for gap in part.gaps:  # each may be between batches of this part
            self._require_lost(gap)
        for gone in part.gone:
            if not self._truth(prefix, gone).deleted:
                raise self._model.finds(f"{gone} is said to be gone")
        for batch in part.batches:
            truth, record = self._truth(prefix, batch.hull), batch.record
            gaps = [gap for gap in part.gaps if gap.hull == batch.hull]
            exactly = batch.hull.uid in read.at or read.start.number == 0 or any(gap.first == 1 for gap in gaps)
            after = _passed(gaps, read.at.get(batch.hull.uid, 0 if exactly else read.before(truth)))
            if exactly:
                follows = record.revision == after + 1
            elif gaps:  # where it begins is not known exactly
                follows = record.revision <= after + 1
            else:  # of the time of the start there may be more commits
                known = record.revision == 1 or truth.past.times[record.revision - 1] <= read.start.time
                follows = known and record.revision <= after + 1
            number = 0 if record.committed is None else record.committed.number
            in_order = number == read.number if read.more else number > max(read.number, read.start.number)
            if not (follows and in_order):
                raise self._model.finds(
                    f"after {after} of {batch.hull} comes {record.revision}, of commit {number} after {read}"
                )
            self._past.fed(truth, record.revision, record)
            read.at[batch.hull.uid], read.number, read.more = record.revision, number, batch.more
        for gap in part.gaps:
            read.at[gap.hull.uid] = max(read.at.get(gap.hull.uid, 0), gap.last)
        if part.position:
            (read.position,) = decode_standings(part.position)
            if part.there is None:
                self._complete(prefix, read)

    def _truth(self, prefix: str, hull: OfHull) -> Truth:
        truth = self._model.truth_of_uid(hull.uid)
        if truth.row.name != hull.name or not hull.name.startswith(prefix):
            raise self._model.finds(f"{hull} comes in the feed of {prefix}*, and is {truth.row}")
        return truth

    def _require_lost(self, gap: Gap) -> None:
        truth = self._model.truth_of_uid(gap.hull.uid)
        if truth.past.whole and not truth.deleted:
            raise self._model.finds(f"the past of {gap.hull} was to be kept for ever: {gap}")

    def _complete(self, prefix: str, read: _Read) -> None:
        """Nothing is missing that was committed before the time of a position."""
        for name, truth in self._model.alive.items():
            if name.startswith(prefix):
                least = sum(time < read.position.time for time in truth.past.times[1:])
                if max(read.at.get(truth.row.uid, 0), read.before(truth)) < least:
                    raise self._model.finds(f"of {name} comes {read.at}, and not all to {least}: {read.position}")


def _passed(gaps: list[Gap], after: int) -> int:
    """The last revision of the gap that follows a revision, and of those that follow that; else the same."""
    for gap in sorted(gaps, key=lambda each: each.first):
        if gap.first <= after + 1:
            after = max(after, gap.last)
    return after
