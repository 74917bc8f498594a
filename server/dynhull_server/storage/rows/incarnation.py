"""A copy of a database is another incarnation of its hulls and fences: their uids are other ones.

Readers and writers that know what was after the copy was made can therefore notice that it is not there. The part of a
uid before INCARNATION stays, and what follows it is new with each copy: the same for all databases of a server, since a
hull over shards has its uid in several.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from secrets import token_hex

import numpy as np

from dynhull.keys import Keys, PackedKeys

from ...state.changes import Change
from ...state.fences.events.block import AppendEvents, block_of
from ...state.fences.model.dwell import Dwelling
from ...state.fences.model.records import (
    AddFence,
    Cause,
    ChangeFence,
    Consumer,
    DropEvents,
    DropFence,
    EventType,
    FenceEvent,
    Inside,
    KeptFence,
    Key,
    Members,
    PutConsumer,
    PutDelays,
)
from ...state.fences.recovery.restored import members_after
from ...state.records import INCARNATION, NO_TIME
from .fence_ledger import DropInside, inside_steps
from .fence_reading import read_fences
from .group import AnyStep, ChangeHull
from .ledger import HullRows, Ledger
from .tables import Reader

MICROSECONDS = 10**6


def new_incarnation() -> str:
    """What distinguishes a copy from all others."""
    return token_hex(4)


def renewing(ledger: Ledger, incarnation: str) -> Iterator[Change | AnyStep]:
    """The changes that make the hulls and fences of a database those of another incarnation. O(hulls and fences)."""
    for hull in ledger.hulls.values():
        yield ChangeHull(replace(hull.row, uid=_renewed(hull.row.uid, incarnation)))
    for fence in ledger.fences.values():
        yield ChangeFence(replace(fence.row, uid=_renewed(fence.row.uid, incarnation)))


def anew(reader: Reader, ledger: Ledger, incarnation: str) -> Iterator[Iterable[Change | AnyStep]]:
    """The changes, to be adopted one after the other, that make of a database one that may lack what callers have had.

    Commit them together: half of them would leave fences without consumers.
    """
    yield renewing(ledger, incarnation)
    yield from beginning_anew(reader, ledger)


def beginning_anew(reader: Reader, ledger: Ledger) -> Iterator[list[Change | AnyStep]]:
    """The changes, to be adopted one after the other, after which the fences have one event, who is inside.

    The events since the backup are unknown, and those in it have perhaps been sent, with other uids.
    So a sequence is left out: to each consumer that was there, all events that it has not acknowledged are lost.
    """
    hulls = {hull.row.name: hull for hull in ledger.hulls.values()}
    kept = [each for each in read_fences(reader, list(ledger.fences.values())) if each is not None]
    numbers = range(ledger.totals.next_number, ledger.totals.next_number + len(kept))
    drops: list[Change | AnyStep] = []
    adds: list[Change | AnyStep] = []
    rest: list[Change | AnyStep] = []
    for number, fence in zip(numbers, kept, strict=True):
        last = fence.last + 1  # stands for those since the backup
        inside = replace(_inside(fence, hulls), sequence=last)
        drops.append(DropFence(fence.row.number))
        adds.append(AddFence(replace(fence.row, number=number), inside))
        rest += _beginning(fence, number, inside, hulls, ledger)
    yield [*drops, *adds]
    yield rest


def _beginning(
    fence: KeptFence, number: int, inside: Inside, hulls: dict[str, HullRows], ledger: Ledger
) -> Iterator[Change | AnyStep]:
    """What follows on a fence that begins anew: its consumers, its delays and the event with who is inside."""
    lost = inside.sequence
    for each in fence.consumers.values():
        missed = lost - max(each.acknowledged, fence.first - 1)
        yield PutConsumer(number, Consumer(each.name, each.acknowledged, each.lost + missed))
    if fence.delays:
        yield PutDelays(number, dict(fence.delays))
    event = _snapshot(fence, inside, hulls)
    yield AppendEvents(block_of({number: [event]}))
    yield DropEvents(number, event.sequence)
    yield from inside_steps(number, replace(inside, sequence=event.sequence), lambda: next(ledger.inside_ids))
    yield DropInside(number, lost)


def _snapshot(fence: KeptFence, inside: Inside, hulls: dict[str, HullRows]) -> FenceEvent:
    area = fence.row.config.area_hull
    everybody = EventType.SNAPSHOT, Cause.CREATED, "", None, 0, 0 if area is None else hulls[area].last
    members = tuple(each._replace(since=None) for each in inside.members)
    return FenceEvent(inside.sequence + 1, *everybody, None, None, None, NO_TIME, inside.time, inside=members)


def _inside(fence: KeptFence, hulls: dict[str, HullRows]) -> Inside:
    """Who is inside of a fence after its last event, and since when they wait for their dwell event."""
    row = fence.row
    dwelling = None
    if row.config.dwell:
        dwelling = Dwelling(row.waits, fence.inside.members)
        dwelling.follow(fence.events)
    members = []
    for hull, found in members_after(fence).items():
        if not found and row.config.kind != "other" and row.config.rule is None:
            continue
        keys = _packed(found)
        since = None if dwelling is None else dwelling.times(hull, keys)
        members.append(Members(hull, keys, hulls[hull].last, since))
    times = [fence.inside.time, row.waits.time, *(event.time for event in fence.events[-1:])]
    return Inside(fence.last, tuple(members), max(int(row.created * MICROSECONDS), *times))


def _packed(keys: Iterable[Key]) -> Keys:
    """Keys of one hull, ascending."""
    found = list(keys)
    if found and isinstance(found[0], int):
        return np.array(sorted(found), np.uint64)
    return PackedKeys.pack(sorted(map(str, found), key=str.encode))


def _renewed(uid: str, incarnation: str) -> str:
    return f"{uid.partition(INCARNATION)[0]}{INCARNATION}{incarnation}"
