"""`dynhull verify`: live hulls compared with a recomputation."""

import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from dynhull_client import HullClient, Verification

from .connected import AsJson, connected
from .exits import Exit
from .json_lines import json_line


@connected
def verify(
    client: "HullClient",
    names: Annotated[list[str] | None, typer.Argument(metavar="HULL", help="Names of the hulls. Default: all.")] = None,
    timeout: Annotated[float, typer.Option(min=0, help="Seconds that each hull may take.")] = 600.0,
    as_json: AsJson = False,
) -> None:
    """Compare hulls, vertex by vertex, with what Chan's algorithm computes from their stored points.

        dynhull verify fleet/north && deploy

    If a hull differs, its line shows the first difference and the exit code is 1.
    """
    different = 0
    for name in names or [info.name for info in client.list_hulls()]:
        found = client.verify(name, timeout=timeout)
        different += not (found.equal and found.keys_equal)
        typer.echo(json_line(name=name, **asdict(found)) if as_json else f"{name}: {_summary(found)}")
    if different:
        sys.exit(Exit.FAILED)


def _summary(found: "Verification") -> str:
    if not found.equal:
        return f"DIFFERENT at revision {found.revision:,}: {found.difference}"
    if not found.keys_equal:
        return f"DIFFERENT at revision {found.revision:,}: the points are not the positions of the keys"
    rounds = ", ".join(f"{each.guess:,}" for each in found.rounds)
    how = f"Chan's guesses: {rounds}" if rounds else "nothing to compute"
    return f"verified at revision {found.revision:,}: {found.points:,} points, {found.vertices:,} vertices ({how})"
