"""The batches of a feed, as values."""

from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

import numpy as np
import numpy.typing as npt

from dynhull._value import Value
from dynhull.arrays import Points
from dynhull_proto.v1 import batch_pb2, feed_pb2, points_pb2

from ._accuracies import decode_accuracies
from ._batch import Only
from ._keys import KeyTuple, decode_names
from ._messages import BATCH, CAUSES, Cause, decode_points
from ._quarantine_messages import Quarantine, decode_quarantine
from ._times import Times, decode_time, decode_times

ONLY: dict[int, Only] = {
    batch_pb2.PUT_CONDITION_IF_ABSENT: "absent",
    batch_pb2.PUT_CONDITION_IF_PRESENT: "present",
}


def _no_points() -> Points:
    return np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FeedHeld(Value):
    """What a batch has changed in the quarantine of a hull.

    Attributes:
        dropped: keys whose held position was dropped, or let in. Before `keys`.
        keys: keys that are held, instead of what was held of them before.
        points: (n, 2) the positions held.
        times: (n,) their times as datetime64[us] in UTC, NaT for one without; None if none has one.
        rules: the rules from now on; None for the same as before.
    """

    dropped: KeyTuple
    keys: KeyTuple
    points: Points
    times: Times | None = None
    rules: Quarantine | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FeedBatch(Value):
    """One revision of a hull, and what made it.

    Applied in order to a copy of the points before it, batches give the points after it. A copy follows the rules that
    its hull was created with: where the later event time wins, a position with an earlier one changes nothing; of a
    window with a largest number of points, the oldest leave beyond it.

    Attributes:
        type: "batch". "lost": batches that are kept no more, and were not sent, from revision `first` to `last`.
            "progress": nothing has happened for a while. Of many hulls: "deleted": the hull was deleted, with what was
            not sent of it. "hulls": the feed goes on after an earlier position, and there are these `hulls`; what the
            caller has of others is no more.
        hull: the name of the hull.
        revision: the revision; of "lost" and "progress" the one that they lead to.
        uid: the uid of the hull.
        commit: the number of the commit: revisions with the same number were committed together, as those of a transfer
            are. None where that is not known.
        more: whether the next batch of the feed of many hulls was committed together with this one.
        time: when it was committed, by the clock of the server, which never goes back; None where that is not known.
        cause: what made it: "batch", "expiry" or "recenter".
        keys: the keys put.
        points: (n, 2) their positions.
        removed: the keys removed; some may be missing.
        inserts: (n, 2) the points inserted into a hull without keys.
        deletes: (n, 2) the points deleted from it.
        times: (n,) the event times of the points put or inserted, as datetime64[us] in UTC, NaT for one without; None
            if none has one.
        expire_times: (n,) when the points put leave the hull, likewise.
        accuracies: (n,) how far the points put may be from where the keys really are; None if none has an error.
        only: "absent" or "present" if only keys that are so are put; None for all.
        lenient: whether some of the deletes are of points that the hull did not have.
        expired: the number of points that have left because of the time.
        expired_until: points with this time or an earlier one have left; None where only keys left whose expire time is
            `clock` or earlier.
        clock: the clock of the hull after it; None for a hull without one.
        center: longitude and latitude of the centre of a geographic hull, where this revision sets or moves it.
        held: what it has changed in the quarantine; None for nothing.
        first: of "lost", the first revision that is missing; 0 otherwise. Of many hulls it is 1 where the server does
            not know how many of them the caller has.
        last: of "lost", the last revision that is missing; 0 otherwise.
        after: what a later feed continues after: the revision; of many hulls a position, None where the next one
            belongs to the same commit or the same message.
        hulls: of "hulls", the uid of each hull by its name; None otherwise.
    """

    type: Literal["batch", "lost", "progress", "deleted", "hulls"]
    hull: str
    revision: int
    uid: str = ""
    commit: int | None = None
    more: bool = False
    time: datetime | None = None
    cause: Cause = BATCH
    keys: KeyTuple = ()
    points: Points = field(default_factory=_no_points)
    removed: KeyTuple = ()
    inserts: Points = field(default_factory=_no_points)
    deletes: Points = field(default_factory=_no_points)
    times: Times | None = None
    expire_times: Times | None = None
    accuracies: npt.NDArray[np.float64] | None = None
    only: Only | None = None
    lenient: bool = False
    expired: int = 0
    expired_until: datetime | None = None
    clock: datetime | None = None
    center: tuple[float, float] | None = None
    held: FeedHeld | None = None
    first: int = 0
    last: int = 0
    after: int | bytes | None = 0
    hulls: dict[str, str] | None = None


