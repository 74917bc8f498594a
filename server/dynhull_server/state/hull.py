"""A hull as everybody sees it: what is committed."""

from .hull_state import Counts, HullState
from .records import HullRow


class Hull:
    """One hull from its creation to its deletion.

    Attributes:
        row: what is kept of it beside its points.
        state: its points; to be read and changed in its turn only.
        counts: as of the latest revision that anybody may be told of.
        unsaved: points in batches since the last snapshot.
        ended: whether it has been deleted.
    """

    __slots__ = ("counts", "ended", "row", "state", "unsaved")

    def __init__(self, row: HullRow, state: HullState, unsaved: int = 0) -> None:
        self.row = row
        self.state = state
        self.counts: Counts = state.counts
        self.unsaved = unsaved
        self.ended = False

    @property
    def name(self) -> str:
        """Its name."""
        return self.row.name

    @property
    def uid(self) -> str:
        """What tells it from other hulls of its name."""
        return self.row.uid

    @property
    def vertex_count(self) -> int:
        """The number of vertices when somebody last looked."""
        return self.state.vertex_count
