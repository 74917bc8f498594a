"""A watcher's own copies of many hulls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from ._hull_copy import HullCopy
from ._messages import Snapshot

if TYPE_CHECKING:
    from ._many_messages import ManyChange


class HullCopies(Mapping[str, HullCopy]):
    """Copies of watched hulls by name, which answer questions without a call: a mapping that follows its watch.

    A name is there from the first state of its hull until it is gone. Each copy is exact at the revision of the last
    state that arrived; see `HullCopy`. One that was taken goes on being updated as long as the hull exists.

    Args:
        max_staleness: that of each copy. A hull that does not change has no new states: rather look at `position`.

    Attributes:
        position: how far the watch is; None before its first picture is complete.
        max_staleness: as given.
    """

    position: bytes | None

    def __init__(self, *, max_staleness: float | None = None) -> None:
        self.position = None
        self.max_staleness = max_staleness
        self._copies: dict[str, HullCopy] = {}

    def update(self, change: ManyChange) -> None:
        """Apply what a watch of outlines has returned. O(h)."""
        if change.kind == "state":
            if change.vertices is None:
                raise ValueError('copies follow a watch with contents="outline": this one has no vertices')
            copy = self._copies.get(change.hull)
            if copy is None:
                copy = self._copies[change.hull] = HullCopy(max_staleness=self.max_staleness)
            copy.update(
                Snapshot(
                    change.revision,
                    change.points,
                    change.vertices,
                    change.measures,
                    change.uid,
                    clock=change.clock,
                    center=change.center,
                    changed=change.changed,
                )
            )
        elif change.kind == "gone":
            gone = self._copies.pop(change.hull, None)
            if gone is not None:
                gone.clear()
        self.position = change.position

    def __getitem__(self, name: str) -> HullCopy:
        return self._copies[name]

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._copies))

    def __len__(self) -> int:
        return len(self._copies)

    def __repr__(self) -> str:
        return f"<HullCopies of {len(self)} hulls>"
