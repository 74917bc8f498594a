"""The consumers of feeds: readers whose place is remembered, and what is committed of them."""

from dataclasses import dataclass
from typing import NamedTuple


class FedBy(NamedTuple):
    """What a feed has: the batches of the hull of that name, or of all hulls whose names begin with it."""

    name: str
    prefix: bool = False


class ConsumerId(NamedTuple):
    """A consumer among those of all feeds. They are ordered by these."""

    feed: FedBy
    name: str


@dataclass(frozen=True, slots=True)
class FeedConsumer:
    """A reader, and what it has acknowledged.

    Attributes:
        id: whose feed it reads, and its name.
        uid: that of the hull with the acknowledged revision; of a prefix, the incarnation of the data.
        acknowledged: the last revision that it has acknowledged; of a prefix, the number of the last commit.
        time: of a prefix, the time of that commit, in microseconds since 1970; else 0.
    """

    id: ConsumerId
    uid: str
    acknowledged: int
    time: int = 0


@dataclass(frozen=True, slots=True)
class PutFeedConsumer:
    """A consumer, new or changed."""

    consumer: FeedConsumer


@dataclass(frozen=True, slots=True)
class DropFeedConsumer:
    """The deletion of a consumer; of one that there is not, nothing."""

    id: ConsumerId
