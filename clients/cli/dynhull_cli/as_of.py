"""The present of a hull, or how it was: `--at` of commands that read."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynhull_surface.as_of import Present, moment_of

if TYPE_CHECKING:
    from dynhull_client import HullClient

At = Annotated[
    str | None,
    typer.Option(
        metavar="WHEN",
        help="How the hull was at a revision, all digits, or at a time, such as 2026-11-24T16:00Z.",
    ),
]


def as_of(client: "HullClient", name: str, at: str | None) -> Any:
    """What reads a hull: as it is, or as it was; a line says if it may lack keys that were erased."""
    if at is None:
        return Present(client, name)
    past = client.at(name, moment_of(at, "--at"))
    if past.erased:
        typer.echo(f"{name} at revision {past.revision:,}: keys that were erased from its past are missing", err=True)
    return past
