"""What a root and its shards need of a log. A change is durable when the method returns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from dynhull_server.state.records import Cause, Division, Kept, Record

from .messages import Effect, VertexChange


@dataclass(frozen=True, slots=True)
class Decided:
    """What the decisions so far have led to.

    Attributes:
        number: the number of the last step that happened and is in the log of a shard.
        revision: the revision of the hull.
        cause: what made it; None for revision 0, and where that is no longer known.
        clock: the clock of the hull, None for a hull without a clock.
        producers: the last number of each producer.
        skipping: the producers whose numbers may be skipped.
        steps: the last step in the log of each shard that has any.
        division: how the points are divided; None for as at the creation of the hull.
    """

    number: int = 0
    revision: int = 0
    cause: Cause | None = None
    clock: int | None = None
    producers: Mapping[str, int] = field(default_factory=dict)
    skipping: frozenset[str] = frozenset()
    steps: Mapping[int, int] = field(default_factory=dict)
    division: Division | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """A step that happened, or that the points are divided in another way, which changes no points.

    Attributes:
        number: the number of the step.
        revision: the revision of the hull after it.
        cause: what made this revision.
        clock: the clock of the hull after it, None for a hull without a clock.
        shards: the shards that have it in their logs.
        producer: the producer that numbered the batch; empty where it has no number.
        sequence: its number.
        may_skip: whether numbers of the producer may be skipped.
        effects: what each shard has done.
        division: how the points are divided from now on; None for as before. The shards are those of this division.
        replaced: the vertices of all shards before and after, if they are divided in another way.
    """

    number: int
    revision: int
    cause: Cause
    clock: int | None
    shards: frozenset[int]
    producer: str = ""
    sequence: int = 0
    may_skip: bool = False
    effects: Mapping[int, Effect] = field(default_factory=dict)
    division: Division | None = None
    replaced: VertexChange | None = None


class FencedError(Exception):
    """Another root has begun since."""


class RootLog(Protocol):
    """The decisions of a hull."""

    def begin(self, epoch: int | None) -> tuple[int, Decided]:
        """Begin an epoch that no root had before. Returns it, and what is decided; no earlier epoch decides any more.

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

    def read(self) -> tuple[Kept, int]:
        """All points, and the number of the last step, 0 for none."""
