"""Limits on the state."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on the state; error messages use the field names.

    Attributes:
        max_hulls: the number of hulls.
        max_points: the number of points per hull, with multiplicity.
        max_producers: the number of producers (writers that number their batches) per hull.
        max_producers_per_caller: the number of producers per hull that belong to one caller.
        history_bytes: the memory per hull for the history that watchers resume from.
    """

    max_hulls: int
    max_points: int
    max_producers: int
    max_producers_per_caller: int
    history_bytes: int
