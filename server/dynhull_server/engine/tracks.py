"""The ways of keys through the past of a hull, read in steps beside the writes."""

from collections.abc import AsyncGenerator

from ..state.errors import HullUnsuitableError
from ..state.records import NO_TIME, Keys
from ..state.tracks import Moves, Thinning
from .live_hull import LiveHull
from .past import PastHulls

# The rows of a part.
PART = 8192


def require_tracks(live: LiveHull) -> None:
    """Raise HullUnsuitableError if what is kept of a hull does not say where its keys were."""
    window = live.settings.window
    if window is not None and window.max_points:
        reason = (
            "has a window by number, of which the past does not say which keys left: replay it, or read it as of then"
        )
        raise HullUnsuitableError(live.name, reason)


async def tracks(
    pasts: PastHulls, live: LiveHull, keys: Keys, first: int, last: int, begin: int | None, every: int
) -> AsyncGenerator[Moves, None]:
    """Where keys were at a revision, and then each move of them, some at a time.

    Args:
        pasts: reads the past.
        live: the hull.
        keys: the keys.
        first: the revision at which they begin.
        last: the last revision.
        begin: the time at which they are at the first places; None where it is not known.
        every: of each key the last move in that many microseconds; 0 for all moves.

    Raises:
        HullNotFoundError: the hull has been deleted.
        LimitExceededError: it would take too many rows.
        RevisionForgottenError, NotStoredError: batches were dropped, or are damaged.
    """
    thinning = Thinning(begin or 0, every)
    tracker = await pasts.tracker(live, keys, first)
    yield tracker.standing(first, NO_TIME if begin is None else begin)
    at, rows = first, 0
    while at < last:
        at, moves = await pasts.track(live, keys, tracker, at, last, rows)
        rows += len(moves)
        certain = thinning.take(moves)
        for place in range(0, len(certain), PART):
            await live.reached(0)
            yield certain[place : place + PART]
    rest = thinning.rest()
    for place in range(0, len(rest), PART):
        yield rest[place : place + PART]
