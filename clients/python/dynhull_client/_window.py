"""The batches of a writer: gathered, numbered, sent, acknowledged.

No I/O and no clock: `Writer` and `AsyncWriter` add them.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import grpc

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Known, Writing, led_back
from ._errors import (
    DynhullError,
    HullNotFoundError,
    MethodUnknownError,
    PermissionDeniedError,
    ProducerInUseError,
    RestoredError,
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
FATAL = (
    HullNotFoundError,
    MethodUnknownError,
    PermissionDeniedError,
    ProducerInUseError,
    RestoredError,
    SequenceGapError,
    UnauthenticatedError,
)
Future = TypeVar("Future", "ThreadFuture[Applied]", "TaskFuture[Applied]")
LARGEST_SEQUENCE = 2**63 - 1
# The size up to which batches share a message: beyond that, the cost of a message does not count.
MESSAGE_BYTES = 2**16
# Around a batch in a message: the key and the length.
FRAME_BYTES = 16
Settled = list[tuple[Any, Applied | DynhullError]]


@dataclass(slots=True)
class Next(Generic[Future]):
    """The batch being gathered.

    Attributes:
        outcome: the future of its effect.
        due: the time at which it is sent at the latest.
        gathering: the parts put so far.
        number: the number that the caller gave it; 0 if the writer counts its batches.
    """

    outcome: Future
    due: float
    gathering: Gathering
    number: int = 0


@dataclass(slots=True)
class SentBatch(Generic[Future]):
    """A numbered batch.

    Attributes:
        outcome: the future of its effect.
        message: the batch with its number.
        size: its size in bytes.
        sent: how often it was sent.
    """

    outcome: Future
    message: pb.NumberedBatch
    size: int
    sent: int = 0


class InFlight(Generic[Future]):
    """The batches of a writer that are not acknowledged.

    Attributes:
        sequence: the number of the last acknowledged batch.
        uid: the uid of the hull; empty if the server is an older one, which does not say it.
        failure: the error that ended the writer; None while it works.
        begun: the number of batches begun.
        settled: the number of batches applied or refused.
    """

    def __init__(self, writing: Writing, known: Known, new_outcome: Callable[[], Future]) -> None:
        self.sequence = sequence = known.sequence
        self.uid = known.uid
        self.failure: DynhullError | None = None
        self.begun = 0
        self.settled = 0
        self._writing = writing
        self._new_outcome: Callable[[], Future] = new_outcome
        self._last = sequence  # the last number given
        self._before = sequence  # that of the batch before the next one
        self._next: Next[Future] | None = None
        self._awaited: Next[Future] | None = None  # the one whose time the sender waits for
        self._waiting: deque[SentBatch[Future]] = deque()  # to be sent on this connection
        self._waiting_bytes = 0
        self._sent: deque[SentBatch[Future]] = deque()  # on this connection
        self._most_batches = self._most_bytes = 0  # of a message, once the server has announced that it takes several
        self._one_at_a_time = False
        self._refusal: DynhullError | None = None
        self._pauses = pauses()
        self._lost_since: float | None = None

    @property
    def empty(self) -> bool:
        """Whether everything is acknowledged."""
        return self._next is None and not self._waiting and not self._sent

    def admits(self, part: Part) -> bool:
        """Whether the part can be put now: into the batch being gathered, or because another batch can begin."""
        return self._next is None or self._joins(self._next, part) or self._room

    def number(self, parts: Sequence[Part], sequence: int | None) -> int:
        """The number of parts, 0 if the writer numbers its batches; raises ValueError for a bad one."""
        if sequence is None and not self._writing.may_skip:
            return 0
        if sequence is None or not self._writing.may_skip:
            raise ValueError("with may_skip=True, and only then, each put and remove has a sequence")
        if not 1 <= sequence <= LARGEST_SEQUENCE:
            raise ValueError(f"sequence must be from 1 to {LARGEST_SEQUENCE}, got {sequence}")
        if len(parts) > 1:
            raise ValueError("changes with a sequence are one batch, which has each key once")
        return sequence

    def put(self, part: Part, now: float, number: int) -> Future:
        """Add a part that the window admits; returns the outcome of its batch.

        `number` is that of the part, 0 if the writer numbers its batches. A batch has the number of its last part.
        """
        if self.failure is not None:
            raise self.failure
        following = self._next
        if number and number <= (last := self._last if following is None else following.number):
            raise ValueError(f"sequence must be greater than the one before, {last}, got {number}")
        if following is not None and not self._joins(following, part):
            self._complete(following)
            following = None
        if following is None:
            gathering = Gathering(part, coalesce=self._writing.coalesce == "last")
            following = self._next = Next(self._new_outcome(), now + self._writing.linger, gathering)
            self.begun += 1
        else:
            following.gathering.add(part)
        following.number = number
        if self._full(following) and self._room:
            self._complete(following)
        return following.outcome

    def hurry(self, now: float) -> None:
        """Make the gathered points due now."""
        if self._next is not None:
            self._next.due = now

    def first(self) -> pb.StreamRequest:
        """The first message of a connection."""
        writing = self._writing
        return pb.StreamRequest(
            name=writing.name,
            producer=writing.producer,
            accept_results=True,
            may_skip=writing.may_skip,
            uid=self.uid,
        )

    @property
    def ready(self) -> bool:
        """Whether there is a message for the sender, or a batch is being gathered that it does not wait for yet."""
        return self._sendable or self._next is not self._awaited

    def take(self, now: float) -> pb.StreamRequest | None:
        """The next message to send on this connection, with all batches that fit; None if there is none yet."""
        following = self._next
        if following is not None and self._room and (following.due <= now or self._full(following)):
            self._complete(following)
        if not self._sendable:
            return None
        if not self._most_batches or self._one_at_a_time:
            message = self._send()
            alone = pb.StreamRequest(batch=message.batch, sequence=message.sequence)
            if message.HasField("after_sequence"):
                alone.after_sequence = message.after_sequence
            return alone
        waiting, batches = self._waiting, [self._send()]
        room = self._most_bytes - self._sent[-1].size
        while waiting and len(batches) < self._most_batches and waiting[0].size <= room:
            room -= waiting[0].size
            batches.append(self._send())
        return pb.StreamRequest(batches=batches)

    def due_in(self, now: float) -> float | None:
        """Seconds for the sender to wait until the gathered points are due; None if nothing waits for that."""
        self._awaited = following = self._next
        return max(0.0, following.due - now) if following is not None and self._room else None

    def acknowledge(self, response: pb.StreamResponse) -> Settled:
        """Settle the first batches sent, which were applied."""
        if response.max_batches:
            self._most_batches = response.max_batches
            self._most_bytes = min(MESSAGE_BYTES, response.max_message_bytes - FRAME_BYTES)
            return []
        settled: Settled = []
        for each in response.results or (response,):
            if not self._sent:  # abandoned while the response was on its way
                break
            applied = decode_applied(each.result)
            batch = self._sent[0]
            if applied.duplicate and batch.sent == 1:
                name = f"batch {each.sequence} of producer {self._writing.producer!r}"
                message = f"{name} had been applied before it was sent: another writer uses the same name"
                error = ProducerInUseError(message, grpc.StatusCode.FAILED_PRECONDITION, "PRODUCER_IN_USE", {})
                return settled + self._end(error)
            self._sent.popleft()
            self.sequence = batch.message.sequence
            self.settled += 1
            settled.append((batch.outcome, applied))
        if settled and self._lost_since is not None:
            self._lost_since, self._pauses = None, pauses()
        self._one_at_a_time = False
        return settled

    def lost(self, error: DynhullError, now: float) -> tuple[Settled, float | None]:
        """Handle the end of a connection: what it settles, and the seconds until the next one; None for no next one."""
        alone = len(self._sent) == 1
        self._waiting.extendleft(reversed(self._sent))
        self._waiting_bytes += sum(batch.size for batch in self._sent)
        self._sent.clear()
        self._most_batches = 0  # the next server may be an older one
        error = self._explained(error)
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

    def _explained(self, error: DynhullError) -> DynhullError:
        """RestoredError for a gap before batches that were acknowledged: the hull was led back without a notice."""
        if type(error) is not SequenceGapError or error.expected is None or error.metadata.get("uid") != self.uid:
            return error
        if not self.uid or error.expected > self.sequence:
            return error
        return led_back(replace(self._writing, uid=self.uid), error.expected - 1)

    def abandon(self) -> list[Future]:
        """Drop all batches; returns their outcomes, which stay unknown."""
        left = [each.outcome for each in self._sent]
        left += [each.outcome for each in self._waiting]
        if self._next is not None:
            left.append(self._next.outcome)
        self._next = None
        self._sent.clear()
        self._waiting.clear()
        self._waiting_bytes = 0
        return left

    def raise_refusal(self) -> None:
        """Raise the error that ended the writer, or the first refusal since the last call."""
        refusal, self._refusal = self.failure or self._refusal, None
        if refusal is not None:
            raise refusal

    @property
    def _room(self) -> bool:
        """Whether another batch can wait to be sent."""
        return len(self._sent) + len(self._waiting) < self._writing.in_flight

    @property
    def _sendable(self) -> bool:
        """Whether a message can be sent now.

        While others are under way, it waits until it is full or has as many batches as those: then messages grow as
        long as batches come faster than they are acknowledged.
        """
        sent = len(self._sent)
        if self._one_at_a_time and sent:
            return False
        waiting = len(self._waiting)
        if not waiting or not self._most_batches:
            return waiting > 0
        return waiting >= sent or waiting >= self._most_batches or self._waiting_bytes >= self._most_bytes

    def _full(self, following: Next[Future]) -> bool:
        return following.gathering.rows >= self._writing.batch_points

    def _joins(self, following: Next[Future], part: Part) -> bool:
        return not self._full(following) and following.gathering.admits(part)

    def _complete(self, following: Next[Future]) -> None:
        """Number the batch being gathered: it is to be sent. It stays as it is where there is no memory for it."""
        number = following.number or self._last + 1
        message = pb.NumberedBatch(batch=following.gathering.joined(), sequence=number)
        if self._writing.may_skip:
            message.after_sequence = self._before
        size = message.ByteSize() + FRAME_BYTES
        self._next = None
        self._last = self._before = number
        self._waiting.append(SentBatch(following.outcome, message, size))
        self._waiting_bytes += size

    def _send(self) -> pb.NumberedBatch:
        batch = self._waiting.popleft()
        self._waiting_bytes -= batch.size
        self._sent.append(batch)
        batch.sent += 1
        return batch.message

    def _refuse(self, error: DynhullError) -> tuple[Settled, float | None]:
        """Settle the first batch, which is at fault, as all before it are acknowledged; renumber the others."""
        if self._writing.stop_on_error:
            return self._end(error), None
        self._refusal = self._refusal or error
        if not self._waiting:  # nothing was sent: it is the call that was refused
            return self._end(error), None
        refused = self._waiting.popleft()
        self._waiting_bytes -= refused.size
        self.settled += 1
        self._lost_since = None
        for batch in self._waiting:
            batch.sent = 0
        if not self._writing.may_skip:
            for batch in self._waiting:
                batch.message.sequence -= 1
            self._last -= 1
        elif self._waiting:
            self._waiting[0].message.after_sequence = refused.message.after_sequence
        else:
            self._before = refused.message.after_sequence
        return [(refused.outcome, error)], 0.0

    def _end(self, error: DynhullError) -> Settled:
        self.failure = error
        return [(outcome, error) for outcome in self.abandon()]
