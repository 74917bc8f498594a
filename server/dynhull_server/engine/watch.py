"""Watching a hull.

A watcher has no queue. It remembers what it has sent, waits for a new revision, and sends the difference to the hull at
that time. A slow client therefore gets fewer and larger changes, and memory does not grow.
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
    outline_only: bool = False,
) -> AsyncGenerator[Event, None]:
    """The present state, then an event for each new revision, or for several at once.

    Args:
        hull: the hull to watch.
        view: the part of it to follow.
        since: the revision of the state that the watcher already holds; None where it holds none.
        min_revision: the least revision of the first event.
        min_interval: the least number of seconds between events.
        progress_interval: seconds without an event after which a Progress is sent; None for never.
        outline_only: whether there is no event for revisions that leave what the watcher holds as it is.

    Raises:
        HullNotFoundError: the hull has been deleted.
    """
    loop = asyncio.get_running_loop()
    event = await view.first(min_revision)
    counts = event.counts
    sent = loop.time()
    if since is None or counts.revision > since or not isinstance(event, Progress):
        yield event
    while True:
        await asyncio.sleep(sent + min_interval - loop.time())
        try:
            async with asyncio.timeout_at(None if progress_interval is None else sent + progress_interval):
                await (view.changed(counts.revision) if outline_only else hull.reached(counts.revision + 1))
                due = False
        except TimeoutError:
            due = True
        event = await view.next() if outline_only or not due else Progress(counts)
        same = isinstance(event, Progress) and event.counts.center == counts.center
        counts = event.counts
        if due or not (outline_only and same):
            sent = loop.time()
            yield event
