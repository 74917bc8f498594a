"""Watching a hull: what to tell somebody who holds an earlier one.

A watcher has no queue. It remembers what it has told, waits for the revision to move, and tells the difference to the
hull as it is then. So whoever is slow gets fewer and larger changes, and memory does not grow.
"""

import asyncio
from collections.abc import AsyncGenerator

from .live_hull import LiveHull
from .views import Event, Progress, View


async def watch(
    hull: LiveHull,
    view: View,
    *,
    since: int | None = None,
    min_revision: int = 0,
    min_interval: float = 0.0,
    progress_interval: float | None = None,
) -> AsyncGenerator[Event, None]:
    """What there is, then an event whenever the revision has moved.

    Args:
        hull: the hull to watch.
        view: what of it.
        since: the revision of what the watcher holds already; None where it holds nothing.
        min_revision: the first event waits for this revision.
        min_interval: seconds from one event to the next, at least.
        progress_interval: seconds without an event after which there is a Progress; None for never.

    Raises:
        HullNotFoundError: the hull has been deleted.
    """
    loop = asyncio.get_running_loop()
    event = await view.first(min_revision)
    counts = event.counts
    told = loop.time()
    if since is None or counts.revision > since or not isinstance(event, Progress):
        yield event
    while True:
        await asyncio.sleep(told + min_interval - loop.time())
        try:
            async with asyncio.timeout_at(None if progress_interval is None else told + progress_interval):
                await hull.reached(counts.revision + 1)
        except TimeoutError:
            told = loop.time()
            yield Progress(counts)
            continue
        event = await view.next()
        counts = event.counts
        told = loop.time()
        yield event
