"""A hull as clients see it: its committed state."""

from threading import Lock

from .dormant import Dormant
from .hull_state import Counts, HullState
from .records import CommitStamp, HullRow

WAKING = Lock()


class Hull:
    """One hull from its creation to its deletion.

    Attributes:
        row: its identity and settings, as stored.
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

    __slots__ = (
        *("_dormant", "_state", "between", "committed", "counts", "divided", "due", "ended", "row", "timed", "unsaved"),
    )

    def __init__(self, row: HullRow, state: HullState | Dormant, unsaved: int = 0) -> None:
        self.row = row
        self._dormant = state if isinstance(state, Dormant) else None
        self._state = None if isinstance(state, Dormant) else state
        self.counts: Counts = state.counts
        self.committed: CommitStamp | None = state.committed
        self.unsaved = unsaved
        self.between = 0
        self.ended = False
        self.timed = row.settings.identity != "multiset" or row.settings.window is not None
        self.divided = row.settings.divided
        self.due: int | None = None

    @property
    def state(self) -> HullState:
        """Its points; read and change them only in a trip of its queue."""
        state = self._state
        return self._woken() if state is None else state

    def _woken(self) -> HullState:
        """The state, made by whoever needs it first."""
        with WAKING:  # a thread may need it that reads, and the event loop
            if self._state is None:
                assert self._dormant is not None
                self._state, self._dormant = self._dormant.wake(self.row.settings), None
            return self._state

    def replace(self, state: HullState) -> None:
        """Have this state, which the storage has."""
        with WAKING:
            self._state, self._dormant = state, None

    def put_away(self) -> None:
        """Hold the keys of a small hull in less memory, if nobody has used them since the last call."""
        if self._dormant is None:
            self.state.put_away(idle=True)

    @property
    def next_due(self) -> int | None:
        """The time by the server's clock before which no point leaves; None if that clock makes none leave."""
        return None if self._dormant is not None else self.state.next_due

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
        dormant = self._dormant
        return self.state.vertex_count if dormant is None else dormant.vertex_count
