"""How much the state may hold."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on the state, each with the name that refusals tell.

    Attributes:
        max_hulls: hulls at a time.
        max_points: points of a hull, with multiplicity.
        max_producers: writers that number their batches, a hull.
        history_bytes: memory for what watchers may resume from, a hull.
    """

    max_hulls: int
    max_points: int
    max_producers: int
    history_bytes: int