@dataclass(frozen=True, slots=True)
class FeedConsumer:
    """A durable reader of the feed of a hull, or of a prefix.

    Attributes:
        name: its name.
        hull: the hull that it reads; None for a prefix.
        prefix: the prefix that it reads; None for a hull.
        after: what it has acknowledged: a revision; of a prefix a position, empty for the beginning.
        uid: the uid of the hull with that revision; empty for a prefix.
        backlog: of a hull, the batches that it has not acknowledged; of a prefix, the commits from the acknowledged one
            to that of the newest batch, also those of other hulls.
        lost: of a hull, how many of them are kept no more.
        replaced: whether the hull is not there, was created again or restored since then, or the data of the prefix
            were restored.
    """

    name: str
    hull: str | None
    prefix: str | None
    after: int | bytes
    uid: str
    backlog: int
    lost: int
    replaced: bool


def decode_feed_consumer(message: feed_pb2.FeedConsumer) -> FeedConsumer:
    """A durable consumer."""
    hull = message.hull if message.HasField("hull") else None
    prefix = message.prefix if message.HasField("prefix") else None
    after: int | bytes = message.acknowledged_revision if prefix is None else message.position
    return FeedConsumer(message.name, hull, prefix, after, message.uid, message.backlog, message.lost, message.replaced)


def decode_feed_batch(message: feed_pb2.FeedBatch, after: int | None) -> FeedBatch:
    """A batch as received."""
    batch, puts = message.batch, message.batch.puts
    times = batch.insert_times if batch.HasField("insert_times") else puts.times if puts.HasField("times") else None
    return FeedBatch(
        "batch",
        message.hull,
        message.revision,
        message.uid,
        commit=message.commit or None,
        more=message.more,
        time=decode_time(message.commit_time) if message.HasField("commit_time") else None,
        cause=CAUSES.get(message.cause, BATCH),
        keys=decode_names(puts.keys),
        points=decode_points(puts.points),
        removed=decode_names(batch.removes),
        inserts=decode_points(batch.inserts),
        deletes=decode_points(batch.deletes),
        times=None if times is None else _known(times),
        expire_times=_known(puts.expire_times) if puts.HasField("expire_times") else None,
        accuracies=decode_accuracies(puts),
        only=ONLY.get(puts.condition),
        lenient=batch.missing_points == batch_pb2.MISSING_POINT_POLICY_COUNT,
        expired=message.expired_count,
        expired_until=decode_time(message.expired_until) if message.HasField("expired_until") else None,
        clock=decode_time(message.clock_time) if message.HasField("clock_time") else None,
        center=(message.center.longitude, message.center.latitude) if message.HasField("center") else None,
        held=_decode_held(message.held) if message.HasField("held") else None,
        after=after,
    )


def _decode_held(message: feed_pb2.FeedHeld) -> FeedHeld:
    return FeedHeld(
        decode_names(message.dropped),
        decode_names(message.keys),
        decode_points(message.positions),
        _known(message.times) if message.HasField("times") else None,
        decode_quarantine(message.rules) if message.HasField("rules") else None,
    )


def _known(message: points_pb2.Times) -> Times:
    """Times as received, NaT for those that are none."""
    times = decode_times(message)
    return np.where(times == np.datetime64(0, "us"), np.datetime64("NaT", "us"), times)
