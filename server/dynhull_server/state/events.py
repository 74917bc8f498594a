"""What the core is told, and what it asks for. A ticket is a trip of one hull's work; only the core looks into it."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .records import Change, Kept

if TYPE_CHECKING:
    from collections.abc import Callable

    from .batch import Batch
    from .hull import Hull
    from .hull_state import HullState
    from .trip import Trip


@dataclass(frozen=True, slots=True)
class Birth:
    """Where a new hull comes from: `uid` tells it from others of its name, `created` is in seconds since 1970."""

    uid: str
    created: float


# Requests. Each is answered once, by a `Told` that names it, unless it was abandoned.


@dataclass(slots=True, eq=False)
class Request:
    """Something a caller wants done.

    Attributes:
        to: who is told; the core does not look at it.
        rows: about how many points it looks at.
        result: what came of it, once it is told.
        error: what refused it, once it is told; None where nothing did.
        abandoned: whether the caller has gone: it will not be told, and what has not begun is not done.
    """

    to: Any
    rows: int = field(default=0, kw_only=True)
    result: Any = field(default=None, init=False)
    error: Exception | None = field(default=None, init=False)
    abandoned: bool = field(default=False, init=False)

    def leave(self) -> None:
        """The caller has gone."""
        self.abandoned = True


@dataclass(slots=True, eq=False)
class CreateHull(Request):
    """Make an empty hull. The result is the Hull."""

    name: str
    birth: Birth
    max_points: int = 0


@dataclass(slots=True, eq=False)
class DeleteHull(Request):
    """Remove a hull."""

    name: str


@dataclass(slots=True, eq=False)
class WriteBatch(Request):
    """Apply a batch, of about `rows` points. The result is what it did.

    Attributes:
        make: decodes it, and raises what is wrong with it.
        producer: who numbers it; empty where it is not numbered.
        sequence: its number.
        owner: the caller who answers for the producer.
        name: the hull's; like the rest and `to`, whoever sends the request on its way says it.
        birth: of the hull, where it is to be made if it is not there; None where that is to be refused.
        stream: the stream that the batch is part of.
    """

    to: Any = field(default=None, init=False)
    rows: int
    make: "Callable[[], Batch]"
    producer: str = ""
    sequence: int = 0
    owner: str = ""
    name: str = field(default="", init=False)
    birth: Birth | None = field(default=None, init=False)
    stream: "Stream | None" = field(default=None, init=False)


@dataclass(slots=True, eq=False)
class ReadHull(Request):
    """Read a hull. The result is the counts at one revision, and what `function` returned at it."""

    hull: "Hull"
    function: "Callable[[HullState], Any]"


@dataclass(slots=True, eq=False)
class Stream:
    """Batches of one caller to one hull, applied in the order they are asked for.

    A batch that is refused stops the stream: nothing after it is applied, and nobody is told of what came after it.

    Attributes:
        name: the hull's.
        hull: the hull, once one batch has been applied to it: it must not become another one.
        stopped: whether a batch has been refused, or the caller has gone.
    """

    name: str
    hull: "Hull | None" = None
    stopped: bool = False

    def leave(self) -> None:
        """The caller has gone."""
        self.stopped = True


# Other events.


@dataclass(slots=True)
class Gone:
    """A caller does not wait any more."""

    what: Request | Stream


@dataclass(slots=True)
class Computed:
    """The work of a trip is done."""

    ticket: "Trip"


@dataclass(slots=True)
class Committed:
    """The storage has kept the changes of a trip."""

    ticket: "Trip"


@dataclass(slots=True)
class Failed:
    """The storage has not kept the changes of a trip, or it is `unknown` whether it has."""

    ticket: "Trip"
    error: Exception
    unknown: bool


@dataclass(slots=True)
class Examined:
    """What the storage has of a hull: None where there is none."""

    ticket: "Trip"
    state: "HullState | None"


@dataclass(slots=True)
class NotExamined:
    """The storage cannot be read."""

    ticket: "Trip"
    error: Exception


@dataclass(slots=True)
class Retried:
    """The pause that the core asked for is over."""

    ticket: "Trip"


@dataclass(slots=True)
class Tick:
    """Time has passed: seconds on a clock that never goes back."""

    now: float


@dataclass(slots=True)
class Stopping:
    """Begin nothing more."""


Event = Request | Gone | Computed | Committed | Failed | Examined | NotExamined | Retried | Tick | Stopping


# Effects.


@dataclass(slots=True)
class Compute:
    """Call `ticket.run()`, which takes long, away from everything else; then say Computed."""

    ticket: "Trip"


@dataclass(slots=True)
class Commit:
    """Keep all of the changes or none; then say Committed or Failed, or nothing where there is no ticket."""

    ticket: "Trip | None"
    changes: list[Change]


@dataclass(slots=True)
class Examine:
    """Find out what the storage has of a hull; then say Examined, with the state `load` makes of it, or NotExamined.

    With `settle`, a commit with an unknown outcome has to be decided first.
    """

    ticket: "Trip"
    number: int
    settle: bool
    load: "Callable[[Kept], HullState]"


@dataclass(slots=True)
class Retry:
    """Say Retried after a pause in seconds."""

    ticket: "Trip"
    pause: float
    reason: Exception


@dataclass(slots=True)
class Told:
    """Tell the callers of requests their results or errors, in this order.

    First, whoever waits for `moved` may look: it has a new revision, or it is no more.
    """

    requests: list[Request]
    moved: "Hull | None" = None


Effect = Compute | Commit | Examine | Retry | Told
