"""One batch, applied as it is."""

from collections.abc import Iterable, Sequence
from typing import Any

from dynhull_client import Applied, AsyncHullClient

from . import schemas
from .problems import FieldError
from .schemas import Batch, Key, Move

OF_KEYS = ("keys", "points", "remove", "only", "ttl", "expire_times", "accuracies")
OF_POINTS = ("insert", "delete", "move")
OF_QUARANTINE = ("release", "drop")


def check(batch: Batch, *within: str) -> None:
    """FieldError if the fields of a batch do not go together. `within`: the way to the batch in the body."""
    of_keys = [field for field in OF_KEYS if getattr(batch, field) is not None]
    of_points = [field for field in OF_POINTS if getattr(batch, field) is not None]
    if of_keys and of_points:
        raise FieldError([*within, of_points[0]], f"is about points, and {of_keys[0]} about keys: a batch has either")
    of_quarantine = [field for field in OF_QUARANTINE if getattr(batch, field) is not None]
    others = [field for field in (*OF_KEYS, *OF_POINTS, "times", "missing") if getattr(batch, field) is not None]
    if of_quarantine and others:
        problem = f"is about keys in quarantine, and {others[0]} is not: a batch has either"
        raise FieldError([*within, of_quarantine[0]], problem)
    if (batch.keys is None) != (batch.points is None):
        given, lacking = ("keys", "points") if batch.points is None else ("points", "keys")
        raise FieldError([*within, given], f"is given without {lacking}: the position of each key")
    if batch.keys is None and of_keys not in ([], ["remove"]):
        other = next(field for field in of_keys if field != "remove")
        raise FieldError([*within, other], "is given without keys to put")
    if batch.times is not None and batch.keys is None and batch.insert is None:
        raise FieldError([*within, "times"], "is given without points to insert or keys to put")
    if batch.ttl is not None and batch.expire_times is not None:
        raise FieldError([*within, "ttl"], "is given with expire_times: a batch has either")
    _check_rows(batch, within)


def _check_rows(batch: Batch, within: Sequence[str]) -> None:
    """FieldError if columns are of different lengths, or keys of different kinds."""
    if batch.keys is not None:
        _check_columns(batch, "keys", ("points", "times", "expire_times", "accuracies"), within)
    elif batch.insert is not None:
        _check_columns(batch, "insert", ("times",), within)
    if batch.move is not None:
        _check_columns(batch.move, "origins", ("destinations",), [*within, "move"])
    kind: type[Key] | None = None
    for field in ("keys", "remove", *OF_QUARANTINE):
        for row, key in enumerate(getattr(batch, field) or ()):
            kind = kind or type(key)
            if type(key) is not kind:
                raise FieldError([*within, field, row], "all keys of a batch are strings, or all are integers", key)


def _check_columns(rows: Batch | Move, first: str, others: Iterable[str], within: Sequence[str]) -> None:
    count = len(getattr(rows, first))
    for name in others:
        column = getattr(rows, name)
        if column is not None and len(column) != count:
            raise FieldError([*within, name], f"must have a row for each of {first}, {count}, not {len(column)}")


async def apply(
    client: AsyncHullClient, name: str, batch: Batch, *, producer: str = "", sequence: int = 0, may_skip: bool = False
) -> Applied:
    """Apply one checked batch as one revision."""
    numbered: Any = {"producer": producer, "sequence": sequence, "may_skip": may_skip}
    if batch.keys is not None and batch.points is not None:
        if batch.missing is not None:
            raise FieldError(["missing"], "is given with keys to put, which need not be there")
        return await client.put(
            name,
            batch.keys,
            batch.points,
            batch.times,
            remove=batch.remove,
            only=batch.only,
            ttl=batch.ttl,
            expire_times=batch.expire_times,
            accuracies=batch.accuracies,
            **numbered,
        )
    if batch.release is not None:
        return await client.release(name, batch.release, drop=batch.drop, **numbered)
    if batch.drop is not None:
        return await client.drop(name, batch.drop, **numbered)
    if batch.remove is not None:
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
    return shown.model_dump_json().encode() + b"\n"
