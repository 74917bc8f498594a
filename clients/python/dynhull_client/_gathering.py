"""What a writer is given, cut into parts, and parts gathered for one batch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dynhull.arrays import as_points

from ._accuracies import as_accuracies
from ._batch import Batch, join_batches, keep_last_rows
from ._keys import checked_keys, plain_keys
from ._times import as_microseconds, as_times

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import timedelta

    import numpy.typing as npt

    from dynhull_proto.v1 import batch_pb2

    from ._batch import Only
    from ._calls import Writing

Key = str | int
UNTIMED = 0
Conditions = tuple["Only | None", "float | timedelta | str | None", bool, bool]
"""What all keys that a batch puts have in common."""


@dataclass(slots=True)
class Part:
    """Changes for one batch.

    Attributes:
        message: the changes.
        rows: their number.
        latest: the last time of each key that is put, UNTIMED without times; None for a key that is removed.
        timed: whether the rows to put or insert have times; None if there are none.
        conditions: `only`, `ttl`, whether there are times at which keys leave, and accuracies; None if no keys are put.
        kind: str or int for such keys, None for points without keys.
    """

    message: batch_pb2.Batch
    rows: int
    latest: dict[Key, int | None] = field(default_factory=dict)
    timed: bool | None = None
    conditions: Conditions | None = None
    kind: type[Key] | None = None


def put_parts(
    writing: Writing,
    insert: npt.ArrayLike | None,
    delete: npt.ArrayLike | None,
    move: tuple[npt.ArrayLike, npt.ArrayLike] | None,
    keys: Any,
    points: npt.ArrayLike | None,
    times: Any,
    only: Only | None,
    ttl: float | timedelta | str | None,
    expire_times: Any,
    accuracies: Any,
) -> list[Part]:
    """Points to insert, delete and move as one part, or keys to put as `Batch` takes them.

    A new part begins with a row that must not go into the same batch as the rows before it.
    """
    options: Any = {"insert": insert, "delete": delete, "move": move, "only": only, "ttl": ttl}
    options["missing"] = writing.missing
    columns: dict[str, Any]
    if keys is None or points is None:
        columns = {"keys": keys, "points": points, "times": times, "expire_times": expire_times}
        batch = Batch(**options, **columns, accuracies=accuracies)
        return [Part(batch.message, batch.rows, timed=None if insert is None else times is not None)]
    checked, xy = checked_keys(keys), as_points(points, "points", on_globe=None)
    micros = None if times is None else as_microseconds(times, len(xy), "times")
    ends = None if expire_times is None else as_microseconds(expire_times, len(xy), "expire_times")
    errors = None if accuracies is None else as_accuracies(accuracies, len(xy))
    columns = {"keys": checked, "points": xy, "times": as_times(micros), "expire_times": as_times(ends)}
    columns["accuracies"] = errors
    whole = Batch(**options, **columns)
    names = plain_keys(checked)
    stamps = [UNTIMED] * len(names) if micros is None else micros.tolist()
    conditions: Conditions = only, ttl, ends is not None, errors is not None
    parts = []
    for rows in _runs(names, stamps, writing.coalesce == "last" and only != "absent"):
        batch = whole
        if rows.stop - rows.start < len(names):
            of_rows = {name: None if each is None else each[rows] for name, each in columns.items()}
            batch = Batch(**options, **of_rows)
        latest: dict[Key, int | None] = dict(zip(names[rows], stamps[rows], strict=True))
        parts.append(Part(batch.message, rows.stop - rows.start, latest, micros is not None, conditions, _kind(names)))
    return parts


def remove_parts(writing: Writing, keys: Any) -> list[Part]:
    """Keys to remove; a new part begins where a key comes again."""
    checked = checked_keys(keys)
    names = plain_keys(checked)
    return [
        Part(
            Batch(remove=checked[rows], missing=writing.missing).message,
            rows.stop - rows.start,
            dict.fromkeys(names[rows]),
            kind=_kind(names),
        )
        for rows in _runs(names, [UNTIMED] * len(names), coalesce=False)
    ]


class Gathering:
    """Parts gathered for one batch.

    Args:
        part: the first one, which this changes.
        coalesce: whether only the last row of each key is kept.

    Attributes:
        rows: the number of their rows.
    """

    __slots__ = ("_coalesce", "_conditions", "_kind", "_latest", "_messages", "_timed", "rows")

    def __init__(self, part: Part, *, coalesce: bool) -> None:
        self.rows = part.rows
        self._coalesce = coalesce
        self._messages = [part.message]
        self._latest = part.latest
        self._timed = part.timed
        self._conditions = part.conditions
        self._kind = part.kind

    def admits(self, part: Part) -> bool:
        """Whether the part may go into the same batch."""
        if part.kind is not self._kind:  # the server refuses one of them, for the hull has one kind
            return False
        if _differ(self._timed, part.timed) or _differ(self._conditions, part.conditions):
            return False
        if self._latest.keys().isdisjoint(part.latest):
            return True
        # Of new keys only, the first position is the one that counts.
        coalesce = self._coalesce and (part.conditions is None or part.conditions[0] != "absent")
        return all(_coalesces(self._latest, key, stamp, coalesce) for key, stamp in part.latest.items())

    def add(self, part: Part) -> None:
        """Add a part."""
        self._messages.append(part.message)
        self._latest.update(part.latest)
        self.rows += part.rows
        self._timed = part.timed if self._timed is None else self._timed
        self._conditions = part.conditions if self._conditions is None else self._conditions

    def joined(self) -> batch_pb2.Batch:
        """The parts as one batch."""
        joined = join_batches(self._messages)
        if self._coalesce and joined.HasField("puts"):
            keep_last_rows(joined)
        return joined


def _kind(names: Sequence[Key]) -> type[Key] | None:
    return type(names[0]) if names else None


def _differ(one: bool | Conditions | None, other: bool | Conditions | None) -> bool:
    return one is not None and other is not None and one != other


def _runs(names: Sequence[Key], stamps: Sequence[int], coalesce: bool) -> Iterator[slice]:
    """The longest slices of rows that may go into the same batch."""
    if len(set(names)) == len(names):
        yield slice(0, len(names))
        return
    begin, latest = 0, dict[Key, int | None]()
    for row, (name, stamp) in enumerate(zip(names, stamps, strict=True)):
        if not _coalesces(latest, name, stamp, coalesce):
            yield slice(begin, row)
            begin, latest = row, {}
        latest[name] = stamp
    yield slice(begin, len(names))


def _coalesces(latest: Mapping[Key, int | None], key: Key, stamp: int | None, coalesce: bool) -> bool:
    """Whether the batch may hold the key at this time: alone or, if that is allowed, instead of an earlier position.

    A position with an earlier time than the one before stays in a batch of its own: only the server knows whether the
    hull is ordered by time or by arrival.
    """
    if key not in latest:
        return True
    before = latest[key]
    return coalesce and before is not None and stamp is not None and before <= stamp
