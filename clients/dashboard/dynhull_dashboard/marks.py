"""The subjects inside a fence, as marks in the picture."""

import json
from collections.abc import Iterable
from typing import NamedTuple

from dynhull_client import FenceEvent

from .degrees import Center, shown_place

MOST_MARKED = 500


class Mark(NamedTuple):
    """A subject inside: its hull, its key and its position."""

    hull: str
    key: str
    x: float
    y: float


class Marks:
    """At most `MOST_MARKED` subjects inside a fence.

    Args:
        fence: the name of the fence.

    Attributes:
        center: the centre of the hulls of a fence on the globe, around which they are drawn; None for the plane.
    """

    def __init__(self, fence: str) -> None:
        self.center: Center | None = None
        self._fence = fence
        self._marks: dict[tuple[str, str], Mark] = {}
        self._message: str | None = None

    def __len__(self) -> int:
        return len(self._marks)

    @property
    def message(self) -> str:
        """All of them as JSON, sorted, whether events or a reading brought them; the same string until one changes."""
        if self._message is None:
            marks = sorted(self._marks.values())
            columns = {name: [getattr(mark, name) for mark in marks] for name in Mark._fields}
            self._message = json.dumps({"kind": "inside", "fence": self._fence, **columns})
        return self._message

    def replace(self, marks: Iterable[Mark]) -> None:
        """Mark these subjects and no others."""
        new = {(mark.hull, mark.key): mark for mark in marks}
        if new != self._marks:
            self._marks, self._message = new, None

    def take(self, event: FenceEvent) -> None:
        """Mark who enters, and no longer who leaves: sooner than by the next reading."""
        subject = event.hull, str(event.key)
        former = event.previous_hull or event.hull, str(event.key)
        if event.type in ("exit", "transfer") and former in self._marks:
            del self._marks[former]
            self._message = None
        if event.type in ("enter", "transfer") and event.position is not None and len(self) < MOST_MARKED:
            self._marks[subject] = Mark(*subject, *shown_place(*event.position, self.center))
            self._message = None
