"""`dynhull feed consumers` and `dynhull feed forget`: the durable readers of feeds."""

from typing import TYPE_CHECKING, Annotated

import typer

from .connected import AsJson, connected
from .json_lines import json_line
from .tab_lines import tab_line

if TYPE_CHECKING:
    from dynhull_client import FeedConsumer, HullClient


@connected
def list_consumers(
    client: "HullClient",
    prefix: Annotated[str, typer.Option(help="Only those of hulls and prefixes that begin with this.")] = "",
    as_json: AsJson = False,
) -> None:
    """List the durable consumers of feeds, one line per consumer.

        dynhull feed consumers --json | jq -c '[.hull, .name, .backlog]'

    A line has, between tabs: the hull, or the prefix followed by *, the consumer, what it has acknowledged, and its
    backlog: batches of the hull, or commits since then; "replaced" if the hull is another one now.
    """
    for each in client.list_feed_consumers(prefix):
        typer.echo(_json(each) if as_json else tab_line(*_cells(each)))


@connected
def forget_consumer(
    client: "HullClient",
    consumer: Annotated[str, typer.Argument(metavar="CONSUMER", help="Name of the durable consumer.")],
    name: Annotated[str | None, typer.Argument(metavar="[HULL]", help="The hull it reads.", show_default=False)] = None,
    prefix: Annotated[str | None, typer.Option(help="In place of HULL: the prefix it reads.")] = None,
) -> None:
    """Delete a durable consumer of a feed. This cannot be undone; hulls and their past stay.

    dynhull feed forget index fleet
    """
    client.delete_feed_consumer(name, consumer=consumer, prefix=prefix)
    typer.echo(f"{consumer}: deleted")


def _json(consumer: "FeedConsumer") -> str:
    after = consumer.after.hex() if isinstance(consumer.after, bytes) else consumer.after
    of = {"prefix": consumer.prefix} if consumer.hull is None else {"hull": consumer.hull, "uid": consumer.uid}
    behind = {"backlog": consumer.backlog, "lost": consumer.lost, "replaced": consumer.replaced}
    return json_line(name=consumer.name, **of, after=after, **behind)


def _cells(consumer: "FeedConsumer") -> tuple[str, ...]:
    of = f"{consumer.prefix}*" if consumer.hull is None else consumer.hull
    after = consumer.after.hex() if isinstance(consumer.after, bytes) else str(consumer.after)
    return of, consumer.name, after, "replaced" if consumer.replaced else str(consumer.backlog)
