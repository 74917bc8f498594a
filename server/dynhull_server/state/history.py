"""Hulls of earlier revisions, for watchers that resume."""

from collections import deque
from dataclasses import dataclass

from dynhull.arrays import Points

from .errors import RevisionForgottenError

# What an entry takes beside its vertices, about.
ENTRY_BYTES = 300


@dataclass(slots=True)
class Entry:
    """The vertices from the first of these revisions to the last; `last` is None for as long as the hull stays so."""

    first: int
    last: int | None
    vertices: Points


class History:
    """The vertices somebody has been told, by revision; the oldest are forgotten.

    A watcher resumes from what it was told. So hulls that nobody was told are not kept, and a batch that nobody looks
    after costs nothing.

    Args:
        most_bytes: how much to remember, about.
        vertices: the hull at the revision `first`.
        first: where the history begins.
    """

    def __init__(self, most_bytes: int, vertices: Points, first: int = 0) -> None:
        self._most_bytes = most_bytes
        self._entries = deque([Entry(first, None, vertices)])
        self._bytes = ENTRY_BYTES

    def told(self, first: int, vertices: Points) -> None:
        """The hull has these vertices, and has had them since the revision `first`."""
        self._entries.append(Entry(first, None, vertices))
        self._bytes += ENTRY_BYTES + vertices.nbytes
        while self._bytes > self._most_bytes and len(self._entries) > 1:
            self._bytes -= ENTRY_BYTES + self._entries.popleft().vertices.nbytes

    def changed(self, revision: int) -> None:
        """The hull is another one from this revision on."""
        if self._entries[-1].last is None:
            self._entries[-1].last = revision - 1

    def at(self, revision: int, newest: int) -> Points | None:
        """The vertices at a revision, None where nobody was told them.

        Raises:
            RevisionForgottenError: it is older than all that is remembered, or beyond `newest`, which is now.
        """
        oldest = self._entries[0].first
        if not oldest <= revision <= newest:
            raise RevisionForgottenError(revision, oldest, newest)
        for entry in reversed(self._entries):
            if entry.first <= revision:
                return entry.vertices if entry.last is None or revision <= entry.last else None
        return None
