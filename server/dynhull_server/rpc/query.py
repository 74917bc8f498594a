"""The reads of one Query call: answered in order, each as its own method answers it."""

from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any

from dynhull_proto.v1 import hull_service_pb2 as pb

from ..engine.hulls import Hulls
from ..state.errors import StoppingError
from .calls import Call
from .decode import InvalidFieldError
from .metrics import Metrics
from .runs import RUNS, Run, run_of
from .status import ANSWERED, error_status

Behave = Callable[[Any, Call], Awaitable[Any]]

# A response has about this many answers at most, and at most this many bytes unless a single answer has more. Between
# responses, other calls have their turn.
MOST_ANSWERS = 1_024
MOST_BYTES = 2**18
# The fields with revisions that a read waits for, and those that name their hulls.
REVISIONS = {"min_revision": "name", "other_min_revision": "other_name", "keys_min_revision": "keys_of"}

KINDS = {field.name: field.message_type for field in pb.Read.DESCRIPTOR.fields if field.message_type is not None}
METHODS = {kind: request.name.removesuffix("Request") for kind, request in KINDS.items()}
WAITS = {
    kind: [each for each in REVISIONS.items() if each[0] in request.fields_by_name] for kind, request in KINDS.items()
}
UNKNOWN_KIND = "must be a read of a kind that this server knows"
# The name of reads of unknown kinds in the counts.
UNKNOWN_READ = "unknown"


class Answers:
    """The answers to the reads of one call.

    Args:
        call: the call.
        methods: what answers each kind of read.
        hulls: the hulls.
        metrics: counts the reads.
        patience: the seconds that the client may take to receive a response.
    """

    def __init__(
        self, call: Call, methods: Mapping[str, Behave], hulls: Hulls, metrics: Metrics, patience: float
    ) -> None:
        self._call = call
        self._methods = methods
        self._hulls = hulls
        self._metrics = metrics
        self._patience = patience
        # Serialized responses: their concatenation is a response with the answers of all.
        self._parts: list[bytes] = []
        self._answers = self._bytes = 0
        self._counts: Counter[tuple[str, str]] = Counter()

    async def answer(self, reads: Sequence[pb.Read]) -> None:
        """Answer the reads of a message."""
        index = 0
        while index < len(reads):
            read = reads[index]
            kind = read.WhichOneof("read")
            run = run_of(kind, reads, index) if kind in RUNS else None
            if run is None or self._waits(run.request, run.kind):
                await self._answer_one(index, kind, read)
                index += 1
            else:
                await self._answer_run(run, reads, index)
                index += run.length
        await self._send()

    async def _answer_run(self, run: Run, reads: Sequence[pb.Read], first: int) -> None:
        """Answer the reads of a run by one question, unless that is refused: one of them may be at fault, or each."""
        try:
            response = await self._methods[run.kind](run.request, self._call)
        except StoppingError:
            raise
        except ANSWERED:
            for index in range(first, first + run.length):
                await self._answer_one(index, run.kind, reads[index])
        else:
            await self._add(run.kind, "OK", run.answers(response), run.length)

    async def _answer_one(self, index: int, kind: str | None, read: pb.Read) -> None:
        code, response = "OK", pb.QueryResponse()
        answer = response.answers.add()
        try:
            if kind is None:
                raise InvalidFieldError(f"reads[{index}]", "", UNKNOWN_KIND)
            request = getattr(read, kind)
            if self._waits(request, kind):
                await self._send()
            getattr(answer, kind).CopyFrom(await self._methods[kind](request, self._call))
            data = self._call.serialize(response)
        except StoppingError:  # no later read would be answered either
            raise
        except ANSWERED as error:
            status = error_status(error)
            answer.error.MergeFromString(status.SerializeToString())
            code = self._call.note_refusal(METHODS.get(kind or "", UNKNOWN_READ), status)
            data = self._call.serialize(response)
        await self._add(kind, code, data)

    def _waits(self, request: Any, kind: str) -> bool:
        """Whether a hull has not reached the revision that a read waits for."""
        for revision, name in WAITS[kind]:
            least = getattr(request, revision)
            if least:
                hull = getattr(request, name) or request.name
                if not self._hulls.has(hull) or self._hulls.get(hull).counts.revision < least:
                    return True
        return False

    async def _add(self, kind: str | None, code: str, data: bytes, answers: int = 1) -> None:
        if self._parts and (self._bytes + len(data) > MOST_BYTES or self._answers + answers > MOST_ANSWERS):
            await self._send()
        self._parts.append(data)
        self._bytes += len(data)
        self._answers += answers
        self._counts[METHODS.get(kind or "", UNKNOWN_READ), code] += answers

    async def _send(self) -> None:
        """Send the answers so far. The permissions that they needed are not needed any more."""
        if not self._parts:
            return
        self._call.require_entitled()
        self._metrics.queried(self._counts)
        self._counts.clear()
        self._call.access.forget()
        data = b"".join(self._parts)
        self._parts.clear()
        self._answers = self._bytes = 0
        await self._call.write_within(self._patience, data)
