"""Events, the input of the core, and effects, its output. A ticket is a trip; only the core looks into it."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .changes import Change
from .requests import Expire, Request, Stream, WriteBatch

if TYPE_CHECKING:
    from collections.abc import Callable

    from .fences.events.block import EventBlock
    from .fences.model.fence import Fence
    from .fences.model.records import KeptFence
    from .fences.recovery.restored import Restored
    from .hull import Hull
    from .hull_state import HullState
    from .records import CommitStamp, Kept
    from .trip import Trip


@dataclass(slots=True)
class Arrived:
    """Batches of one stream have arrived together. Each is a request as if it had arrived alone."""

    batches: list[WriteBatch]


@dataclass(slots=True)
class Gone:
    """A caller no longer waits."""

    what: Request | Stream


@dataclass(slots=True)
class Computed:
    """A trip has run."""

    ticket: "Trip"


@dataclass(slots=True)
class Committed:
    """The storage has kept the changes of a trip, by that commit if it is known."""

    ticket: "Trip"
    commit: "CommitStamp | None" = None


@dataclass(slots=True)
class Failed:
    """The storage has not kept the changes of a trip, or it is `unknown` whether it has."""

    ticket: "Trip"
    error: Exception
    unknown: bool


@dataclass(slots=True)
class Examined:
    """The state in the storage of each hull of a trip; None for a hull that the storage does not have.

    Attributes:
        ticket: the trip.
        states: the states of the hulls.
        fences: the fences in the storage; None for those that it does not have.
        restored: the result of `Examine.restore`.
    """

    ticket: "Trip"
    states: "list[HullState | None]"
    fences: "list[KeptFence | None]" = field(default_factory=list)
    restored: "Restored | None" = None


@dataclass(slots=True)
class NotExamined:
    """The storage cannot be read."""

    ticket: "Trip"
    error: Exception


@dataclass(slots=True)
class Retried:
    """The pause of a Retry is over."""

    ticket: "Trip"


@dataclass(slots=True)
class Tick:
    """The time.

    Attributes:
        now: seconds on a monotonic clock.
        time: microseconds since 1970 by the server's clock, which never goes back.
        to: the recipient of the answers to the Expire requests that this makes.
    """

    now: float
    time: int = 0
    to: Any = None


@dataclass(slots=True)
class Stopping:
    """The server shuts down: begin no more trips."""


Event = Request | Arrived | Gone | Computed | Committed | Failed | Examined | NotExamined | Retried | Tick | Stopping


# Effects.


@dataclass(slots=True)
class Compute:
    """Call `ticket.run()` on another thread, for it takes long; then send Computed."""

    ticket: "Trip"


@dataclass(slots=True)
class Commit:
    """Commit all of the changes or none; then send Committed or Failed, or nothing if there is no ticket."""

    ticket: "Trip | None"
    changes: list[Change]


@dataclass(slots=True)
class Examine:
    """Decide commits with an unknown outcome, and read hulls; then send Examined, or NotExamined if that fails.

    Attributes:
        hulls: the number of each hull, and a function that makes its state of what is stored.
        fences: the numbers of fences.
        restore: makes the subjects of these fences, given what is stored; None where there is no fence.
    """

    ticket: "Trip"
    hulls: "list[tuple[int, Callable[[Kept], HullState]]]"
    fences: list[int] = field(default_factory=list)
    restore: "Callable[[list[HullState | None], list[KeptFence | None]], Restored | None] | None" = None


@dataclass(slots=True)
class Retry:
    """Send Retried after a pause in seconds."""

    ticket: "Trip"
    pause: float
    reason: Exception


@dataclass(slots=True)
class Reply:
    """Send the callers of requests their results or errors, in this order.

    Before that, wake the watchers of the hulls `moved`: each has a new revision, or was deleted.
    """

    requests: list[Request]
    moved: "tuple[Hull, ...]" = ()


@dataclass(slots=True)
class WakeFences:
    """Wake the watchers of fences that have new events or settings.

    Attributes:
        fences: those of them that have changed otherwise than by crossings of subjects.
        events: all new events; None for none.
    """

    fences: "list[Fence]"
    events: "EventBlock | None"


@dataclass(slots=True)
class Divide:
    """Have the shards of a hull carry out requests, in this order, and answer them."""

    hull: "Hull"
    requests: "list[WriteBatch | Expire]"


Effect = Compute | Commit | Divide | Examine | Retry | Reply | WakeFences
