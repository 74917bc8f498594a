"""The present of a hull, or how it was: `?at=` of reads."""

from typing import Annotated, Any

from fastapi import Query

from dynhull_client import AsyncHullClient
from dynhull_surface.as_of import Present, moment_of

At = Annotated[
    str | None,
    Query(
        description="In place of the present: a revision, all digits; or a time of RFC 3339, for the last revision "
        "committed at or before it. Not together with a min_revision.",
        examples=["2026-11-24T16:00:00Z"],
    ),
]


async def as_of(client: AsyncHullClient, name: str, at: str | None) -> Any:
    """What reads a hull: as it is, or as it was."""
    if at is None:
        return Present(client, name)
    return await client.at(name, moment_of(at))
