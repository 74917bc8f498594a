"""The reads of a pipeline: waiting, sent, answered.

No I/O: `Pipeline` and `AsyncPipeline` add it.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import repeat
from typing import Any, Generic, TypeVar

import grpc

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Call, Piping
from ._errors import DynhullError, error_of_read
from ._retry import passes, pauses

# A message with several reads has at most this many bytes.
MOST_BYTES = 2**20

# The name of the field of each method in a message.
KINDS = {
    field.message_type.name.removesuffix("Request"): field.name
    for field in pb.Read.DESCRIPTOR.fields
    if field.message_type is not None
}

Future = TypeVar("Future")
Answered = list[tuple[Any, Any]]


@dataclass(slots=True, eq=False)
class Question(Generic[Future]):
    """A read.

    Attributes:
        kind: the name of its field in a message.
        call: its request, and how to read the answer.
        outcome: the future of its answer.
    """

    kind: str
    call: Call[Any]
    outcome: Future


class Questions(Generic[Future]):
    """The reads of a pipeline that are not answered, in order.

    Attributes:
        added: the number of reads added.
        settled: the number of reads whose futures have a result; its owner counts them.
        refusal: the error of a read whose hull is away for the moment: its owner ends the connection with it. So the
            read and those after it are sent again, and answers stay in order.
    """

    def __init__(self, piping: Piping, retries: int, new_outcome: Callable[[], Future]) -> None:
        self.added = self.settled = 0
        self.refusal: DynhullError | None = None
        self._piping = piping
        self._retries = retries
        self._new_outcome = new_outcome
        self._waiting: deque[Question[Future]] = deque()
        self._under_way: deque[Question[Future]] = deque()
        self._alone = 0  # the number of reads to send one a message, because one of them was refused with its message
        self._lost = 0
        self._away = ""  # the hull that has the connections end, if it is one
        self._pauses = pauses()

    @property
    def empty(self) -> bool:
        """Whether everything is answered."""
        return not self._waiting and not self._under_way

    @property
    def full(self) -> bool:
        """Whether as many reads wait as may be under way."""
        return len(self._waiting) >= self._piping.in_flight

    def add(self, call: Call[Any]) -> Future:
        """Add a read; returns the future of its answer."""
        if call.timeout is not None:
            raise TypeError("a read of a pipeline has no timeout of its own: wait for its future with one")
        outcome = self._new_outcome()
        self._waiting.append(Question(KINDS[call.method], call, outcome))
        self.added += 1
        return outcome

    def take(self) -> pb.QueryRequest | None:
        """The next message to send; None if there is none now."""
        room = self._piping.in_flight - len(self._under_way)
        if not self._waiting or room <= 0 or (self._alone and self._under_way):
            return None
        message = pb.QueryRequest()
        size = 0
        for _ in repeat(None, 1 if self._alone else min(room, self._piping.batch_reads)):
            if not self._waiting:
                break
            question = self._waiting[0]
            size += question.call.request.ByteSize()
            if size > MOST_BYTES and message.reads:
                break
            getattr(message.reads.add(), question.kind).CopyFrom(question.call.request)
            self._under_way.append(self._waiting.popleft())
        return message

    def answer(self, response: pb.QueryResponse) -> Answered:
        """The futures of the next reads under way, with their answers or errors."""
        answered: Answered = []
        for answer in response.answers:
            if not self._under_way:  # given up while the response was on its way
                break
            question = self._under_way[0]
            name, found = getattr(question.call.request, "name", ""), _decoded(question, answer)
            if isinstance(found, DynhullError) and passes(found):
                if self._lost < self._retries:
                    self.refusal, self._away = found, name
                    break
            elif self._away in ("", name):
                self._begin_anew()
            self._under_way.popleft()
            answered.append((question.outcome, found))
        self._alone = max(self._alone - len(answered), 0)
        return answered

    def lost(self, error: DynhullError) -> tuple[Answered, float]:
        """Handle the end of a connection: which reads it settles, and the seconds until the next connection."""
        if self.refusal is None and self._away:
            self._begin_anew()
        self.refusal = None
        if (passes(error) or _unexplained(error)) and self._lost < self._retries:
            self._lost += 1
            if _unexplained(error):  # sending one read a message finds out which is at fault
                self._alone = len(self._under_way)
            self._send_again()
            return [], next(self._pauses)
        if self._under_way and (_too_large(error) or (_unexplained(error) and self._alone)):
            return self._refuse(error), 0.0
        self._begin_anew()
        return self.give_up(error), 0.0

    def give_up(self, error: DynhullError) -> Answered:
        """Settle all reads with an error."""
        left = [(question.outcome, error) for question in (*self._under_way, *self._waiting)]
        self._under_way.clear()
        self._waiting.clear()
        self._alone = 0
        return left

    def _begin_anew(self) -> None:
        """Count from 0 how often connections have ended in a row."""
        if self._lost:
            self._lost, self._away, self._pauses = 0, "", pauses()

    def _refuse(self, error: DynhullError) -> Answered:
        """The first message under way is too large: the only read of it is at fault, or each must be tried."""
        if self._alone:
            refused = self._under_way.popleft()
            self._alone -= 1
            self._send_again()
            return [(refused.outcome, error)]
        self._alone = len(self._under_way)
        self._send_again()
        return []

    def _send_again(self) -> None:
        self._waiting.extendleft(reversed(self._under_way))
        self._under_way.clear()


def _too_large(error: DynhullError) -> bool:
    """Whether a message was too large: for the server, or for something between."""
    limit = error.metadata.get("limit", "max_message_bytes")
    return error.code == grpc.StatusCode.RESOURCE_EXHAUSTED and limit == "max_message_bytes"


def _unexplained(error: DynhullError) -> bool:
    """Whether the cause is lost: gRPC's asyncio reports so when the server ends a call during a write."""
    return not error.reason and error.code in (grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN)


def _decoded(question: Question[Any], answer: pb.ReadAnswer) -> Any:
    if answer.HasField("error"):
        return error_of_read(answer.error)
    try:
        return question.call.decode(getattr(answer, question.kind))
    except Exception as error:  # a later version's answer; the reads after it are not affected
        return error
