"""The rows of the consumers of feeds: among those of fences, as consumers of none."""

import json
from dataclasses import dataclass

from ...state.feed_consumers import ConsumerId, FedBy, FeedConsumer
from ...state.fences.model.records import Consumer
from .encoding import weight
from .fence_rows import consumer_values

# In place of the number of a fence.
NO_FENCE = 0


@dataclass(frozen=True, slots=True)
class StoredFeedConsumer:
    """A consumer, with the number and the weight of its row."""

    consumer: FeedConsumer
    place: int
    weight: int


def feed_consumer_values(consumer: FeedConsumer) -> tuple[int, str, int, int, int]:
    """The values of the columns, with their checksum."""
    (feed, prefix), name = consumer.id
    text = json.dumps([feed, prefix, name, consumer.uid])
    return consumer_values(NO_FENCE, Consumer(text, consumer.acknowledged, consumer.time))


def feed_consumer_from(text: str, acknowledged: int, time: int, stored: int, place: int) -> StoredFeedConsumer:
    """The inverse of `feed_consumer_values`. ValueError, TypeError, AttributeError or struct.error for others."""
    feed, prefix, name, uid = json.loads(text)
    found = FeedConsumer(ConsumerId(FedBy(feed, prefix), name), uid, acknowledged, time)
    if feed_consumer_values(found) != (NO_FENCE, text, acknowledged, time, stored):
        raise ValueError("its checksum differs")
    return stored_feed_consumer(found, place)


def stored_feed_consumer(consumer: FeedConsumer, place: int) -> StoredFeedConsumer:
    """A consumer in a row with this number."""
    *_, stored = feed_consumer_values(consumer)
    return StoredFeedConsumer(consumer, place, weight(stored, NO_FENCE))
