"""What a root and its shards need of a log. A change is durable when the method returns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from dynhull_server.state.hull_state import Cause
from dynhull_server.state.records import Kept, Record


@dataclass(frozen=True, slots=True)
class Decision:
    """A step that happened.

    Attributes:
        number: the number of the step.
        revision: the revision of the hull after it.
        cause: what made this revision.
        clock: the clock of the hull after it, None for a hull without a clock.
        shards: the shards that have it in their logs.
        producer: the producer that numbered the batch; empty where it has no number.
        sequence: its number.
        may_skip: whether numbers of the producer may be skipped.
    """

    number: int
    revision: int
    cause: Cause
    clock: int | None
    shards: frozenset[int]
    producer: str = ""
    sequence: int = 0
    may_skip: bool = False


class FencedError(Exception):
    """Another root has begun since."""


class RootLog(Protocol):
    """The decisions of a hull."""

    def begin(self, epoch: int | None) -> tuple[int, list[Decision]]:
        """Begin an epoch that no root had before. Returns it with all decisions; no earlier epoch adds any more.

        A root that has an epoch names it. Raises FencedError where a later one has begun since.
        """

    def decide(self, epoch: int, decisions: Sequence[Decision]) -> None:
        """Add decisions, as one change. Raises FencedError where a later epoch has begun."""


class ShardLog(Protocol):
    """The steps of a shard."""

    @property
    def epoch(self) -> int:
        """The last epoch that was begun, 0 before the first."""

    def begin(self, epoch: int, decided: int) -> None:
        """Begin an epoch, later than all before, and drop the steps after `decided`, as one change."""

    def add(self, steps: Sequence[tuple[int, list[Record]]]) -> None:
        """Add steps, as one change: the number of each, later than all before, which is the revision of its records."""

    def drop(self, number: int) -> None:
        """Drop the steps from this number on."""

    def read(self) -> Kept:
        """All points."""
