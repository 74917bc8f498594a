"""Vertices at earlier revisions, for watchers that resume."""

from dataclasses import dataclass

from dynhull.arrays import Points

from .errors import RevisionForgottenError

# The approximate size of an entry beside its vertices.
ENTRY_BYTES = 300


@dataclass(slots=True)
class Entry:
    """The vertices between two revisions, inclusive; `last` is None while the hull has not changed since."""

    first: int
    last: int | None
    vertices: Points


class SentVertices:
    """The vertices that have been sent to any client, by revision; the oldest are dropped.

    A watcher resumes from vertices it was sent. Others are not kept, so a batch costs nothing while nobody reads.

    Args:
        most_bytes: the approximate limit on memory.
        vertices: the vertices at the revision `first`.
        first: the first revision that is remembered.
    """

    __slots__ = ("_bytes", "_entries", "_most_bytes")

    def __init__(self, most_bytes: int, vertices: Points, first: int = 0) -> None:
        self._most_bytes = most_bytes
        self._entries = [Entry(first, None, vertices)]  # a deque takes 600 bytes, and most hulls need one entry
        self._bytes = ENTRY_BYTES

    def record(self, first: int, vertices: Points) -> None:
        """Add the present vertices, which the hull has had since the revision `first`."""
        self._entries.append(Entry(first, None, vertices))
        self._bytes += ENTRY_BYTES + vertices.nbytes
        while self._bytes > self._most_bytes and len(self._entries) > 1:
            self._bytes -= ENTRY_BYTES + self._entries.pop(0).vertices.nbytes

    def changed(self, revision: int) -> None:
        """Record that the vertices have changed at this revision."""
        if self._entries[-1].last is None:
            self._entries[-1].last = revision - 1

    def at(self, revision: int, newest: int) -> Points | None:
        """The vertices at a revision; None where they were never sent.

        Raises:
            RevisionForgottenError: the revision is older than those, or later than `newest`, the present one.
        """
        oldest = self._entries[0].first
        if not oldest <= revision <= newest:
            raise RevisionForgottenError(revision, oldest, newest)
        entry = next(each for each in reversed(self._entries) if each.first <= revision)
        return entry.vertices if entry.last is None or revision <= entry.last else None
