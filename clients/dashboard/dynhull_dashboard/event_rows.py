"""The latest events of a fence, as rows of the list on the page."""

import json
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from dynhull_cli.plural import plural
from dynhull_client import FenceEvent

MOST_EVENTS = 100
MOST_NAMED = 5

CAUSES: dict[str, str] = {
    "subject_moved": "it moved",
    "area_moved": "the area moved",
    "subject_appeared": "it is new",
    "subject_removed": "it was removed",
    "subject_expired": "its time ended",
    "fence_created": "the fence is new",
    "fence_changed": "the fence changed",
    "time_passed": "time passed",
}


class Row(NamedTuple):
    """An event on the page.

    Attributes:
        id: distinguishes it from all other events.
        time: milliseconds since 1970; None for events that were lost.
        type: what happened, as in the event.
        key: the key of the subject; empty if there is no single one.
        text: the subject in words where there is no key.
        cause: why it happened, in words.
    """

    id: str
    time: float | None
    type: str
    key: str
    text: str
    cause: str


class EventRows:
    """The newest `MOST_EVENTS` events of a fence.

    Args:
        fence: the name of the fence.
    """

    def __init__(self, fence: str) -> None:
        self._fence = fence
        self._rows: deque[Row] = deque(maxlen=MOST_EVENTS)
        self._message: str | None = None

    @property
    def last(self) -> Row | None:
        """The newest event; None before the first."""
        return self._rows[-1] if self._rows else None

    @property
    def message(self) -> str:
        """All rows as JSON, newest first; the same string until an event arrives."""
        if self._message is None:
            rows = list(reversed(self._rows))
            self._message = json.dumps({"kind": "events", "fence": self._fence, "rows": rows})
        return self._message

    def add(self, event: FenceEvent) -> None:
        """Add an event."""
        if event.type == "lost":
            self.skip(event.uid, event.first, event.last, "the server no longer had them")
            return
        at = None if event.time is None else 1000 * event.time.timestamp()
        key = "" if event.key is None else str(event.key)
        text = "" if key else _text(event)
        cause = " and ".join(words for name, words in CAUSES.items() if name in event.cause)
        self._append(Row(f"{event.uid} {event.sequence}", at, event.type, key, text, cause))

    def skip(self, uid: str, first: int, last: int, cause: str) -> None:
        """Add a row for events that are not shown."""
        text = f"events {first:,} to {last:,}" if first < last else f"event {first:,}"
        self._append(Row(f"{uid} {first}-{last}", None, "lost", "", text, cause))

    def _append(self, row: Row) -> None:
        self._rows.append(row)
        self._message = None


def _text(event: FenceEvent) -> str:
    """What an event without a key is about."""
    if event.type not in ("snapshot", "closed"):
        return event.hull
    keys = [str(key) for each in event.inside for key in each.keys]
    return f"{plural(len(keys), 'key')} inside{': ' if keys else ''}{shortened(keys)}"


def shortened(names: Sequence[str]) -> str:
    """The first of some names, and how many more there are."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more:,} more" if more > 0 else "")
