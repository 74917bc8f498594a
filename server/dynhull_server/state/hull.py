"""A hull as clients see it: its committed state."""

from .hull_state import Counts, HullState
from .records import CommitStamp, HullRow


class Hull:
    """One hull from its creation to its deletion.

    Attributes:
        row: its identity and settings, as stored.
        state: its points; read and change them only in a trip of its queue.
        counts: the counts at the latest committed revision.
        committed: the commit of its latest revision, or of its creation, or a later one before anything else was
            published; None for one of formats that did not store it.
        unsaved: points in batches since the last snapshot.
        between: points in batches between that and the one before it; 0 where none was written since it was loaded.
        timed: whether times matter: its points may leave by themselves.
        divided: whether its points are divided among shards, and the state is that of their root.
        due: the time at which the core makes points leave, None where it has no such plan.
        ended: whether it has been deleted.
    """

    __slots__ = ("between", "committed", "counts", "divided", "due", "ended", "row", "state", "timed", "unsaved")

    def __init__(self, row: HullRow, state: HullState, unsaved: int = 0) -> None:
        self.row = row
        self.state = state
        self.counts: Counts = state.counts
        self.committed: CommitStamp | None = state.committed
        self.unsaved = unsaved
        self.between = 0
        self.ended = False
        self.timed = row.settings.identity != "multiset" or row.settings.window is not None
        self.divided = row.settings.divided
        self.due: int | None = None

    @property
    def name(self) -> str:
        """Its name."""
        return self.row.name

    @property
    def uid(self) -> str:
        """Distinguishes it from other hulls of its name."""
        return self.row.uid

    @property
    def vertex_count(self) -> int:
        """The number of vertices when they were last read."""
        return self.state.vertex_count
