"""`dynhull verify`: live hulls against Chan's recomputation."""

import sys
from typing import Annotated

import typer

from dynhull_client import HullClient

from .connected import Exit, connected


@connected
def verify(
    client: HullClient,
    names: Annotated[list[str] | None, typer.Argument(help="The hulls. Default: all.")] = None,
    timeout: Annotated[float, typer.Option(min=0, help="Seconds for each.")] = 600.0,
) -> None:
    """Compare hulls with what Chan's algorithm makes of their stored points, vertex by vertex.

        dynhull verify fleet/north && deploy

    Ends with code 1 where one differs; the first difference is told.
    """
    different = 0
    for name in names or [info.name for info in client.list_hulls()]:
        found = client.verify(name, timeout=timeout)
        if found.equal:
            rounds = ", ".join(f"{each.guess:,}" for each in found.rounds)
            how = f"Chan's guesses: {rounds}" if rounds else "nothing to compute"
            typer.echo(
                f"{name}: verified at revision {found.revision:,}: {found.points:,} points, "
                f"{found.vertices:,} vertices ({how})"
            )
        else:
            different += 1
            typer.echo(f"{name}: DIFFERENT at revision {found.revision:,}: {found.difference}")
    if different:
        sys.exit(Exit.FAILED)
