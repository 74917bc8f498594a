"""The kinds of receivers by the scheme of their URL. A new kind is a module with a Target and a line in TARGETS."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from .bodies.body import CLOUD_EVENTS, Body, Header
from .sources import Source
from .target import Target, check_places

WITHOUT_SCHEME = re.compile(r"[^/@\s]+:\d+(/.*)?")  # HOST:PORT


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetOptions:
    """What may be said of a receiver beside its URL.

    Attributes:
        keys: those that sign webhooks.
        unsigned: whether webhooks are not signed.
        batch: the most letters in a delivery.
        timeout: the seconds for a delivery.
        allow_private: whether webhooks may go to private networks.
        body: makes the bodies.
        headers: those that webhooks get besides.
        consumer: the name of the relay's consumer; None for letters that are sent again.
        kafka_config: a file of settings for Kafka.
    """

    keys: Sequence[bytes]
    unsigned: bool
    batch: int
    timeout: float
    allow_private: bool
    body: Body = CLOUD_EVENTS
    headers: Sequence[Header] = ()
    consumer: str | None = None
    kafka_config: Path | None = None


Open = Callable[[str, TargetOptions], Target]


def target_of(to: str, options: TargetOptions) -> Target:
    """The target that a URL, a path or a dash stands for. Call it in a running event loop.

    Raises:
        ValueError: there is no such target, or an option does not suit it.
        OSError: the file cannot be opened.
    """
    if WITHOUT_SCHEME.fullmatch(to):
        raise ValueError(f"--to {to}: did you mean http://{to}? A file of that name is ./{to}")
    scheme = urlsplit(to).scheme
    if scheme not in LINES:
        check_places(urlsplit(to)._replace(netloc="").geturl())  # a password is nothing to show
    elif any(f"{{{each}}}" in to for each in ("kind", "name", "type", "fence")):
        raise ValueError(f"--to {to}: {{kind}}, {{name}} and {{type}} are filled in in URLs; one file has all events")
    if scheme not in WEBHOOKS and options.batch > 1:
        raise ValueError("--batch is for webhooks (http and https)")
    if scheme != "kafka" and options.kafka_config is not None:
        raise ValueError("--kafka-config is for kafka://")
    if scheme not in WEBHOOKS and options.headers:
        raise ValueError("--header is for webhooks (http and https)")
    if options.body is not CLOUD_EVENTS and (scheme in LINES or options.batch > 1):
        raise ValueError("--body-template is for single events to URLs: files and batches have CloudEvents")
    if scheme not in TARGETS:
        *others, last = (each for each in TARGETS if each not in LINES)
        raise ValueError(f"--to {scheme}: must be a URL of {', '.join(others)} or {last}, a file or -")
    return TARGETS[scheme](to, options)


def check_kinds(to: str, sources: Sequence[Source]) -> None:
    """ValueError where {fence} of a URL is the name of an alarm."""
    if "{fence}" in to and (alarm := next((each for each in sources if each.kind == "alarm"), None)):
        raise ValueError(f"--to has {{fence}}, but {alarm} is no fence: {{name}} is the name of either")


def _webhook(to: str, options: TargetOptions) -> Target:
    from .webhook import Webhook

    if not options.keys and not options.unsigned:
        raise ValueError("webhooks are signed: give --secret or DYNHULL_WEBHOOK_SECRET, or --unsigned")
    return Webhook(
        to,
        options.keys,
        batch=options.batch,
        timeout=options.timeout,
        allow_private=options.allow_private,
        body=options.body,
        headers=options.headers,
    )


def _mqtt(to: str, options: TargetOptions) -> Target:
    from .mqtt import Mqtt

    return Mqtt(to, options.timeout, options.body)


def _jetstream(to: str, options: TargetOptions) -> Target:
    from .jetstream import JetStream

    return JetStream(to, options.timeout, options.body)


def _kafka(to: str, options: TargetOptions) -> Target:
    from .kafka import KafkaTarget
    from .kafka_settings import read_settings

    return KafkaTarget(to, options.timeout, options.consumer, options.body, read_settings(options.kafka_config))


def _lines(to: str, _: TargetOptions) -> Target:
    from .lines import LinesFile, StandardOutput

    if not to:
        raise ValueError("--to is empty: give a URL, a file or -")
    return StandardOutput() if to == "-" else LinesFile(Path(to.removeprefix("file://")))


WEBHOOKS: dict[str, Open] = {"http": _webhook, "https": _webhook}
LINES: dict[str, Open] = {"": _lines, "file": _lines}
# Each imports what it needs, which takes long, only when it is asked for.
TARGETS = {**WEBHOOKS, "mqtt": _mqtt, "mqtts": _mqtt, "nats": _jetstream, "tls": _jetstream, "kafka": _kafka, **LINES}
