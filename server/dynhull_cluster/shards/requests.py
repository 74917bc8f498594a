"""What callers ask of a hull over shards."""

from dataclasses import dataclass, field
from typing import Any

from dynhull_server.state.requests import WriteBatch

from .messages import Question


@dataclass(slots=True, eq=False)
class RootRequest:
    """A request of a caller.

    Attributes:
        answered: whether it is answered.
        result: the result, once it is.
        error: the reason of a refusal, once it is; None where it was not refused.
    """

    answered: bool = field(default=False, init=False)
    result: Any = field(default=None, init=False)
    error: Exception | None = field(default=None, init=False)

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        self.result, self.error, self.answered = result, error, True


@dataclass(slots=True, eq=False)
class RootWrite(RootRequest):
    """Apply a batch that arrived at `now`, seconds on a monotonic clock. The result is an Applied."""

    batch: WriteBatch
    now: float

    @property
    def abandoned(self) -> bool:
        """Whether nobody waits for it, or its stream has stopped: then it is dropped unless it has begun."""
        stream = self.batch.stream
        return self.batch.abandoned or (stream is not None and stream.stopped)


@dataclass(slots=True, eq=False)
class ExpirePoints(RootRequest):
    """Make the points leave that leave at `clock`. The result is their number."""

    clock: int


@dataclass(slots=True, eq=False)
class Reshard(RootRequest):
    """Divide the points among another number of shards. The result is the revision that did, or has found it so."""

    shards: int


@dataclass(slots=True, eq=False)
class Read(RootRequest):
    """A question about all points. The result is the revision, and the answer.

    For StaticHull the answer is whether it is equal; for FoundOf, AllOf and Recompute it is the answers of all shards,
    and the vertices of the hull.
    """

    question: Question


AnyRootRequest = RootWrite | ExpirePoints | Reshard | Read
