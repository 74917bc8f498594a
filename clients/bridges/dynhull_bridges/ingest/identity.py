"""Whether a log is the one whose messages a hull has: one that is made again under its name counts from 1 again."""

import structlog

from dynhull_client import AsyncHullClient

from .feed import Feed, producer_name

log = structlog.get_logger("dynhull_ingest")
ANSWER = 10.0  # seconds for an answer of the server


def adopted(feed: str) -> None:
    """Log that a place without an identity is taken for one in this log."""
    log.info("an earlier version kept the place without the identity of its log: it is taken for this log", feed=feed)


def made_again(what: str) -> ValueError:
    """The error of a log that was made again under its name."""
    return ValueError(
        f"{what}: it was created again. Give another --producer, which reads all of it, or another hull: under this "
        "name, new messages would be taken for those that the hull has"
    )


class LogIdentity:
    """The identity of the log of a feed, which each hull keeps from before its first message.

    A hull keeps it as the number of another producer. One that has messages but no identity adopts that of this log.
    """

    def __init__(self, client: AsyncHullClient, feed: Feed) -> None:
        self._client = client
        self._feed = feed
        self._number = 0
        self._adopted = False  # whether the log says so

    def is_now(self, number: int) -> None:
        """Note the identity, 0 where the broker says none; ValueError if the feed began with another one before."""
        if number and self._number not in (0, number):
            raise made_again(f"{self._feed.name} is another log than before")
        self._number = number or self._number

    async def require_in(self, hull: str) -> None:
        """Have a hull take the messages of this log only.

        Raises:
            ValueError: the hull has messages of another log.
            DynhullError: the server does not answer, or refuses.
        """
        producer = self._feed.producer
        if producer is None or not self._number:
            return
        keeper = producer_name("log-of", producer)
        kept = await self._client.last_sequence(hull, keeper, timeout=ANSWER)
        if kept not in (0, self._number):
            raise made_again(f"{self._feed.name} is another log than the one whose messages are in {hull!r}")
        if kept:
            return
        if not self._adopted and await self._client.last_sequence(hull, producer, timeout=ANSWER):
            self._adopted = True
            adopted(self._feed.name)
        await self._client.apply(hull, producer=keeper, sequence=self._number, may_skip=True, timeout=ANSWER)
