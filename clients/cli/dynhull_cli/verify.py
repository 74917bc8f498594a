"""`dynhull verify`: live hulls compared with a recomputation."""

import sys
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from dynhull_client import HullClient, Verification

from dynhull_surface.reasons import Exit

from .as_of import At, as_of
from .completion import hulls
from .connected import AsJson, connected
from .json_lines import json_line, members
from .listing import listed
from .plural import plural


@connected
def verify(
    client: "HullClient",
    names: Annotated[
        list[str] | None, typer.Argument(metavar="HULL", help="Names of the hulls. Default: all.", autocompletion=hulls)
    ] = None,
    timeout: Annotated[float, typer.Option(min=0, help="Seconds that each hull may take.")] = 600.0,
    at: At = None,
    as_json: AsJson = False,
) -> None:
    """Compare hulls, vertex by vertex, with what Chan's algorithm computes from their stored points.

    The fences that compare a hull or its keys are compared, too: who is inside with positions and areas, and events
    with each other and with who is inside.

        dynhull verify fleet/north && deploy
        dynhull verify fleet/north --at 2026-11-24T16:00Z

    With --at they are rebuilt as they were, and fences are not compared.

    If a hull differs, its line shows the first difference and the exit code is 1.
    """
    different = 0
    for name in names or listed([info.name for info in client.list_hulls()], "no hulls"):
        found = as_of(client, name, at).verify(timeout=timeout)
        different += not found.whole
        typer.echo(
            json_line(name=name, whole=found.whole, **members(found)) if as_json else f"{name}: {_summary(found)}"
        )
    if different:
        sys.exit(Exit.FAILED)


def _summary(found: "Verification") -> str:
    if not found.equal:
        return f"DIFFERENT at revision {found.revision:,}: {found.difference}"
    if not found.keys_equal:
        return f"DIFFERENT at revision {found.revision:,}: the points are not the positions of the keys"
    if found.fence_differences:
        first = found.fence_differences[0]
        where = f"event {first.sequence}, " if first.sequence else ""
        who = "" if first.key is None else f"key {first.key} of {first.hull}, "
        what = f"fence {first.fence}: {where}{who}expected {first.expected}, found {first.found}"
        return f"DIFFERENT at revision {found.revision:,}: {what}"
    rounds = ", ".join(f"{each.guess:,}" for each in found.rounds)
    how = f"Chan's guesses: {rounds}" if rounds else "nothing to compute"
    fences = f", {plural(found.fences, 'fence')}" if found.fences else ""
    counts = (
        f"{plural(found.points, 'point')}, {found.vertices:,} {'vertex' if found.vertices == 1 else 'vertices'}{fences}"
    )
    return f"verified at revision {found.revision:,}: {counts} ({how})"
