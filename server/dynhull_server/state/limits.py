"""How much the state may hold."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on the state; error messages use the field names.

    Attributes:
        max_hulls: hulls at a time.
        max_points: points of a hull, with multiplicity.
        max_producers: writers that number their batches, a hull.
        max_producers_per_caller: how many of those one caller may name, a hull.
        history_bytes: memory for what watchers may resume from, a hull.
    """

    max_hulls: int
    max_points: int
    max_producers: int
    max_producers_per_caller: int
    history_bytes: int
