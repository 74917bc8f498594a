"""`dynhull relay`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dynhull_cli.connected import AsJson, Connect, connecting, fail
from dynhull_cli.durations import more_than_0
from dynhull_cli.groups import beside, group
from dynhull_cli.json_lines import json_line
from dynhull_cli.listing import listed
from dynhull_cli.tab_lines import tab_line
from dynhull_surface.reasons import Exit


class LogForm(StrEnum):
    """The forms of log lines."""

    TEXT = "text"
    JSON = "json"


To = Annotated[
    str,
    typer.Option(
        metavar="URL|FILE|-",
        help="Receiver: http(s)://, mqtt(s)://HOST/TOPIC, nats://HOST/SUBJECT, "
        "kafka://HOST/TOPIC, a file, or - for standard output. "
        "{kind}, {name} and {type} of events are filled in. The environment keeps a URL that is a secret, as Slack's "
        "are, out of the list of processes.",
        envvar="DYNHULL_RELAY_TO",
    ),
]
State = Annotated[Path, typer.Option(help="Folder for dead letters.", file_okay=False, envvar="DYNHULL_RELAY_STATE")]
Secrets = Annotated[
    list[str] | None,
    typer.Option(
        "--secret",
        envvar="DYNHULL_WEBHOOK_SECRET",
        help="Secret whsec_... that signs webhooks, and nothing else; several while receivers change theirs. The "
        "environment keeps it out of the list of processes.",
        show_envvar=True,
    ),
]
Unsigned = Annotated[bool, typer.Option("--unsigned", help="Send webhooks without a signature.")]
AllowPrivate = Annotated[
    bool, typer.Option("--allow-private", help="Allow webhooks to private, loopback and link-local addresses.")
]
BodyTemplate = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        dir_okay=False,
        help="Template of bodies in place of CloudEvents: "
        """{"text": "{{ alarm }} is {{ type }} for {{ hull }}"}. Syntax of Jinja: values, if, filters.""",
    ),
]
ContentType = Annotated[
    str | None, typer.Option(help="Media type of what --body-template makes. Default: application/json.")
]
Headers = Annotated[
    list[str] | None,
    typer.Option(
        "--header",
        metavar="NAME: VALUE|@FILE",
        help="Header of webhooks, whose value is a template, too; or a file with such lines, as for secrets.",
    ),
]
KafkaConfig = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        dir_okay=False,
        envvar="DYNHULL_KAFKA_CONFIG",
        help="Settings of Kafka's clients for TLS and passwords, such as security.protocol=SASL_SSL, a line each.",
    ),
]
Timeout = Annotated[str, typer.Option(help="How long a delivery may take.")]


def list_dead_letters(state: State = Path("dynhull-relay"), as_json: AsJson = False) -> None:
    """List dead letters, the oldest first: id, time, receiver, attempts and the last answer.

    dynhull relay dead-letters list --json | jq .event
    """
    import json
    from datetime import UTC, datetime

    from .dead_letters import StateFolder

    try:
        letters = StateFolder(state).dead_letters()
    except ValueError as error:
        fail(Exit.FAILED, str(error))
    for each in listed(letters, f"{state} has no dead letters"):
        time = datetime.fromtimestamp(each.time, UTC).isoformat(timespec="seconds")
        if as_json:
            typer.echo(
                json_line(
                    id=each.letter.id,
                    time=time,
                    to=each.place,
                    attempts=each.attempts,
                    reason=each.reason,
                    event=json.loads(each.letter.text),
                )
            )
        else:
            typer.echo(tab_line(each.letter.id, time, each.place, each.attempts, each.reason))


def send(
    to: To,
    ids: Annotated[list[str] | None, typer.Argument(metavar="ID", help="Only these. Default: all.")] = None,
    state: State = Path("dynhull-relay"),
    secret: Secrets = None,
    unsigned: Unsigned = False,
    allow_private: AllowPrivate = False,
    body_template: BodyTemplate = None,
    content_type: ContentType = None,
    header: Headers = None,
    kafka_config: KafkaConfig = None,
    timeout: Timeout = "30s",
) -> None:
    """Send dead letters again, the oldest first, with their ids, and remove those that arrive.

        dynhull relay dead-letters send --to https://alarms.example/hook

    The command ends at the first that does not arrive, with exit code 1.
    """
    import asyncio

    from .dead_letters import StateFolder
    from .options import options_from
    from .relay import send_again
    from .sources import KINDS
    from .targets import target_of

    async def run() -> tuple[int, str | None]:
        found = StateFolder(state).dead_letters()
        unknown = set(ids or ()) - {each.letter.id for each in found}
        if unknown:
            raise ValueError(f"{state} has no dead letter {', '.join(sorted(unknown))}")
        options = options_from(
            KINDS,
            secret=secret,
            unsigned=unsigned,
            batch=1,
            timeout=timeout,
            allow_private=allow_private,
            body_template=body_template,
            content_type=content_type,
            header=header,
            consumer=None,
            kafka_config=kafka_config,
        )
        target = target_of(to, options)
        return await send_again([each for each in found if not ids or each.letter.id in ids], target)

    try:
        sent, reason = asyncio.run(run())
    except (ValueError, OSError) as error:
        fail(Exit.UNUSABLE, str(error))
    typer.echo(f"{sent} sent")
    if reason is not None:
        fail(Exit.FAILED, f"the next one did not arrive: {reason}")


@group(list=list_dead_letters, send=send)
def dead_letters() -> None:
    """List the events that a receiver refused, or send them again."""


@beside({"dead-letters": dead_letters})
@connecting
def relay(
    connect: Connect,
    sources: Annotated[
        list[str],
        typer.Argument(metavar="FENCE|alarm:ALARM", help="Names of fences, and of alarms after alarm:."),
    ],
    consumer: Annotated[
        str, typer.Option(help="Name of the durable consumer. The server keeps what it has not acknowledged.")
    ],
    to: To,
    state: State = Path("dynhull-relay"),
    secret: Secrets = None,
    unsigned: Unsigned = False,
    allow_private: AllowPrivate = False,
    body_template: BodyTemplate = None,
    content_type: ContentType = None,
    header: Headers = None,
    kafka_config: KafkaConfig = None,
    batch: Annotated[int, typer.Option(min=1, max=1000, help="Most events in one webhook.")] = 1,
    timeout: Timeout = "30s",
    attempts: Annotated[
        int,
        typer.Option(min=1, help="How often an event that the receiver refuses is tried before it is a dead letter."),
    ] = 5,
    first_pause: Annotated[str, typer.Option(help="Pause before a delivery is repeated; doubled each time ...")] = "1s",
    longest_pause: Annotated[str, typer.Option(help="... up to this.")] = "1h",
    enable: Annotated[
        bool, typer.Option("--enable", help="Deliver again to receivers that answered 410 Gone earlier.")
    ] = False,
    grace: Annotated[str, typer.Option(help="How long a delivery may still take after SIGTERM.")] = "10s",
    metrics_port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of the metrics page; 0 for a free one.")
    ] = None,
    metrics_host: Annotated[str, typer.Option(help="Address of the metrics page.")] = "127.0.0.1",
    log_format: Annotated[LogForm, typer.Option(help="Form of the log on standard error.")] = LogForm.TEXT,
) -> None:
    """Deliver the events of fences and alarms to webhooks, MQTT, NATS, Kafka or a file, at least once and in order.

        dynhull relay depot --consumer alarm --to https://alarms.example/hook
        dynhull relay alarm:spread alarm:silence --consumer pager --to https://alarms.example/hook
        dynhull relay depot alarm:spread --consumer plant --to 'mqtt://broker/plant/{kind}/{name}/{type}'

    The order is that of each fence and alarm. An event is acknowledged after it was delivered. Whatever is killed, it
    arrives, perhaps twice but with the same id. What fails is repeated until it succeeds; only refusals, such as HTTP
    400 to 499, end as dead letters, see `dynhull relay dead-letters`. Bodies are CloudEvents 1.0 in JSON, or what
    --body-template makes; webhooks are signed as Standard Webhooks are.

    The relay ends when all fences and alarms are deleted, or after SIGTERM; exit code 1 if a receiver answered 410
    Gone.
    """
    import asyncio

    from dynhull_client import AsyncHullClient

    from . import logs
    from .dead_letters import StateFolder
    from .lane import Patience
    from .options import options_from
    from .relay import run
    from .sources import KINDS, read_source
    from .targets import check_kinds, target_of
    from .urls import without_secrets

    wanted = [read_source(each) for each in sources]
    check_kinds(to, wanted)
    kinds = [kind for kind in KINDS if any(each.kind == kind for each in wanted)]
    options = options_from(
        kinds,
        secret=secret,
        unsigned=unsigned,
        batch=batch,
        timeout=timeout,
        allow_private=allow_private,
        body_template=body_template,
        content_type=content_type,
        header=header,
        consumer=consumer,
        kafka_config=kafka_config,
    )
    patience = Patience(
        attempts, more_than_0(first_pause, "--first-pause"), more_than_0(longest_pause, "--longest-pause")
    )
    folder = StateFolder(state)
    logs.configure(log_format.value)

    async def serve() -> bool:
        target = target_of(to, options)
        page = None if metrics_port is None else (metrics_host, metrics_port)
        try:
            async with connect(AsyncHullClient) as client:
                return await run(
                    client,
                    connect.address,
                    wanted,
                    consumer,
                    target,
                    without_secrets(to),
                    patience,
                    folder,
                    enable=enable,
                    metrics=page,
                    grace=more_than_0(grace, "--grace"),
                )
        finally:
            await target.close()

    if not asyncio.run(serve()):
        fail(Exit.FAILED, "a receiver wants no more events: the server keeps them for the consumer")
