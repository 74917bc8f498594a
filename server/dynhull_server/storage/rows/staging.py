"""Many events of one commit are written in pieces ahead of it, so that the commits of others wait less.

An area that is emptied makes an event of each subject inside, a million perhaps. The commit has the first events of
each such fence; those behind them have been written before it. Until it takes place, whoever reads the rows finds a gap
before these, and takes them for events that have never been.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import pairwise, takewhile

from ...state.changes import Change
from ...state.fences.events.block import AppendEvents, EventBlock, joined
from ...state.fences.model.records import AddFence, DropFence
from ..port import StorageStep
from .fence_ledger import EVENTS_A_ROW, AppendFirst, CountStaged, StageEvents

# Events that are committed together with other changes, about: of more, some are written ahead of these.
EVENTS_TOGETHER = 16_384
# The least number of events of a fence in one revision of which some are written ahead.
EVENTS_AT_ONCE = 4 * EVENTS_A_ROW


def staging(
    changes: Sequence[Change | StorageStep], place: Callable[[], int]
) -> tuple[list[StageEvents], Sequence[Change | StorageStep]]:
    """What of many events is written ahead, and the changes that follow: with the first events of each fence.

    Args:
        changes: the changes to commit together.
        place: gives the numbers of new rows of events.
    """
    # Fences that begin or end: no rows may belong to them before, or need to.
    others = {change.row.number for change in changes if isinstance(change, AddFence)}
    others |= {change.number for change in changes if isinstance(change, DropFence)}
    steps: list[StageEvents] = []
    then: list[Change | StorageStep] = []
    for change in changes:
        then.append(change)
        if not isinstance(change, AppendEvents) or len(change.block) <= EVENTS_TOGETHER:
            continue
        block, begun = change.block, set[int]()
        tails = sorted(_tails(block, others), key=lambda tail: tail[1])
        if not tails:
            continue
        edges = [0, *(edge for _, *both in tails for edge in both), len(block)]
        first = joined([block.part(start, end) for start, end in list(pairwise(edges))[::2] if start < end])
        then[-1] = AppendFirst(first, [place() for _ in range(0, len(first), EVENTS_A_ROW)])
        for number, begin, last in tails:
            for start in range(begin, last, EVENTS_A_ROW):
                end = min(start + EVENTS_A_ROW, last)
                steps.append(StageEvents(number, block, start, end, place(), number not in begun))
                begun.add(number)
        lasts = dict(zip(block.fences.tolist(), (block.firsts + block.counts - 1).tolist(), strict=True))
        then += [CountStaged(number, lasts[number]) for number in begun]
    return steps, then


def _tails(block: EventBlock, others: Collection[int]) -> Iterator[tuple[int, int, int]]:
    """The fences with long runs at the end, without `others`: the number, and rows of such a run that may be staged."""
    of_fences: dict[int, list[int]] = {}
    for run, number in enumerate(block.fences.tolist()):
        of_fences.setdefault(number, []).append(run)
    for number, runs in of_fences.items():
        if number in others:
            continue
        long = list(takewhile(lambda run: block.counts[run] > EVENTS_AT_ONCE, reversed(runs)))
        for run in long:
            end = int(block.ends[run])
            yield number, end - int(block.counts[run]) + (EVENTS_A_ROW if run == long[-1] else 0), end
