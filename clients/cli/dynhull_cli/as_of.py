"""The present of a hull, or how it was: `--at` of commands that read."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from dynhull_client import HullClient

At = Annotated[
    str | None,
    typer.Option(
        metavar="WHEN",
        help="How the hull was at a revision, all digits, or at a time, such as 2026-11-24T16:00Z.",
    ),
]


class Present:
    """The reading methods of a client for one hull, without its name.

    Args:
        client: the client.
        name: the hull.
    """

    def __init__(self, client: "HullClient", name: str) -> None:
        self._client = client
        self._name = name

    def __getattr__(self, method: str) -> Any:
        from functools import partial

        return partial(getattr(self._client, method), self._name)


def as_of(client: "HullClient", name: str, at: str | None) -> Any:
    """What reads a hull: as it is, or as it was."""
    if at is None:
        return Present(client, name)
    return client.at(name, int(at) if at.isdecimal() and at.isascii() else at)
