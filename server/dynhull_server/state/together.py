"""One batch to each of several hulls: all of them are applied, or none."""

from collections.abc import Callable
from typing import TypeVar

from .batch import Applied
from .errors import SequencesDifferError
from .events import WriteBatch, WriteTogether
from .hull_state import HullState
from .records import Record

T = TypeVar("T")


def apply_together(
    request: WriteTogether, states: list[HullState], records: list[list[Record] | None], now: float
) -> list[Applied]:
    """Apply each part of the request to its hull, as the next revision of each.

    Every part is checked before one is applied, because a hull cannot take back a batch. If memory runs out between two
    parts, all hulls are torn.

    Raises:
        Exception: a part is refused. No hull has changed, unless they are torn.
    """
    new = _of_each(request, states, lambda part, state: state.is_new(part, now))
    if not any(new):
        return [state.duplicate() for state in states]
    if not all(new):
        raise _sequences_differ(request, states, new.index(False), new.index(True))
    batches = _of_each(request, states, lambda part, state: state.decode(part))
    for request.refused, (state, batch) in enumerate(zip(states, batches, strict=True)):
        state.check(batch)
    request.refused = None
    try:
        return [
            state.apply_decoded(part, batch, now, kept)
            for state, part, batch, kept in zip(states, request.parts, batches, records, strict=True)
        ]
    except BaseException:
        for state in states:
            state.torn = True
        raise


def _of_each(request: WriteTogether, states: list[HullState], step: Callable[[WriteBatch, HullState], T]) -> list[T]:
    """The results of a step for each part; the request records which part it refuses."""
    results = []
    for index, (part, state) in enumerate(zip(request.parts, states, strict=True)):
        request.refused = index
        results.append(step(part, state))
    request.refused = None
    return results
