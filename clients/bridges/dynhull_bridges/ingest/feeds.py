"""The kinds of feeds by the scheme of their URL. A new kind is a module with a Feed and a line in FEEDS."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from .feed import Feed, check_producer
from .mapping import Mapping

Find = Callable[[], Awaitable[Sequence[Feed]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedOptions:
    """What may be said of a feed beside its URL.

    Attributes:
        hull: the name of the hull that the points are for.
        producer: the name by which the server numbers the batches; None for that of the feed.
        mapping: what of a message is a point.
        to_end: whether to end at what is the end now.
        ping_interval: the seconds between questions whether the broker is still there.
        kafka_config: a file of settings for Kafka.
    """

    hull: str
    producer: str | None
    mapping: Mapping
    to_end: bool
    ping_interval: float
    kafka_config: Path | None = None


def feeds_of(url: str, options: FeedOptions) -> Find:
    """Finds the feeds that a URL stands for; it raises FeedError if the broker, which has to be asked, does not answer.

    Raises:
        ValueError: there are none, or an option does not suit them. OSError: there is no such file.
    """
    if options.producer is not None:
        check_producer(options.producer)
    scheme = urlsplit(url).scheme
    if scheme not in FEEDS:
        raise ValueError(
            f"the URL begins with {f'{scheme}:' if scheme else 'no scheme'}; there are mqtt(s)://HOST/FILTER, "
            "nats://HOST/STREAM[/SUBJECT] (tls:// encrypts) and kafka://HOST:PORT/TOPIC"
        )
    if scheme != "kafka" and options.kafka_config is not None:
        raise ValueError("--kafka-config is for kafka://")
    return FEEDS[scheme](url, options)


def _mqtt(url: str, options: FeedOptions) -> Find:
    from .mqtt import MqttSource

    if not options.mapping.keyed:
        raise ValueError(
            "MQTT has no numbers: a message that comes twice would be two points. Give --key, whose point it "
            "moves to the same place again"
        )
    if options.producer is not None:
        raise ValueError("--producer is for NATS and Kafka, which number their messages")
    if options.to_end:
        raise ValueError("--to-end is for NATS and Kafka: a subscription of MQTT has no end")
    return _known([MqttSource(url, options.hull, options.ping_interval)])


def _jetstream(url: str, options: FeedOptions) -> Find:
    from .jetstream import JetStreamSource

    return _known([JetStreamSource(url, options.producer, options.mapping.digest, options.ping_interval)])


def _kafka(url: str, options: FeedOptions) -> Find:
    from ..kafka_settings import read_settings
    from .kafka import Topic

    settings = read_settings(options.kafka_config)
    return Topic(url, options.producer, options.mapping.digest, settings, options.ping_interval).partitions


def _known(feeds: Sequence[Feed]) -> Find:
    async def found() -> Sequence[Feed]:
        return feeds

    return found


# Each imports what it needs, which takes long, only when it is asked for.
FEEDS: dict[str, Callable[[str, FeedOptions], Find]] = {
    "mqtt": _mqtt,
    "mqtts": _mqtt,
    "nats": _jetstream,
    "tls": _jetstream,
    "kafka": _kafka,
}
