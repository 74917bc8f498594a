"""A hull that was loaded and that nobody has used since, as most of ten thousand are after a start."""

from dynhull import KeyedHull, PackedHull

from .contents import begun
from .contents.keyed import Keyed
from .hull_state import PUT_AWAY_POINTS, Counts, HullState, last_cause, last_sequences, skipping_of
from .limits import Limits
from .records import HullSettings, Kept, Parts
from .root_state import state_of


class Dormant:
    """What is known of a small hull of keys that have nothing but places. Its state is made when it is needed.

    Attributes:
        counts: its counts.
        committed: the commit of its last revision, as far as that is known.

    Args:
        limits: the limits on it.
        kept: the hull as stored.
        packed: its keys and their places.
        now: the time by the server's monotonic clock at which it was loaded.
    """

    __slots__ = ("_limits", "_numbered", "_packed", "committed", "counts")

    def __init__(self, limits: Limits, kept: Kept, packed: PackedHull, now: float) -> None:
        last = kept.last_revision
        self.counts = Counts(last, len(packed), packed.distinct, cause=last_cause(kept), outlined=last)
        self.committed = kept.records[-1].committed if kept.records else kept.committed
        self._limits = limits
        self._packed = packed
        sequences = last_sequences(kept)
        self._numbered = (sequences, skipping_of(kept), now) if sequences else None

    @property
    def vertex_count(self) -> int:
        """The number of its vertices."""
        return self._packed.vertex_count

    def wake(self, settings: HullSettings) -> HullState:
        """The state of a hull with these settings."""
        sequences, skipping, now = self._numbered or ({}, frozenset(), 0.0)
        counts = self.counts
        contents = Keyed(settings, Parts(0, []), None, self._limits.points_of(settings), None)
        contents.hold(KeyedHull.unpacked(self._packed))
        kept = Kept(counts.revision, producers=sequences, skipping=skipping, committed=self.committed)
        return HullState(self._limits, settings, kept, now, contents, counts)


def loaded(limits: Limits, settings: HullSettings, kept: Kept, now: float) -> HullState | Dormant:
    """A hull as stored, put together as far as it has to be before anybody uses it."""
    if settings.identity == "multiset" or settings.divided:
        state = state_of(limits, settings, kept, now)
        state.put_away(idle=False)
        return state
    contents = begun(kept, settings, limits.points_of(settings))
    contents.replay(kept.records)
    assert isinstance(contents, Keyed)  # of a hull with keys
    packed = contents.packed(PUT_AWAY_POINTS)
    if packed is not None:
        return Dormant(limits, kept, packed, now)
    contents.build()
    state = HullState(limits, settings, kept, now, contents)
    state.put_away(idle=False)
    return state
