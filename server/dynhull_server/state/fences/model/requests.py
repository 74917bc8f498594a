"""Requests about fences. Each waits in the queue of its fence; those that join or part hulls, in theirs too."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...requests import Birth, Request
from ..index.checked import CheckedArea
from .config import FenceConfig

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .fence import Fence
    from .records import FenceEvent

# Fences and hulls have names of their own, and queues of their own: no name of a hull has a colon.
PREFIX = "fence:"


@dataclass(slots=True, eq=False)
class FenceRequest(Request):
    """A request about a fence.

    Attributes:
        name: the name of the fence.
        time: the server's clock, in microseconds since 1970.
        names: the names of the queues in which it waits. The core sets this.
        order: see `Together`.
    """

    name: str
    time: int
    names: tuple[str, ...] = field(default=(), init=False)
    order: int = field(default=0, init=False)


@dataclass(slots=True, eq=False)
class CreateFence(FenceRequest):
    """Create a fence. The result is the Fence.

    Attributes:
        config: its settings.
        birth: its identity.
        checked: the polygons of its area, if they have been checked.
        gives_center: whether subjects without a centre get the middle of the area, which writes to their hull.
    """

    config: FenceConfig
    birth: Birth
    checked: CheckedArea | None = None
    gives_center: bool = True


@dataclass(slots=True, eq=False)
class ReplaceFence(FenceRequest):
    """Replace the area and the settings of a fence. The result is the Fence.

    Attributes:
        config: its settings.
        checked: the polygons of its area, if they have been checked.
    """

    config: FenceConfig
    checked: CheckedArea | None = None


@dataclass(slots=True, eq=False)
class DeleteFence(FenceRequest):
    """Delete a fence."""


@dataclass(slots=True, eq=False)
class ReadFence(FenceRequest):
    """Read a fence between two changes. The result is the value of `function`.

    Attributes:
        function: called with the fence, and with its events that are not yet committed.
    """

    function: "Callable[[Fence, Sequence[FenceEvent]], Any]"


@dataclass(slots=True, eq=False)
class Acknowledge(FenceRequest):
    """Create a consumer if it is new, and acknowledge events. The result is the Consumer.

    Attributes:
        consumer: its name.
        sequence: the last event that it acknowledges, None for none.
        uid: the uid of the fence; empty for any.
    """

    consumer: str
    sequence: int | None
    uid: str = ""


@dataclass(slots=True, eq=False)
class DeleteConsumer(FenceRequest):
    """Delete a consumer."""

    consumer: str


@dataclass(slots=True, eq=False)
class TrimEvents(FenceRequest):
    """Drop the events before the sequence `first`, and count them as lost by consumers that have not acknowledged them.

    Attributes:
        fence: the fence: another one of that name is left alone.
    """

    fence: "Fence"
    first: int


@dataclass(slots=True, eq=False)
class PassTime(FenceRequest):
    """Make the events of subjects that have been inside long enough at `time`. The result is 0: no point leaves.

    The core makes it at a Tick.

    Attributes:
        fence: the fence: another one of that name is left alone.
    """

    fence: "Fence"


@dataclass(slots=True, eq=False)
class AcknowledgeAlarm(FenceRequest):
    """Take note that somebody takes care of an alarm that is raised for a hull. The result is its AlarmStatus there."""

    hull: str


@dataclass(slots=True, eq=False)
class MuteAlarm(FenceRequest):
    """Mute an alarm for a hull until a time, in microseconds since 1970. The result is its AlarmStatus there."""

    hull: str
    until: int


# Requests that change which hulls share a queue, or what they are compared with.
STRUCTURAL = (CreateFence, ReplaceFence, DeleteFence)
AnyFenceRequest = (
    CreateFence
    | ReplaceFence
    | DeleteFence
    | ReadFence
    | Acknowledge
    | DeleteConsumer
    | TrimEvents
    | PassTime
    | AcknowledgeAlarm
    | MuteAlarm
)
