"""What the ingest reads from: messages in order, and how far they have been taken."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ..refusals.table import Meaning

UNSAFE = re.compile(r"[^A-Za-z0-9._/-]")
LONGEST_PRODUCER = 200
PING_INTERVAL = 10.0  # seconds between questions whether the broker is still there


class FeedError(Exception):
    """The broker cannot be reached for now, or has lost the connection: the feed begins again."""


class DoubtfulError(FeedError):
    """The broker refuses what would be final, but says the same while it is recovering."""


def refusal(meaning: Meaning, message: str) -> FeedError | ValueError:
    """The error that a refusal of a broker is, by what it means."""
    match meaning:
        case Meaning.FINAL:
            return ValueError(message)
        case Meaning.DOUBTFUL:
            return DoubtfulError(message)
        case Meaning.PASSES:
            return FeedError(message)


def feed_error(broker: str, error: BaseException) -> FeedError:
    """The error of a broker's client as one of the feed, with its class, which some clients put in the text."""
    name, text = type(error).__name__, str(error) or ("no answer in time" if isinstance(error, TimeoutError) else "")
    return FeedError(f"{broker}: {text if text.startswith(name) else f'{name}: {text}'.removesuffix(': ')}")


@dataclass(slots=True, eq=False)
class Message:
    """One message of a broker.

    Attributes:
        topic: the topic or subject it was sent to.
        captures: what the wildcards of the filter stand for in it.
        payload: its contents; None for a message without any.
        key: its key, where the broker's messages have one.
        number: its place in the log, from 1, rising and perhaps with gaps; 0 where the broker has no log.
        token: what the feed needs to acknowledge it.
        lost: how many messages between the one before and this one were removed unread, at most.
    """

    topic: str
    captures: tuple[str, ...]
    payload: bytes | None
    number: int = 0
    token: int = 0
    lost: int = 0
    key: bytes | None = None


@dataclass(frozen=True, slots=True)
class Beginning:
    """Where a feed begins.

    Attributes:
        after: the number of the message that it begins after.
        identity: differs from that of any other log that has, had or will have the same name; 0 where there is none.
        oldest: the number of the oldest message that has not been removed; 0 where all that matter are there.
    """

    after: int
    identity: int = 0
    oldest: int = 0


class Feed(Protocol):
    """Messages of one log, or of one subscription where the broker has no log.

    Attributes:
        name: what it reads, without secrets: for messages and metrics.
        producer: the name under which the log's numbers are counted in a hull; None where the broker has no log.
    """

    name: str
    producer: str | None

    async def begin(self, known: int | None) -> Beginning:
        """Connect, and begin after the message with this number.

        None begins after the last message that was kept track of with `keep`, or at the oldest one.

        Raises:
            FeedError: the broker cannot be reached, or refuses for now.
            DoubtfulError: it says that what is to be read does not exist.
            ValueError: it refuses for good, or what is to be read is not the log that `known` is about.
        """

    async def read(self) -> Sequence[Message]:
        """The next messages in order, some thousand at most; none if none comes within about a second.

        Raises:
            FeedError: the connection is lost.
        """

    async def keep(self, messages: Sequence[Message]) -> None:
        """Note at the broker that these messages, and all before them, have been taken."""

    async def lag(self) -> int | None:
        """The number of messages that are not read yet; None where the broker has no log."""

    async def close(self) -> None:
        """Disconnect."""


def check_producer(name: str) -> None:
    """ValueError where no producer can have this name."""
    if not name or UNSAFE.search(name) or len(name) > LONGEST_PRODUCER:
        raise ValueError(f"--producer {name!r}: a name has 1 to {LONGEST_PRODUCER} letters, digits and ._-/")


def producer_name(*parts: str) -> str:
    """A name for a producer that stands for these parts: letters, digits and ._-/, at most 200.

    Parts with other characters, as wildcards are, get a digest, so that different logs have different names.
    """
    whole = "/".join(parts)
    name = UNSAFE.sub("_", whole)
    if name == whole and len(name) <= LONGEST_PRODUCER:
        return name
    digest = hashlib.sha256(whole.encode()).hexdigest()[:12]
    return f"{name[: LONGEST_PRODUCER - len(digest) - 1]}-{digest}"
