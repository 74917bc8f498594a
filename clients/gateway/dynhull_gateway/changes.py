"""One batch, applied as it is."""

from typing import Any

from dynhull_client import Applied, AsyncHullClient

from . import schemas
from .schemas import Batch

OF_KEYS = ("keys", "points", "remove", "only", "ttl", "expire_times")
OF_POINTS = ("insert", "delete", "move")


async def apply(
    client: AsyncHullClient, name: str, batch: Batch, *, producer: str = "", sequence: int = 0, may_skip: bool = False
) -> Applied:
    """Apply one batch as one revision; ValueError if its fields do not go together."""
    numbered: Any = {"producer": producer, "sequence": sequence, "may_skip": may_skip}
    of_keys = [field for field in OF_KEYS if getattr(batch, field) is not None]
    of_points = [field for field in OF_POINTS if getattr(batch, field) is not None]
    if of_keys and of_points:
        raise ValueError(f"{of_keys[0]} is about keys and {of_points[0]} about points: a batch has either")
    if (batch.keys is None) != (batch.points is None):
        raise ValueError("keys and points are given together: the position of each key")
    if batch.keys is None and of_keys not in ([], ["remove"]):
        raise ValueError(f"{next(field for field in of_keys if field != 'remove')} is given with keys to put")
    if batch.keys is not None and batch.points is not None:
        if batch.missing is not None:
            raise ValueError("missing is given without keys to put")
        return await client.put(
            name,
            batch.keys,
            batch.points,
            batch.times,
            remove=batch.remove,
            only=batch.only,
            ttl=batch.ttl,
            expire_times=batch.expire_times,
            **numbered,
        )
    if batch.remove is not None:
        if batch.times is not None:
            raise ValueError("times are given with points to insert or to put")
        return await client.remove(name, batch.remove, missing=batch.missing or "count", **numbered)
    return await client.apply(
        name,
        insert=batch.insert,
        delete=batch.delete,
        move=None if batch.move is None else (batch.move.origins, batch.move.destinations),
        times=batch.times,
        missing=batch.missing or "raise",
        **numbered,
    )


def encoded(applied: Applied, gathered: int = 1) -> bytes:
    """The effect of a batch as JSON."""
    shown = schemas.Applied.model_validate(applied)
    shown.gathered = gathered
    return shown.model_dump_json().encode()
