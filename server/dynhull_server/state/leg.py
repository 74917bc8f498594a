"""The part of a trip at one hull."""

from .changes import Change
from .hull import Hull
from .hull_state import HullState
from .records import Append, Create, Delete, Record


class Leg:
    """The part of a trip at one hull.

    Args:
        name: the name of the hull.
        hull: the hull of that name, or None.
        keeps: whether the storage keeps batches.
        fenced: whether fences look at what the batches have changed.

    Attributes:
        before: the hull before the trip, or None.
        after: the hull after it, or None.
        records: the batches applied; None where neither the storage nor a fence needs them.
        unsaved: the number of points in them.
    """

    __slots__ = ("_keeps", "after", "before", "name", "records", "unsaved")

    def __init__(self, name: str, hull: Hull | None, *, keeps: bool, fenced: bool = False) -> None:
        self.name = name
        self.before = self.after = hull
        self.records: list[Record] | None = [] if keeps or fenced else None
        self.unsaved = 0
        self._keeps = keeps

    def changes(self) -> list[Change]:
        """The changes to commit."""
        before, after, records = self.before, self.after, self.records if self._keeps else None
        if after is before:
            return [Append(after.row.number, records)] if records and after is not None else []
        changes: list[Change] = []
        if after is not None:
            changes.append(Create(after.row))
            if records:
                changes.append(Append(after.row.number, records))
        if before is not None and after is None:
            changes.append(Delete(before.row.number))
        return changes

    def landed(self, found: HullState | None) -> bool:
        """Whether the changes were committed, given the state of the hull in the storage."""
        if self.after is None:
            return found is None
        return found is not None and found.counts.revision >= self.after.state.counts.revision
