"""Conversion of batches to the messages of feeds."""

from typing import assert_never

import numpy as np

from dynhull_proto.v1 import batch_pb2, feed_pb2, points_pb2

from ..engine.feed import FeedPart
from ..engine.feed_consumers import ConsumerState, standing_of
from ..engine.feed_many import Gap, ManyFeedPart, OfHull
from ..engine.positions import BEGINNING, encode_standings
from ..state.feed_consumers import ConsumerId
from ..state.records import FOREVER, NO_TIME, Cause, Condition, Expiry, HeldChange, KeyRows, PointRows, Record
from .encode import (
    CAUSES,
    encode_accuracies,
    encode_center,
    encode_keys,
    encode_points,
    encode_quarantine,
    encode_times,
)

CONDITIONS: dict[Condition | None, batch_pb2.PutCondition] = {
    None: batch_pb2.PUT_CONDITION_UNSPECIFIED,
    "absent": batch_pb2.PUT_CONDITION_IF_ABSENT,
    "present": batch_pb2.PUT_CONDITION_IF_PRESENT,
}


def encode_feed(part: FeedPart, of: OfHull, encoding: points_pb2.PointEncoding) -> feed_pb2.FeedResponse:
    """What is sent at once of the feed of a hull."""
    message = feed_pb2.FeedResponse(revision=part.revision, uid=of.uid)
    message.batches.extend(encode_record(record, of, encoding) for record in part.records)
    if part.lost is not None:
        message.lost.append(_encode_gap(Gap(of, *part.lost)))
    return message


def encode_many_feed(part: ManyFeedPart, encoding: points_pb2.PointEncoding) -> feed_pb2.FeedResponse:
    """What is sent at once of the feed of many hulls."""
    message = feed_pb2.FeedResponse(position=part.position)
    for of, record, more in part.batches:
        batch = encode_record(record, of, encoding)
        batch.more = more
        message.batches.append(batch)
    message.lost.extend(map(_encode_gap, part.gaps))
    message.gone.extend(map(_encode_hull, part.gone))
    message.hulls.extend(map(_encode_hull, part.there or ()))
    return message


def _encode_gap(gap: Gap) -> feed_pb2.LostBatches:
    return feed_pb2.LostBatches(first_revision=gap.first, last_revision=gap.last, hull=gap.hull.name, uid=gap.hull.uid)


def _encode_hull(hull: OfHull) -> feed_pb2.FedHull:
    return feed_pb2.FedHull(name=hull.name, uid=hull.uid)


def encode_feed_consumer(state: ConsumerState) -> feed_pb2.FeedConsumer:
    """A consumer, and how far it is behind."""
    consumer = state.consumer
    feed, name = consumer.id
    message = feed_pb2.FeedConsumer(name=name, backlog=state.backlog, lost=state.lost, replaced=state.replaced)
    if feed.prefix:
        message.prefix = feed.name
        standing = standing_of(consumer)
        message.position = b"" if standing == BEGINNING else encode_standings([standing])
    else:
        message.hull, message.uid, message.acknowledged_revision = feed.name, consumer.uid, consumer.acknowledged
    return message


def token_of(last: ConsumerId) -> str:
    """The token of the page that follows a consumer."""
    return f"{last.feed.name}:{int(last.feed.prefix)}:{last.name}"


def encode_record(record: Record, of: OfHull, encoding: points_pb2.PointEncoding) -> feed_pb2.FeedBatch:
    """A batch of a hull."""
    message = feed_pb2.FeedBatch(
        hull=of.name,
        uid=of.uid,
        revision=record.revision,
        cause=CAUSES[_cause(record)],
        center=encode_center(record.center),
    )
    if record.committed is not None:
        message.commit = record.committed.number
        message.commit_time.FromMicroseconds(record.committed.time)
    if record.clock is not None:
        message.clock_time.FromMicroseconds(record.clock)
    match record.rows:
        case PointRows() as rows:
            _write_points(rows, message.batch, encoding)
        case KeyRows() as rows:
            _write_keys(rows, message.batch, encoding)
            if rows.held is not None:
                message.held.CopyFrom(_encode_held(rows.held, encoding))
        case Expiry(until, points):
            message.expired_count = points
            if until is not None:
                message.expired_until.FromMicroseconds(until)
        case _:
            assert_never(record.rows)
    return message


def _cause(record: Record) -> Cause | None:
    """What made a revision; those of formats before 11 say so for points that have left alone."""
    return "expiry" if isinstance(record.rows, Expiry) else record.cause


def _write_points(rows: PointRows, batch: batch_pb2.Batch, encoding: points_pb2.PointEncoding) -> None:
    batch.inserts.CopyFrom(encode_points(rows.inserts, encoding))
    batch.deletes.CopyFrom(encode_points(rows.deletes, encoding))
    if rows.lenient:
        batch.missing_points = batch_pb2.MISSING_POINT_POLICY_COUNT
    if rows.times is not None:
        batch.insert_times.CopyFrom(encode_times(rows.times, encoding))


def _write_keys(rows: KeyRows, batch: batch_pb2.Batch, encoding: points_pb2.PointEncoding) -> None:
    puts = batch.puts
    puts.keys.CopyFrom(encode_keys(rows.keys, encoding))
    puts.points.CopyFrom(encode_points(rows.points, encoding))
    puts.condition = CONDITIONS[rows.condition]
    if rows.times is not None and (rows.times != NO_TIME).any():
        puts.times.CopyFrom(encode_times(rows.times, encoding))
    if rows.deadlines is not None and (rows.deadlines != FOREVER).any():
        known = np.where(rows.deadlines == FOREVER, NO_TIME, rows.deadlines)
        puts.expire_times.CopyFrom(encode_times(known, encoding))
    if rows.accuracies is not None:
        puts.accuracies.CopyFrom(encode_accuracies(rows.accuracies, encoding))
    batch.removes.CopyFrom(encode_keys(rows.removes, encoding))


def _encode_held(change: HeldChange, encoding: points_pb2.PointEncoding) -> feed_pb2.FeedHeld:
    rows = change.rows
    message = feed_pb2.FeedHeld(
        dropped=encode_keys(change.dropped, encoding),
        keys=encode_keys(rows.keys, encoding),
        positions=encode_points(rows.points, encoding),
        rules=encode_quarantine(change.rules),
    )
    if (rows.times != NO_TIME).any():
        message.times.CopyFrom(encode_times(rows.times, encoding))
    return message
