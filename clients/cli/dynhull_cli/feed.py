"""`dynhull feed`: every batch of a hull, or of many, in order."""

import sys
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from .completion import hulls
from .connected import AsJson, connected
from .feed_consumers import forget_consumer, list_consumers
from .groups import beside
from .json_lines import json_line
from .tab_lines import tab_line

if TYPE_CHECKING:
    from dynhull_client import HullClient


@beside({"consumers": list_consumers, "forget": forget_consumer})
@connected
def feed(
    client: "HullClient",
    name: Annotated[
        str | None, typer.Argument(metavar="[HULL]", help="Name of the hull.", show_default=False, autocompletion=hulls)
    ] = None,
    prefix: Annotated[
        str | None,
        typer.Option(help='In place of HULL: all hulls whose names begin with this; "" for all.', show_default=False),
    ] = None,
    after: Annotated[
        str | None,
        typer.Option(
            help="Begin after this revision; with --prefix after this position, as --json has it. 0 for all batches "
            "that are kept.",
            show_default=False,
        ),
    ] = None,
    consumer: Annotated[
        str | None,
        typer.Option(help="Begin after what this durable consumer acknowledged; creates it.", show_default=False),
    ] = None,
    ack: Annotated[bool, typer.Option("--ack", help="Acknowledge each batch once it is printed.")] = False,
    batches: Annotated[int | None, typer.Option(min=1, max=sys.maxsize, help="End after this many batches.")] = None,
    as_json: AsJson = False,
) -> None:
    """Follow every batch of a hull with its rows, each once and in order, one line per batch.

        dynhull feed fleet --after 0 --json | jq -c '[.revision, .time, .keys]'

    A line has, between tabs: hull, revision, time, cause, the number of points put, and of those removed. JSON has the
    points. Without --after and --consumer it begins with the next batch. After a lost connection it goes on by itself,
    without loss or repetition. A line "lost" names the revisions that the server keeps no more.

    With --prefix, the batches of many hulls come in the order of their commits; a line "deleted" names a hull that was
    deleted. JSON has "after" where a later feed may go on.

    With --consumer and --ack, a later feed continues after the last batch that was printed; a new consumer begins with
    all that is kept. `dynhull feed consumers` lists them, and `dynhull feed forget` deletes one.
    """
    from .closed_pipe import when_pipe_closes
    from .feed_lines import batch_cells, batch_members

    if (name is None) == (prefix is None):
        raise typer.BadParameter("give either a hull or --prefix", param_hint="HULL")
    if ack and consumer is None:
        raise ValueError("--ack needs --consumer: who acknowledges?")
    place = _place(after, many=prefix is not None)
    with client.feed(name, prefix=prefix, after=place, consumer=consumer) as stream:
        if not sys.stdout.isatty():
            when_pipe_closes(stream.close)
        for batch in islice(stream, batches):
            typer.echo(json_line(**batch_members(batch)) if as_json else tab_line(*batch_cells(batch)))
            sys.stdout.flush()
            if ack and consumer is not None and batch.after is not None:
                uid = batch.uid if prefix is None else ""
                client.ack_feed(name, prefix=prefix, consumer=consumer, after=batch.after, uid=uid)


def _place(text: str | None, *, many: bool) -> int | bytes | None:
    """A revision, or the position of many hulls."""
    if text is None:
        return None
    try:
        return bytes.fromhex(text) if many and text != "0" else int(text)
    except ValueError:
        kind = "a position, in hexadecimal digits" if many else "a revision"
        raise typer.BadParameter(f"{text} is not {kind}", param_hint="--after") from None
