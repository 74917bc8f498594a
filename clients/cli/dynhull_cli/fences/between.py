"""`dynhull fences between`."""

import sys
from itertools import islice
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynhull_surface.as_of import moment_of
from dynhull_surface.settings import FenceSettings

from ..connected import AsJson, connected
from ..json_lines import json_line
from ..setting_options import choosing, settings_options
from ..tab_lines import tab_line
from .settings import compared, with_keys

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
@choosing(compared, settings_options(FenceSettings))
def between(
    client: "HullClient",
    chosen: dict[str, Any],
    start: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="WHEN",
            help="Begin at a revision of the subjects' hull, all digits, or at a time, such as 2026-11-24T16:00Z. "
            "Default: the oldest that the server keeps.",
        ),
    ] = None,
    end: Annotated[
        str | None,
        typer.Option("--to", metavar="WHEN", help="End with a revision, or at a time. Default: now."),
    ] = None,
    events: Annotated[int | None, typer.Option(min=1, max=sys.maxsize, help="End after this many events.")] = None,
    as_json: AsJson = False,
) -> None:
    """Print the events that a fence would have made, one per line: who was in this yard, drawn only now?

        dynhull fences between --polygon yard.geojson --subjects vans --from 2026-11-23T00:00Z --to 2026-11-25T00:00Z
        dynhull fences between --area wolves --subjects sheep --margin 0.5 --json | jq -c '[.time, .type, .key]'

    The area, the subjects and the options are those of `dynhull fences create`; no fence is created. The lines are
    those of `dynhull fences watch`. How far back it reaches is what the server keeps: `dynhull history`.
    """
    from ..closed_pipe import when_pipe_closes
    from .shown import event_cells, event_members

    chosen |= {"start": moment_of(start, "--from"), "end": moment_of(end, "--to")}
    with client.fence_events_between(**with_keys(client, chosen)) as stream:
        if not sys.stdout.isatty():
            when_pipe_closes(stream.close)
        for event in islice(stream, events):
            typer.echo(json_line(**event_members(event)) if as_json else tab_line(*event_cells(event)))
