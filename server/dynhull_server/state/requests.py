"""Requests of callers. Each is answered once, by a `Reply` that lists it, unless it was abandoned."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .batch import Write
from .records import DEFAULT, Center, HullSettings, Record

if TYPE_CHECKING:
    from collections.abc import Callable

    from .hull import Hull
    from .hull_state import HullState


@dataclass(frozen=True, slots=True)
class Birth:
    """The origin of a new hull: `uid` distinguishes it from others of its name; `created` is in seconds since 1970."""

    uid: str
    created: float


@dataclass(slots=True, eq=False)
class Request:
    """A request of a caller.

    Attributes:
        to: the recipient of the answer; the core does not look at it.
        rows: the approximate number of points it reads or writes.
        result: the result, once it is answered.
        error: the reason of a refusal, once it is answered; None where it was not refused.
        abandoned: whether the caller has disconnected: it is not answered, and the request is dropped if it has not
            begun.
    """

    to: Any
    rows: int = field(default=0, kw_only=True)
    result: Any = field(default=None, init=False)
    error: Exception | None = field(default=None, init=False)
    abandoned: bool = field(default=False, init=False)

    def leave(self) -> None:
        """Record that the caller has disconnected."""
        self.abandoned = True


@dataclass(slots=True, eq=False)
class CreateHull(Request):
    """Create an empty hull. The result is the Hull.

    Attributes:
        name: its name.
        birth: its identity.
        settings: its settings.
        time: the server's clock, in microseconds since 1970.
    """

    name: str
    birth: Birth
    settings: HullSettings = DEFAULT
    time: int = 0


@dataclass(slots=True, eq=False)
class DeleteHull(Request):
    """Delete a hull.

    Attributes:
        name: its name.
        time: the server's clock, in microseconds since 1970.
    """

    name: str
    time: int = 0


@dataclass(slots=True, eq=False)
class Recenter(Request):
    """Move the centre of a geographic hull. The result is its counts, and whether its vertices have changed.

    Attributes:
        name: its name.
        center: the new centre; None for the mean direction of its points.
        time: the server's clock, in microseconds since 1970.
    """

    name: str
    center: Center | None
    time: int = 0


@dataclass(slots=True, eq=False)
class WriteBatch(Request):
    """Apply a batch. The result is an `Applied`.

    Attributes:
        write: the batch.
        birth: the origin of the hull, if a missing hull shall be created; None if it shall be refused.
        stream: the stream that the batch is part of, or None.
    """

    write: Write
    birth: Birth | None = None
    stream: "Stream | None" = None

    def __post_init__(self) -> None:
        self.rows = self.write.rows

    @property
    def name(self) -> str:
        """The name of the hull."""
        return self.write.name


@dataclass(slots=True, eq=False)
class WriteTogether(Request):
    """Apply one batch to each of several hulls: all of them or none. The result is a list with an `Applied` of each.

    Attributes:
        parts: the batches, each to a different hull. They have the same producer and sequence.
        refused: the index of the part that was refused, once it is answered; None where the cause is not a part.
    """

    parts: Sequence[Write]
    refused: int | None = field(default=None, init=False)
    order: int = field(default=0, init=False)


@dataclass(slots=True, eq=False)
class ReadHull(Request):
    """Read a hull. The result is the counts at one revision, and the value of `function` at it."""

    hull: "Hull"
    function: "Callable[[HullState], Any]"

    @property
    def name(self) -> str:
        """The name of the hull."""
        return self.hull.name


@dataclass(slots=True, eq=False)
class ReadTogether(Request):
    """Read several hulls at one moment. The result is the counts of each, and the value of `function` at their states.

    Attributes:
        parts: the hulls, each once.
    """

    parts: "list[Hull]"
    function: "Callable[[list[HullState]], Any]"
    order: int = field(default=0, init=False)


@dataclass(slots=True, eq=False)
class Follow(Request):
    """Have the root of a hull over shards follow what was decided.

    Attributes:
        hull: the hull.
        records: the revisions.
        due: the time by the server's clock before which no point leaves; None if that clock makes none leave.
    """

    hull: "Hull"
    records: "list[Record]"
    due: int | None

    @property
    def name(self) -> str:
        """The name of the hull."""
        return self.hull.name


# Requests that wait in the queues of several hulls. `order` is greater for those that come later; the core sets it.
Together = WriteTogether | ReadTogether


@dataclass(slots=True, eq=False)
class Expire(Request):
    """Remove the points of a hull that leave at `time`, by the server's clock. The result is their number.

    The core makes it at a Tick.
    """

    hull: "Hull"
    time: int

    @property
    def name(self) -> str:
        """The name of the hull."""
        return self.hull.name


# Requests to one hull other than its batches.
HullRequest = CreateHull | DeleteHull | Recenter | ReadHull | Follow | Expire


@dataclass(slots=True, eq=False)
class Stream:
    """Batches of one caller to one hull, applied in the order of their requests.

    A refused batch stops the stream: the batches after it are neither applied nor answered.

    Attributes:
        name: the name of the hull.
        hull: the hull, once a batch has been applied to it: all later ones must apply to the same hull.
        stopped: whether a batch has been refused, or the caller has disconnected.
    """

    name: str
    hull: "Hull | None" = None
    stopped: bool = False

    def leave(self) -> None:
        """Record that the caller has disconnected."""
        self.stopped = True
