"""`dynhull fences list`, `show`, `inside` and `delete`."""

from typing import TYPE_CHECKING, Annotated

import typer

from ..completion import fences
from ..connected import AsJson, connected
from ..json_lines import json_line, members
from ..listing import below, confirm_deletion, existing, listed, print_list
from ..plural import plural
from ..tab_lines import tab_line
from .settings import FenceName

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import Fence, HullClient


@connected
def list_fences(
    client: "HullClient",
    prefix: Annotated[str, typer.Argument(metavar="PREFIX", help="List only fences whose names begin with this.")] = "",
    as_json: AsJson = False,
) -> None:
    """List fences by name, with area, subjects, the number inside, the last sequence and the largest backlog.

        dynhull fences list depot/ --json | jq -r .name

    A terminal shows a table; a pipe receives one line per fence with tabs between the columns.
    """
    from .shown import fence_members

    print_list(listed(client.list_fences(prefix), below("fences", prefix)), as_json, fence_members, _line, _table)


@connected
def show(client: "HullClient", name: FenceName, as_json: AsJson = False) -> None:
    """Show a fence: its area, subjects, settings, counts and durable consumers.

    dynhull fences show depot
    """
    from .shown import area_text, fence_members, settings_text, subjects_text, unit_of

    fence = client.get_fence(name)
    if as_json:
        typer.echo(json_line(**fence_members(fence)))
        return
    typer.echo(f"area\t{area_text(fence, unit_of(client, fence))}")
    typer.echo(f"subjects\t{subjects_text(fence)}")
    typer.echo(f"settings\t{settings_text(fence) or 'the usual ones'}")
    typer.echo(f"inside\t{fence.inside} of {plural(fence.subject_count, 'subject')}")
    kept = f"{fence.first_sequence}-{fence.last_sequence}" if fence.first_sequence <= fence.last_sequence else "none"
    typer.echo(f"events\t{kept} kept, last sequence {fence.last_sequence}")
    for each in fence.consumers:
        lost = f", {plural(each.lost, 'event')} lost" if each.lost else ""
        oldest = f", oldest of {each.oldest.isoformat(timespec='seconds')}" if each.oldest else ""
        typer.echo(
            f"consumer\t{each.name}: acknowledged {each.acknowledged}, {plural(each.backlog, 'event')} to come"
            f"{oldest}{lost}"
        )


@connected
def inside(client: "HullClient", name: FenceName, as_json: AsJson = False) -> None:
    """Print the subjects that are inside, one per line: the hull, a tab and the key.

    dynhull fences inside depot | cut -f 2

    With --json, one object with the sequence of the event that leads to them, and the keys of each hull.
    """
    found = client.fence_inside(name)
    if as_json:
        typer.echo(json_line(**members(found)))
        return
    subjects = ((each.hull, key) for each in found.subjects for key in each.keys)
    for hull, key in listed(subjects, f"nobody is inside {name}"):
        typer.echo(tab_line(hull, key))


@connected
def delete(
    client: "HullClient",
    names: Annotated[list[str], typer.Argument(metavar="FENCE", help="Names of the fences.", autocompletion=fences)],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Delete without asking.")] = False,
    missing_ok: Annotated[bool, typer.Option("--missing-ok", help="Skip a fence that does not exist.")] = False,
    as_json: AsJson = False,
) -> None:
    """Delete fences with their events and consumers. This cannot be undone; hulls and points stay.

        dynhull fences delete depot

    On a terminal the command asks first; elsewhere it needs --yes. Where a fence does not exist, none is deleted.
    """
    from dynhull_client import FenceNotFoundError

    found = existing(names, client.get_fence, FenceNotFoundError if missing_ok else None)
    if not yes:
        confirm_deletion([f"{fence.name} (last event {fence.last_sequence})" for fence in found])
    for fence in found:
        client.delete_fence(fence.name)
        typer.echo(json_line(name=fence.name, deleted=True) if as_json else f"{fence.name}: deleted")


def _line(fence: "Fence") -> str:
    from .shown import area_text, subjects_text

    counts = f"{fence.inside}\t{fence.last_sequence}\t{_backlog(fence)}"
    return f"{fence.name}\t{area_text(fence)}\t{subjects_text(fence)}\t{counts}"


def _backlog(fence: "Fence") -> int:
    """The largest backlog of a consumer."""
    return max((each.backlog for each in fence.consumers), default=0)


def _table(fences: "list[Fence]") -> "Table":
    from rich.table import Table

    from .shown import area_text, subjects_text

    table = Table("fence", "area", "subjects")
    for heading in ("inside", "last event", "backlog"):
        table.add_column(heading, justify="right")
    for fence in fences:
        counts = (f"{each:,}" for each in (fence.inside, fence.last_sequence, _backlog(fence)))
        table.add_row(fence.name, area_text(fence), subjects_text(fence), *counts)
    return table
