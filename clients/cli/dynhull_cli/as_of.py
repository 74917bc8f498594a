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
    """What reads a hull: as it is, or as it was."""
    if at is None:
        return Present(client, name)
    return client.at(name, moment_of(at))
