"""The batches of a writer: gathered, numbered, sent, acknowledged.

No I/O and no clock: `Writer` and `AsyncWriter` add them.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import grpc

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Writing
from ._errors import (
    DynhullError,
    HullNotFoundError,
    PermissionDeniedError,
    ProducerInUseError,
    SequenceGapError,
    UnauthenticatedError,
)
from ._gathering import Gathering, Part
from ._messages import Applied, decode_applied
from ._retry import passes, pauses

if TYPE_CHECKING:
    from asyncio import Future as TaskFuture
    from concurrent.futures import Future as ThreadFuture

# These refuse the writer, not one of its batches.
FATAL = (HullNotFoundError, PermissionDeniedError, ProducerInUseError, SequenceGapError, UnauthenticatedError)
Future = TypeVar("Future", "ThreadFuture[Applied]", "TaskFuture[Applied]")
Settled = list[tuple[Any, Applied | DynhullError]]


@dataclass(slots=True)
class Next(Generic[Future]):
    """The batch being gathered.

    Attributes:
        outcome: the future of its effect.
        due: the time at which it is sent at the latest.
        gathering: the parts put so far.
    """

    outcome: Future
    due: float
    gathering: Gathering


@dataclass(slots=True)
class Batch(Generic[Future]):
    """A numbered batch.

    Attributes:
        outcome: the future of its effect.
        request: the message.
        sent: how often it was sent.
    """

    outcome: Future
    request: pb.StreamRequest
    sent: int = 0


class Window(Generic[Future]):
    """The batches of a writer that are not acknowledged.

    Attributes:
        sequence: the number of the last acknowledged batch.
        failure: the error that ended the writer; None while it works.
        begun: the number of batches begun.
        settled: the number of batches applied or refused.
    """

    def __init__(self, writing: Writing, sequence: int, new_outcome: Callable[[], Future]) -> None:
        self.sequence = sequence
        self.failure: DynhullError | None = None
        self.begun = 0
        self.settled = 0
        self._writing = writing
        self._new_outcome: Callable[[], Future] = new_outcome
        self._next: Next[Future] | None = None
        self._under_way: deque[Batch[Future]] = deque()
        self._on_this_connection = 0
        self._one_at_a_time = False
        self._refusal: DynhullError | None = None
        self._pauses = pauses()
        self._lost_since: float | None = None

    @property
    def full(self) -> bool:
        """Whether there is no room for more points."""
        return self._next is not None and self._next.gathering.rows >= self._writing.batch_points

    @property
    def empty(self) -> bool:
        """Whether everything is acknowledged."""
        return self._next is None and not self._under_way

    def admits(self, part: Part) -> bool:
        """Whether the part can be put now: there is room, and it may go into the batch being gathered."""
        return self._next is None or (not self.full and self._next.gathering.admits(part))

    def put(self, part: Part, now: float) -> Future:
        """Add a part to the batch being gathered; returns its outcome."""
        if self.failure is not None:
            raise self.failure
        if self._next is None:
            gathering = Gathering(coalesce=self._writing.coalesce == "last")
            self._next = Next(self._new_outcome(), now + self._writing.linger, gathering)
            self.begun += 1
        self._next.gathering.add(part)
        return self._next.outcome

    def hurry(self, now: float) -> None:
        """Make the gathered points due now."""
        if self._next is not None:
            self._next.due = now

    def first(self) -> pb.StreamRequest:
        """The first message of a connection."""
        return pb.StreamRequest(name=self._writing.name, producer=self._writing.producer)

    def take(self, now: float) -> pb.StreamRequest | None:
        """The next message to send on this connection; None if there is none yet."""
        most = 1 if self._one_at_a_time else self._writing.in_flight
        if self._on_this_connection >= most:
            return None
        if self._on_this_connection == len(self._under_way):
            following = self._next
            if following is None or (following.due > now and not self.full):
                return None
            self._next = None
            sequence = self.sequence + len(self._under_way) + 1
            request = pb.StreamRequest(batch=following.gathering.joined(), sequence=sequence)
            self._under_way.append(Batch(following.outcome, request))
        batch = self._under_way[self._on_this_connection]
        self._on_this_connection += 1
        batch.sent += 1
        return batch.request

    def due_in(self, now: float) -> float | None:
        """Seconds until the gathered points are due; None if nothing waits for that."""
        waits = self._next is not None and self._on_this_connection == len(self._under_way)
        return max(0.0, self._next.due - now) if self._next is not None and waits else None

    def acknowledge(self, response: pb.StreamResponse) -> Settled:
        """Settle the first batch under way, which was applied."""
        if not self._under_way:  # abandoned while the response was on its way
            return []
        applied = decode_applied(response.result)
        if applied.duplicate and self._under_way[0].sent == 1:
            batch = f"batch {response.sequence} of producer {self._writing.producer!r}"
            message = f"{batch} had been applied before it was sent: another writer uses the same name"
            return self._end(ProducerInUseError(message, grpc.StatusCode.FAILED_PRECONDITION, "PRODUCER_IN_USE", {}))
        self._lost_since, self._pauses = None, pauses()
        self._one_at_a_time = False
        self._on_this_connection -= 1
        self.sequence += 1
        self.settled += 1
        return [(self._under_way.popleft().outcome, applied)]

    def lost(self, error: DynhullError, now: float) -> tuple[Settled, float | None]:
        """Handle the end of a connection: what it settles, and the seconds until the next one; None for no next one."""
        alone = self._on_this_connection == 1
        self._on_this_connection = 0
        if isinstance(error, FATAL) or error.code == grpc.StatusCode.CANCELLED:
            return self._end(error), None
        if error.reason and not passes(error):
            return self._refuse(error)
        if error.code == grpc.StatusCode.RESOURCE_EXHAUSTED and alone:  # gRPC's own limit on messages
            return self._refuse(error)
        # If it is unknown which batch failed, or whether it was applied, sending one at a time finds out.
        self._one_at_a_time = not passes(error)
        if self.empty or self._lost_since is None:
            self._lost_since = now
        if now - self._lost_since > self._writing.patience:
            return self._end(error), None
        return [], next(self._pauses)

    def abandon(self) -> list[Future]:
        """Drop all batches; returns their outcomes, which stay unknown."""
        left = [each.outcome for each in self._under_way]
        if self._next is not None:
            left.append(self._next.outcome)
        self._next = None
        self._under_way.clear()
        return left

    def raise_refusal(self) -> None:
        """Raise the error that ended the writer, or the first refusal since the last call."""
        refusal, self._refusal = self.failure or self._refusal, None
        if refusal is not None:
            raise refusal

    def _refuse(self, error: DynhullError) -> tuple[Settled, float | None]:
        """Settle the first batch, which is at fault, as all before it are acknowledged; renumber the others."""
        if self._writing.stop_on_error:
            return self._end(error), None
        self._refusal = self._refusal or error
        refused = self._under_way.popleft()
        self.settled += 1
        self._lost_since = None
        for batch in self._under_way:
            batch.request.sequence -= 1
            batch.sent = 0
        return [(refused.outcome, error)], 0.0

    def _end(self, error: DynhullError) -> Settled:
        self.failure = error
        return [(outcome, error) for outcome in self.abandon()]


def settle(settled: Settled) -> None:
    """Set the outcomes of batches."""
    for outcome, result in settled:
        if outcome.done():  # cancelled by its caller
            continue
        if isinstance(result, Applied):
            outcome.set_result(result)
        else:
            outcome.set_exception(result)
            outcome.exception()  # flush and close raise it too: asyncio need not report it as never retrieved
