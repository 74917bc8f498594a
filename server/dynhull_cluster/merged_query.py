"""A `Query` call whose reads are of several workers: each answers its own, the gateway puts the answers in order."""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING

import grpc

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc.access import PermissionDeniedError
from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.decode import InvalidFieldError
from dynhull_server.rpc.methods import DESCRIPTOR
from dynhull_server.rpc.query import MOST_ANSWERS, MOST_BYTES, REVISIONS, UNKNOWN_KIND
from dynhull_server.rpc.status import ANSWERED, HullsApartError, RelayedError, WorkerAwayError, error_status

from .callers import metadata_of
from .relay import Relay
from .worker_link import Patience, WorkerLink

if TYPE_CHECKING:
    from .upstream import Upstream

QUERY = f"/{DESCRIPTOR.full_name}/Query"

# The reads of a message that are divided among the workers at once: meanwhile other calls wait, for some 50 ms.
AT_ONCE = 8_192
# Where the answer to a read comes from: a worker, or this process.
Source = WorkerLink | Exception | pb.SeparateRequest
Separate = Callable[[Call, bytes], Awaitable[bytes]]


class MergedQuery:
    """The answers to the reads of one call.

    Args:
        call: the call.
        relay: the workers.
        separate: answers a request for the separation of two hulls, of any workers.
    """

    def __init__(self, call: Call, relay: Relay, separate: Separate) -> None:
        self._call = call
        self._relay = relay
        self._separate = separate
        self._upstreams: dict[WorkerLink, _WorkerAnswers] = {}
        self._response = pb.QueryResponse()
        self._bytes = 0

    async def answer(self, reads: Sequence[pb.Read]) -> None:
        """Answer the reads of a message. Those of a worker that is away are answered with its error."""
        for begin in range(0, len(reads), AT_ONCE):
            await self._answer(reads[begin : begin + AT_ONCE])

    async def _answer(self, reads: Sequence[pb.Read]) -> None:
        parts: dict[WorkerLink, pb.QueryRequest] = {}
        sources = [self._source(index, read) for index, read in enumerate(reads)]
        for read, source in zip(reads, sources, strict=True):
            if isinstance(source, WorkerLink):
                parts.setdefault(source, pb.QueryRequest()).reads.append(read)
        # Workers answer while others get their reads.
        sending = [asyncio.create_task(self._begun(link).send(part)) for link, part in parts.items()]
        try:
            for read, source in zip(reads, sources, strict=True):
                if _waits(read):
                    await self._send()
                await self._add(await self._answer_from(source))
            await self._send()
            # An answer may be here before its request is known to be sent; to cancel that would end the worker's call.
            await asyncio.gather(*sending)
        finally:
            for task in sending:
                task.cancel()

    def close(self) -> None:
        """End the calls of the workers."""
        for each in self._upstreams.values():
            each.close()

    async def _answer_from(self, source: Source) -> pb.ReadAnswer:
        if isinstance(source, WorkerLink):
            return await self._upstreams[source].next()
        answer = pb.ReadAnswer()
        try:
            if isinstance(source, Exception):
                raise source
            answer.separate.MergeFromString(await self._separate(self._call, source.SerializeToString()))
        except ANSWERED as error:
            answer.error.MergeFromString(error_status(error).SerializeToString())
        return answer

    async def _add(self, answer: pb.ReadAnswer) -> None:
        size = answer.ByteSize()
        if len(self._response.answers) >= MOST_ANSWERS or self._bytes + size > MOST_BYTES:
            await self._send()
        self._response.answers.append(answer)
        self._bytes += size

    async def _send(self) -> None:
        if self._response.answers:
            await self._relay.send(self._call, self._response.SerializeToString())
            self._response = pb.QueryResponse()
            self._bytes = 0

    def _source(self, index: int, read: pb.Read) -> Source:
        """Where the answer to a read comes from."""
        kind = read.WhichOneof("read")
        if kind is None:
            return InvalidFieldError(f"reads[{index}]", "", UNKNOWN_KIND)
        request = getattr(read, kind)
        link = self._relay.link(request.name)
        for field in ("other_name", "keys_of"):
            other = getattr(request, field, "")
            if other and self._relay.link(other) is not link:
                return request if kind == "separate" else self._apart(field, other, request.name)
        return link

    def _apart(self, field: str, name: str, first: str) -> Exception:
        """Why two names cannot be in a read, for who may read them."""
        try:
            self._call.access.require_read(first)
            self._call.access.require_read(name)
        except PermissionDeniedError as error:
            return error
        return HullsApartError(field, name, first)

    def _begun(self, link: WorkerLink) -> "_WorkerAnswers":
        upstream = self._upstreams.get(link)
        if upstream is None or upstream.over:
            upstream = self._upstreams[link] = _WorkerAnswers(link, self._call)
        return upstream


def _waits(read: pb.Read) -> bool:
    """Whether a read may wait for a revision: the answers before it are sent at once."""
    kind = read.WhichOneof("read")
    request = None if kind is None else getattr(read, kind)
    return any(getattr(request, field, 0) for field in REVISIONS)


class _WorkerAnswers:
    """The answers of one worker, or of those that replace it: reads that it leaves unanswered are asked again."""

    def __init__(self, link: WorkerLink, call: Call) -> None:
        self._link = link
        self._call = call
        self._writing = asyncio.Lock()
        self._unanswered: deque[pb.Read] = deque()
        self._answers: deque[pb.ReadAnswer] = deque()
        self._stream: Upstream | None = None
        self._failure: RelayedError | WorkerAwayError | None = None
        self._patience: Patience | None = None  # from the first failure since an answer
        self._connect()

    def _connect(self) -> None:
        try:
            self._stream, self._failure = self._link.stream(QUERY, metadata_of(self._call)), None
        except WorkerAwayError as error:
            self._stream, self._failure = None, error

    @property
    def over(self) -> bool:
        """Whether it has ended: the next message needs another one."""
        return self._failure is not None or (self._stream is not None and self._stream.over)

    async def send(self, part: pb.QueryRequest) -> None:
        """Send reads. An error is that of their answers."""
        async with self._writing:
            self._unanswered.extend(part.reads)
            if self._stream is not None:
                await self._stream.write(part.SerializeToString())

    async def next(self) -> pb.ReadAnswer:
        """The next answer. Raises RelayedError if the call ends for another reason than that the worker does."""
        while not self._answers:
            if self._failure is None:
                await self._read()
                continue
            self._patience = self._patience or Patience()
            try:
                await self._link.again(QUERY, b"", self._failure, self._patience)
                await self._link.arrive(self._patience)
            except (RelayedError, WorkerAwayError) as error:
                answer = pb.ReadAnswer()
                answer.error.MergeFromString(error_status(error).SerializeToString())
                return answer
            async with self._writing:
                self._connect()
                if self._stream is not None and self._unanswered:
                    await self._stream.write(pb.QueryRequest(reads=self._unanswered).SerializeToString())
        self._unanswered.popleft()
        return self._answers.popleft()

    async def _read(self) -> None:
        assert self._stream is not None  # otherwise there is a failure
        try:
            response = await self._stream.read()
        except RelayedError as error:
            if error.status.code != grpc.StatusCode.UNAVAILABLE.value[0]:
                raise
            self._failure = error
        else:
            assert response is not None  # it reads for as long as it is sent reads
            self._answers.extend(pb.QueryResponse.FromString(response).answers)
            self._patience = None

    def close(self) -> None:
        """End the call."""
        if self._stream is not None:
            self._stream.cancel()
