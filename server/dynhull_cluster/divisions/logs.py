"""The logs of roots and shards, in the storage of the engine. Their methods block, and run in threads of their own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_server.engine.driver import Driver
from dynhull_server.engine.shard_store import ShardStore
from dynhull_server.engine.waiter import Waiter
from dynhull_server.state.batch import NO_POINTS
from dynhull_server.state.hull import Hull
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.records import (
    EPOCHS,
    STEPS,
    Append,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    Keys,
    PointRows,
    Record,
    Rows,
    Shares,
    Tally,
)
from dynhull_server.state.requests import Follow, ReadHull
from dynhull_server.state.root_state import RootState
from dynhull_server.storage.port import DamagedError

from ..shards.epochs import Epochs
from ..shards.logs import Decided, Decision, FencedError
from ..shards.messages import Corners, Effect, VertexChange


class StoredRootLog:
    """The decisions of a hull: the log of the hull that its readers see.

    Args:
        driver: drives the core that has the hull.
        hull: the hull.
        epochs: those of the roots of this process.
        known: the greatest epoch that its shards know of.

    Attributes:
        due: of each shard, the time by the server's clock before which none of its points leaves.
    """

    def __init__(self, driver: Driver, hull: Hull, epochs: Epochs, known: int) -> None:
        self._driver = driver
        self._hull = hull
        self._epochs = epochs
        self._epoch = known
        self._settings = hull.row.settings
        self.due: dict[int, int | None] = {}

    def begin(self, epoch: int | None) -> tuple[int, Decided]:
        """Begin an epoch that no root had before."""
        if epoch not in (None, self._epoch):
            raise FencedError
        self._epoch = self._epochs.next(self._epoch)
        _, decided = self._driver.ask_from_thread(ReadHull(Waiter(), self._hull, _decided))
        return self._epoch, decided

    def decide(self, epoch: int, decisions: Sequence[Decision]) -> None:
        """Add decisions, and have the readers see them."""
        if epoch != self._epoch:
            raise FencedError
        records = [record for decision in decisions for record in self._records(decision)]
        for decision in decisions:
            if decision.division is not None:
                self.due = {}
            self.due |= {shard: effect.totals.due for shard, effect in decision.effects.items()}
        self.follow(records)

    def follow(self, records: list[Record]) -> None:
        """Have the readers see revisions, and the core when points leave next."""
        due = min((each for each in self.due.values() if each is not None), default=None)
        self._driver.ask_from_thread(Follow(Waiter(), self._hull, records, due))

    def _records(self, decision: Decision) -> list[Record]:
        effects = list(decision.effects.values())
        if decision.replaced is not None:
            tallies = {shard: _tally(effect) for shard, effect in decision.effects.items()}
            shares = Shares(tallies, division=decision.division)
            rows = self._rows([decision.replaced])
            return [Record(decision.revision, rows, clock=decision.clock, shares=shares, cause=decision.cause)]
        tallies = {shard: _tally(decision.effects[shard]) for shard in sorted(decision.shards)}
        left = self._rows([effect.left for effect in effects if effect.left is not None])
        if decision.cause == "expiry":
            return [_expiry(decision.revision, left, decision.clock, tallies)]
        changed = self._rows([effect.changed for effect in effects if effect.changed is not None])
        record = Record(
            decision.revision,
            changed,
            decision.producer,
            decision.sequence,
            decision.clock,
            may_skip=decision.may_skip,
            shares=Shares(tallies),
            cause=decision.cause,
        )
        if not any(effect.expired for effect in effects):
            return [record]
        return [_expiry(decision.revision - 1, left, decision.clock, {}), record]

    def _rows(self, changes: Sequence[VertexChange]) -> Rows:
        """The vertices that have come and gone."""
        come = np.concatenate([NO_POINTS, *(each.come.points for each in changes)])
        if self._settings.identity == "multiset":
            return PointRows(come, np.concatenate([NO_POINTS, *(each.gone.points for each in changes)]))
        put = [key for each in changes for key in _keys(each.come)]
        here = set(put)
        removed = [key for each in changes for key in _keys(each.gone) if key not in here]
        return KeyRows(_packed(put, self._settings), come, _packed(removed, self._settings))


class StoredShardLog:
    """The steps of a shard. Made in the thread of the shard.

    Args:
        store: has the storage.
        row: the shard.

    Attributes:
        epoch: the last epoch that was begun, 0 before the first.
        step: the last step.
        revision: the last revision in the storage: of steps and epochs.
        added: the number of points in steps since the snapshot that it has read.
    """

    def __init__(self, store: ShardStore, row: HullRow) -> None:
        self._store = store
        self._row = row
        self._keeps = store.keeps
        self._kept: Kept | None = store.read(row.number) if self._keeps else Kept()
        kept = self._kept
        last = kept.sequences
        self.epoch, self.step = last.get(EPOCHS, 0), last.get(STEPS, 0)
        self.revision = kept.last_revision
        self.added = sum(len(record.rows) for record in kept.records)
        # Of each step since the snapshot: its number, and the revision, the step and the clock before it.
        self._before: list[tuple[int, int, int, int | None]] = []
        self._clock, step, revision = kept.clock, kept.producers.get(STEPS, 0), kept.revision
        for record in kept.records:
            if record.producer == STEPS and record.sequence != step:
                self._before.append((record.sequence, revision, step, self._clock))
                step = record.sequence
            self._clock, revision = record.clock, record.revision

    def begin(self, epoch: int, decided: int) -> None:
        """Begin an epoch, and drop the steps after `decided`."""
        changes, revision, step, clock = self._without(decided + 1)
        nothing = _nothing(self._row.settings)
        mark = Record(revision + 1, nothing, EPOCHS, epoch, clock, may_skip=True, cause="epoch")
        self._commit([*changes, Append(self._row.number, [mark])])
        if changes:
            self._kept = None
        elif self._kept is not None:
            self._kept.records.append(mark)
        self._dropped(step)
        self.epoch, self.step, self.revision, self._clock = epoch, step, revision + 1, clock

    def add(self, steps: Sequence[tuple[int, list[Record]]]) -> None:
        """Add steps, each in a row of its own, so that those at the end can be dropped."""
        changes: list[Any] = []
        self._before = []  # what came before is decided
        self._kept = None
        revision, step, clock, points = self.revision, self.step, self._clock, 0
        for number, records in steps:
            self._before.append((number, revision, step, clock))
            numbered = []
            for record in records:
                revision += 1
                numbered.append(replace(record, revision=revision, producer=STEPS, sequence=number, may_skip=True))
                points += len(record.rows)
            changes.append(Append(self._row.number, numbered))
            step, clock = number, records[-1].clock
        self._commit(changes)
        self.revision, self.step, self._clock = revision, step, clock
        self.added += points

    def drop(self, number: int) -> None:
        """Drop the steps from this number on."""
        changes, revision, step, clock = self._without(number)
        if changes:
            self._commit(changes)
            self._dropped(step)
            self._kept = None
            self.revision, self.step, self._clock = revision, step, clock

    def read(self) -> tuple[Kept, int]:
        """All points, and the number of the last step."""
        kept = self._kept or self._store.read(self._row.number)
        self._kept = None
        return kept, self.step

    def kept(self, contents: Any) -> Kept:
        """What a snapshot has at the present revision, if these are the contents and all steps are decided."""
        producers = {STEPS: self.step, EPOCHS: self.epoch}
        return Kept(self.revision, contents.stored(), producers, clock=contents.clock, skipping=frozenset(producers))

    def _without(self, number: int) -> tuple[list[Any], int, int, int | None]:
        """What drops the steps from this number on; the revision, the step and the clock that are left."""
        if self.step < number:
            return [], self.revision, self.step, self._clock
        found = next((each for each in self._before if each[0] >= number), None)
        if found is None:
            raise DamagedError(f"shard {self._row.settings.shard} of {self._row.name!r} keeps steps that were undone")
        _, revision, step, clock = found
        cut = self._store.cut(self._row.number, revision) if self._keeps else None
        return [] if cut is None else [cut], revision, step, clock

    def _dropped(self, step: int) -> None:
        self._before = [each for each in self._before if each[0] <= step]

    def _commit(self, changes: list[Any]) -> None:
        if self._keeps:
            self._store.commit(changes)


def _decided(state: HullState) -> Decided:
    assert isinstance(state, RootState)  # nobody else has a root
    steps = {shard: tally.step for shard, tally in enumerate(state.tallies)}
    counts, number = state.counts, max(steps.values())
    more = counts.revision, counts.cause, counts.clock, state.producers, state.skipping
    return Decided(number, *more, steps, state.division)


def _expiry(revision: int, left: Rows, clock: int | None, tallies: dict[int, Tally]) -> Record:
    return Record(revision, left, clock=clock, shares=Shares(tallies, expiry=True), cause="expiry")


def _tally(effect: Effect) -> Tally:
    return Tally(effect.number, effect.totals.points, effect.totals.distinct)


def _keys(corners: Corners) -> Sequence[Any]:
    return corners.keys or ()


def _packed(keys: list[Any], settings: HullSettings) -> Keys:
    return PackedKeys.pack(keys) if settings.identity == "str" else np.array(keys, np.uint64)


def _nothing(settings: HullSettings) -> Rows:
    """No change of a shard."""
    if settings.identity == "multiset":
        return PointRows(NO_POINTS, NO_POINTS, times=None if settings.window is None else np.empty(0, np.int64))
    return KeyRows(_packed([], settings), NO_POINTS, _packed([], settings))
