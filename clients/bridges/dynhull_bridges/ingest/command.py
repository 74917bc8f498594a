"""`dynhull ingest`."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynhull_cli.conditions import ONLY, TTL, Only, conditions
from dynhull_cli.connected import Connect, connecting, fail
from dynhull_cli.durations import duration
from dynhull_cli.reading.time_forms import AMBIGUOUS, FORMAT, ZONE, Ambiguous, TimeUnit, time_form
from dynhull_surface.described import option_of
from dynhull_surface.reasons import Exit

from ..command import KafkaConfig, LogForm

if TYPE_CHECKING:
    from collections.abc import Coroutine


class Tombstones(StrEnum):
    """What a message without contents is."""

    BAD = "bad"
    DELETE = "delete"


class Contents(StrEnum):
    """What messages are made of."""

    JSON = "json"
    NMEA = "nmea"


def _mapping(text: str, *names: str) -> Any:
    return _reading(text, *names, metavar="EXPRESSION")


def _reading(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="From messages to points", **more)


@connecting
def ingest(
    connect: Connect,
    source: Annotated[
        str,
        typer.Argument(
            metavar="URL", help="mqtt(s)://HOST/FILTER, nats://HOST/STREAM[/SUBJECT] or kafka://HOST:PORT/TOPIC."
        ),
    ],
    hull: Annotated[str, _mapping("Name of the hull.", "--hull")],
    x: Annotated[str, _mapping("x, or the longitude.")] = "$.lon",
    y: Annotated[str, _mapping("y, or the latitude.")] = "$.lat",
    key: Annotated[str | None, _mapping("Key of the point. Default: points without keys.")] = None,
    time: Annotated[
        str | None, _mapping("Event time: ISO 8601 with a time zone, or a number since 1970. Default: none.")
    ] = None,
    time_unit: Annotated[
        TimeUnit | None, _reading("Unit of times that are numbers. Default: by the size of the first one; logged.")
    ] = None,
    time_zone: Annotated[str | None, _reading(ZONE)] = None,
    ambiguous: Annotated[Ambiguous, _reading(AMBIGUOUS)] = Ambiguous.REFUSE,
    time_format: Annotated[str | None, _reading(FORMAT)] = None,
    expires: Annotated[
        str | None, _mapping("Time at which the key leaves the hull, written like --time; if missing: never.")
    ] = None,
    accuracy: Annotated[
        str | None,
        _mapping(
            "Accuracy of the position, in units of the coordinates, or metres on the globe; if missing: no error."
        ),
    ] = None,
    only: Annotated[Only | None, _reading(ONLY)] = None,
    ttl: Annotated[str | None, _reading(TTL)] = None,
    format: Annotated[  # noqa: A002
        Contents, _reading("What messages are: JSON, or lines of NMEA sentences, whose positions are $.lon and $.lat.")
    ] = Contents.JSON,
    each: Annotated[
        str | None, _mapping("Path to an array with a point in each element. Default: a message is one point.")
    ] = None,
    tombstones: Annotated[
        Tombstones, _reading("What a message without contents is: bad, or one that deletes its key.")
    ] = Tombstones.BAD,
    create: Annotated[bool, typer.Option(help="Create hulls that do not exist.")] = True,
    geographic: Annotated[
        bool | None,
        typer.Option(
            "--geographic/--plane",
            help="Whether new hulls are on the globe, in degrees, or in the plane. Default: on the globe if the "
            "coordinates are named lon and lat, or the like.",
            show_default=False,
        ),
    ] = None,
    producer: Annotated[
        str | None,
        typer.Option(
            help="Name under which hulls count the numbers of a log; a new one reads all again. Default: made from "
            "stream and subject."
        ),
    ] = None,
    bad: Annotated[Path | None, typer.Option(help="File of JSON lines to add bad messages to.", dir_okay=False)] = None,
    max_bad: Annotated[
        int | None, typer.Option(min=0, help="End if there are more bad messages than this. Default: never.")
    ] = None,
    accept_gaps: Annotated[
        bool,
        typer.Option(
            "--accept-gaps",
            help="NATS, Kafka: go on where the broker has removed messages before they were read, and count them. "
            "Default: end.",
        ),
    ] = False,
    to_end: Annotated[
        bool, typer.Option("--to-end", help="NATS, Kafka: end when no message is left, rather than wait.")
    ] = False,
    kafka_config: KafkaConfig = None,
    patience: Annotated[
        str | None,
        typer.Option(
            help="How long to wait for a broker or a server that does not answer, before ending with exit code 3. "
            "Default: for ever."
        ),
    ] = None,
    grace: Annotated[str, typer.Option(help="How long what is under way may take after SIGTERM.")] = "10s",
    report: Annotated[str, typer.Option(help="Time between two lines about the progress in the log.")] = "10s",
    metrics_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of the metrics page; 0 for a free one.")
    ] = None,
    metrics_host: Annotated[str, typer.Option(help="Address of the metrics page.")] = "127.0.0.1",
    log_format: Annotated[LogForm, typer.Option(help="Form of the log on standard error.")] = LogForm.TEXT,
) -> None:
    """Turn the messages of a broker into points of hulls, until SIGTERM.

        dynhull ingest 'mqtt://broker/fleet/+/position' --hull fleet --key '{1}'
        dynhull ingest nats://broker/POSITIONS/fleet.*.position --hull 'fleet/{1}' --key '$.id' --time '$.ts'
        dynhull ingest kafka://broker:9092/positions --hull fleet --key '$.vehicle.id' --x '$.pos[0]' --y '$.pos[1]'

    Messages are JSON, or sentences of NMEA (--format). An expression is a path into JSON, as $.position.lon, or a text
    in which {1}, {2}, ... are what the wildcards of the topic stand for, {topic} is the topic, {key} the key of a Kafka
    record, {$.path} is taken from the message, and {{ is a brace.

    NATS JetStream and Kafka number their messages: each is applied exactly once, whatever is killed; the hull counts
    the numbers (dynhull_client: last_sequence). MQTT does not: a message may be applied twice, which changes nothing
    for a key; so --key is required there.

    Bad messages are counted, logged and, with --bad, kept aside. Exit code 1 if there were more than --max-bad, or if
    the broker has removed messages that were not read yet, unless --accept-gaps.
    """
    import structlog

    from dynhull_client import AsyncHullClient

    from .. import logs
    from .bad import BadMessages
    from .feeds import FeedOptions, feeds_of
    from .ingest import run
    from .mapping import Mapping
    from .pump import Settings

    deletes = tombstones is Tombstones.DELETE
    form = time_form(option_of, time_unit, time_zone, ambiguous, time_format)
    nmea = format is Contents.NMEA
    of_puts = conditions(only, ttl, key=key, expires=expires, accuracy=accuracy)
    mapping = Mapping(hull, x, y, key, time, expires, accuracy, form, each, deletes=deletes, nmea=nmea)
    on_globe = mapping.degrees if geographic is None else geographic
    given = (("--grace", grace), ("--report", report), ("--patience", patience))
    seconds = {option: duration(text, option) for option, text in given}
    limit = seconds["--patience"]
    settings = Settings(
        mapping,
        {"geographic": on_globe} if create else None,
        to_end,
        None if limit is None else limit.total_seconds(),
        accept_gaps,
        of_puts,
    )
    logs.configure(log_format.value)
    if mapping.swapped:
        structlog.get_logger("dynhull_ingest").warning(
            "x is the longitude and y the latitude: the names say the opposite", x=x, y=y
        )

    async def serve() -> bool:
        options = FeedOptions(
            hull=hull,
            producer=producer,
            mapping=mapping,
            to_end=to_end,
            ping_interval=connect.ping_interval,
            kafka_config=kafka_config,
        )
        find = feeds_of(source, options)
        async with connect(AsyncHullClient) as client:
            return await run(
                client,
                connect.address,
                find,
                settings,
                BadMessages(bad, max_bad),
                metrics=None if metrics_port is None else (metrics_host, metrics_port),
                grace=seconds["--grace"].total_seconds() if seconds["--grace"] else 0.0,
                report=seconds["--report"].total_seconds() if seconds["--report"] else 10.0,
            )

    _run_to_end(serve(), source, to_end=to_end)


def _run_to_end(serving: "Coroutine[Any, Any, bool]", source: str, *, to_end: bool) -> None:
    """Run an ingest, and end with the exit code of what it has ended with."""
    import asyncio

    from ..urls import without_secrets
    from .feed import DoubtfulError, FeedError
    from .ingest import IngestError

    try:
        ended = asyncio.run(serving)
    except DoubtfulError as error:
        fail(Exit.UNUSABLE, str(error))
    except FeedError as error:
        fail(
            Exit.UNAVAILABLE, f"no answer from the broker: {error}\nIs it running, is {without_secrets(source)} right?"
        )
    except IngestError as error:
        fail(Exit.FAILED, str(error))
    if to_end and not ended:
        fail(Exit.INTERRUPTED, "interrupted before the end: the next ingest goes on from here")
