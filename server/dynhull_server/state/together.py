"""One batch to each of several hulls: all of them are applied, or none."""

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from .batch import Applied, Write
from .errors import SequencesDifferError
from .hull import Hull
from .hull_state import HullState
from .records import Record
from .requests import WriteTogether

T = TypeVar("T")


def apply_together(
    request: WriteTogether,
    hulls: list[Hull],
    records: list[list[Record] | None],
    now: float,
    expired: Callable[[Hull], None] | None,
) -> list[Applied]:
    """Apply each part of the request to its hull, as the next revision of each.

    Every part is checked before one is applied, because a hull cannot take back a batch. If memory runs out between two
    parts, all hulls are torn. `expired` is called with each hull whose points have left before its batch.

    Raises:
        Exception: a part is refused. No hull has changed, unless they are torn.
    """
    states = [hull.state for hull in hulls]
    new = _of_each(request, states, lambda part, state: state.is_new(part, now))
    if not any(new):
        return [state.duplicate() for state in states]
    if not all(new):
        applied, missing = new.index(False), new.index(True)
        part = request.parts[applied]
        expected = states[applied].last_sequence(part.producer) + 1
        raise SequencesDifferError(part.producer, part.sequence, expected, hulls[applied].name, hulls[missing].name)
    batches = _of_each(request, states, lambda part, state: state.checked(part))
    results: list[Applied] = []
    try:
        for part, hull, batch, kept in zip(request.parts, hulls, batches, records, strict=True):
            left = None if expired is None else partial(expired, hull)
            results.append(hull.state.apply_decoded(part, batch, now, kept, left))
    except BaseException:
        if results:
            for state in states:
                state.torn = True
        raise
    return results


def _of_each(request: WriteTogether, states: list[HullState], step: Callable[[Write, HullState], T]) -> list[T]:
    """The results of a step for each part; the request records which part it refuses."""
    results = []
    for index, (part, state) in enumerate(zip(request.parts, states, strict=True)):
        request.refused = index
        results.append(step(part, state))
    request.refused = None
    return results
