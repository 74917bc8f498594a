"""The present of a hull, or how it was: `?at=` of reads."""

from dataclasses import dataclass
from typing import Annotated, Any

import grpc
from fastapi import Depends, Query

from dynhull_client import AsyncHullClient, HullReplacedError
from dynhull_surface.as_of import Present

from .numbers import Moment

AtMoment = Annotated[
    Moment | None,
    Query(
        description="In place of the present: a revision, all digits; or a time of RFC 3339, for the last revision "
        "committed at or before it. Not together with a min_revision.",
        examples=["2026-11-24T16:00:00Z"],
    ),
]
AtUid = Annotated[
    str,
    Query(
        max_length=200,
        description="With `at`, the uid of the hull that is meant, to notice that another one has its name now.",
    ),
]


@dataclass(frozen=True, slots=True)
class AskedAt:
    """A moment of the past of a hull; the uid is empty for any hull of the name."""

    moment: int | str
    uid: str


async def _asked(at: AtMoment = None, at_uid: AtUid = "") -> AskedAt | None:
    if at is None:
        if at_uid:
            raise ValueError("at_uid: is given with at")
        return None
    return AskedAt(at, at_uid)


At = Annotated[AskedAt | None, Depends(_asked)]


async def as_of(client: AsyncHullClient, name: str, at: AskedAt | None) -> Any:
    """What reads a hull: as it is, or as it was."""
    if at is None:
        return Present(client, name)
    past = await client.at(name, at.moment)
    if at.uid not in ("", past.uid):
        problem = f"the hull {name!r} was created again, or restored from a backup: its uid is now {past.uid}"
        metadata = {"field": "at_uid", "value": name, "uid": past.uid}
        raise HullReplacedError(problem, grpc.StatusCode.OUT_OF_RANGE, "HULL_REPLACED", metadata)
    return past
