"""What a root and its shards say to each other. A reply has the epoch and the ticket of its message."""

from dataclasses import dataclass
from typing import Any

from dynhull.arrays import Points
from dynhull.static.trace import Round
from dynhull_server.state.batch import Applied
from dynhull_server.state.errors import RefusedError
from dynhull_server.state.records import Keys


@dataclass(frozen=True, slots=True)
class Message:
    """What all messages and replies begin with.

    Attributes:
        epoch: the root's epoch.
        ticket: the number of the round in this epoch.
    """

    epoch: int
    ticket: int


# From the root


@dataclass(frozen=True, slots=True)
class Open(Message):
    """Go back to the last step up to `decided`, and begin the epoch. The reply is Opened."""

    decided: int


@dataclass(frozen=True, slots=True)
class Step:
    """A part of a batch, to be applied after the points have left that leave at `clock`.

    Attributes:
        number: the number of the step.
        part: the rows as contents have admitted them, or None.
        clock: the clock of the hull after the step, None for a hull without a clock.
        undoable: whether it may have to be undone.
    """

    number: int
    part: Any
    clock: int | None
    undoable: bool


@dataclass(frozen=True, slots=True)
class Apply(Message):
    """Apply steps, in order, up to the first one that is refused. The steps before are decided. The reply is Done."""

    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True)
class Undo(Message):
    """Undo the steps from `number` on, the first of which another shard has refused. The reply is Undone."""

    number: int


@dataclass(frozen=True, slots=True)
class Ask(Message):
    """Answer a question about the points after the last step. The reply is Answered."""

    question: "Question"


# Questions


@dataclass(frozen=True, slots=True)
class SampleOf:
    """The `size` points of smallest hash, as `dynhull_server.state.sample` chooses them."""

    size: int


@dataclass(frozen=True, slots=True)
class CountOf:
    """The number of copies of each of (k, 2) points."""

    points: Points


@dataclass(frozen=True, slots=True)
class PositionsOf:
    """The (k, 2) positions of keys, NaN for a missing key."""

    keys: Keys


@dataclass(frozen=True, slots=True)
class StaticHull:
    """The hull of the points, computed anew from all of them."""


@dataclass(frozen=True, slots=True)
class FoundOf:
    """The positions and times of keys, as a Found of each shard."""

    keys: Keys


@dataclass(frozen=True, slots=True)
class AllOf:
    """All points, as the Contents of each shard."""


@dataclass(frozen=True, slots=True)
class SlotsOf:
    """The points of the slots from `first` to before `end`, as Contents; of one shard."""

    first: int
    end: int


@dataclass(frozen=True, slots=True)
class Recompute:
    """The hull by Chan's algorithm on all points, as a Recomputed of each shard."""


@dataclass(frozen=True, slots=True)
class Recomputed:
    """The hull of a shard, computed anew.

    Attributes:
        points: the number of its points.
        vertices: the vertices.
        rounds: the rounds of the algorithm.
        keys_equal: whether the positions of the keys are the points, each key once; True without keys.
    """

    points: int
    vertices: Points
    rounds: tuple[Round, ...]
    keys_equal: bool


Question = SampleOf | CountOf | PositionsOf | StaticHull | FoundOf | AllOf | Recompute | SlotsOf


# From a shard


@dataclass(frozen=True, slots=True)
class Corners:
    """Vertices of a shard's hull.

    Attributes:
        points: (n, 2) the vertices.
        keys: the key at each, None in a hull without keys.
    """

    points: Points
    keys: tuple[Any, ...] | None


@dataclass(frozen=True, slots=True)
class VertexChange:
    """The vertices that have gone from a shard's hull, and those that have come; one of another key has done both."""

    gone: Corners
    come: Corners


@dataclass(frozen=True, slots=True)
class ShardTotals:
    """Counts of a shard.

    Attributes:
        points: the number of points.
        distinct: the number of different points.
        due: the time by the server's clock before which no point leaves; None if that clock makes none leave.
    """

    points: int
    distinct: int
    due: int | None


@dataclass(frozen=True, slots=True)
class Opened(Message):
    """The shard is at the root's last decision: the last step in its log, its counts, and all of its vertices."""

    number: int
    totals: ShardTotals
    corners: Corners


@dataclass(frozen=True, slots=True)
class Effect:
    """What a step did.

    Attributes:
        number: the number of the step.
        totals: the counts after it.
        expired: the number of points that left before the part.
        left: how the vertices changed then; None where they did not.
        applied: the effect of the part; None where it is refused or there was no part.
        changed: how the vertices changed then; None where they did not.
        error: why the part is refused, which has changed nothing; None if it is not.
    """

    number: int
    totals: ShardTotals
    expired: int = 0
    left: VertexChange | None = None
    applied: Applied | None = None
    changed: VertexChange | None = None
    error: RefusedError | None = None

    @property
    def logged(self) -> bool:
        """Whether the step has changed the shard, and is in its log."""
        return self.applied is not None or self.expired > 0


@dataclass(frozen=True, slots=True)
class Done(Message):
    """What the steps did; the last one is refused if it has an error, and those behind it have not begun."""

    effects: tuple[Effect, ...]


@dataclass(frozen=True, slots=True)
class Undone(Message):
    """The steps are undone, and no longer in the log."""


@dataclass(frozen=True, slots=True)
class Answered(Message):
    """The answer to a question."""

    answer: Any


@dataclass(frozen=True, slots=True)
class Closed(Message):
    """The shard has lost its memory since this epoch began, or never knew it: it needs an Open of a later one."""


Request = Open | Apply | Undo | Ask
Reply = Opened | Done | Undone | Answered | Closed
