"""The present of a hull, or how it was: `?at=` of reads."""

from functools import partial
from typing import Annotated, Any

from fastapi import Query

from dynhull_client import AsyncHullClient

At = Annotated[
    str | None,
    Query(
        description="In place of the present: a revision, all digits; or a time of RFC 3339, for the last revision "
        "committed at or before it. Not together with a min_revision.",
        examples=["2026-11-24T16:00:00Z"],
    ),
]


class Present:
    """The reading methods of a client for one hull, without its name.

    Args:
        client: the client.
        name: the hull.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self._client = client
        self._name = name

    def __getattr__(self, method: str) -> Any:
        return partial(getattr(self._client, method), self._name)


async def as_of(client: AsyncHullClient, name: str, at: str | None) -> Any:
    """What reads a hull: as it is, or as it was."""
    if at is None:
        return Present(client, name)
    return await client.at(name, int(at) if at.isdecimal() and at.isascii() else at)
