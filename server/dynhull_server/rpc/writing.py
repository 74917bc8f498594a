"""The batches of one call, read ahead of the engine and answered in order."""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, Self, TypeVar, TypeVarTuple

from dynhull_proto.v1 import batch_pb2, hull_service_pb2

from ..engine.driver import Driver
from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..state.batch import Applied, Batch, KeyedBatch, Write
from ..state.errors import HullNotFoundError, RestoredError, SequenceGapError
from . import decode
from .calls import Call
from .decode_batch import decode_batch
from .metrics import Metrics
from .short_batches import PointsMessage, PutsMessage

# While this many points are in flight, or this many batches not answered, no more are read, and the client waits.
MOST_ROWS = 131_072
MOST_BATCHES = 1_024
# The most batches of a message: a trip runs them on the event loop, each in some 10 µs.
MOST_IN_A_MESSAGE = 256
# Batches of at most this many points are decoded on the event loop, in some 25 µs; strings, one by one, in 1.5 ms.
SMALL = 16_384

T = TypeVar("T")
Given = TypeVarTuple("Given")


def decode_write(name: str, producer: str, owner: str, may_skip: bool, request: Any, arrived: int, rows: int) -> Write:
    """The batch of a request to a hull; `owner` is the caller that the producer belongs to."""
    sequence = decode.decode_sequence(producer, request.sequence)
    after = decode.decode_after(may_skip, request) if request.HasField("after_sequence") else None
    return Write(name, decoded(request.batch), arrived, rows, producer, sequence, owner, may_skip, after)


def decode_together(request: hull_service_pb2.ApplyTogetherRequest, arrived: int, owner: str) -> list[Write]:
    """The batches of a request to several hulls."""
    producer = decode.decode_producer(request.producer)
    sequence = decode.decode_sequence(producer, request.sequence)
    numbered = producer, sequence, owner, decode.decode_may_skip(producer, request.may_skip)
    return [Write(each.name, decoded(each.batch), arrived, 0, *numbered) for each in request.batches]


async def decoding(driver: Driver, rows: int, function: Callable[[*Given], T], *given: *Given) -> T:
    """The result of a function that decodes this many points."""
    if rows <= SMALL:
        return function(*given)
    result: T = await driver.in_turn(partial(function, *given))
    return result


def decoded(batch: batch_pb2.Batch) -> Batch | KeyedBatch | Exception:
    """A batch; or the error that refuses it in its turn: not where its number has already been applied."""
    try:
        return decode_batch(batch)
    except decode.InvalidFieldError as error:
        return error.with_traceback(None)


async def require_present(hull: LiveHull, producer: str, uid: str) -> None:
    """Raise RestoredError if the hull is no longer the one of this uid, because a backup was restored."""
    if uid not in ("", hull.uid) and hull.restored:
        with suppress(HullNotFoundError):  # deleted meanwhile: it is no longer any hull
            raise RestoredError(hull.name, hull.uid, producer, await hull.last_sequence(producer))


def gap_explained(error: Exception, hulls: Hulls, name: str, uid: str) -> Exception:
    """The error that refuses a batch; RestoredError for a gap where batches may be missing because of a backup.

    Who says of which hull the numbers are, has skipped some, as `require_present` has compared the uid; or the hull was
    led back, and nobody has noticed: the present uid lets a caller with acknowledged numbers decide.
    """
    if type(error) is not SequenceGapError or not hulls.has(name):
        return error
    hull = hulls.get(name)
    if uid:
        error.uid = hull.uid
    if uid or not hull.restored:
        return error
    return RestoredError(name, hull.uid, error.producer, error.expected - 1)


class StreamedBatches:
    """The batches of a call to one hull: a task reads and applies them, and the caller answers them.

    A context manager: it reads during the block, and batches that have not begun at its end are not applied.

    Args:
        call: the call.
        first: its first message, which names the hull and may name a producer.
        name: the name of the hull.
        hulls: the hulls.
        driver: has the clock and the threads.
        create: whether the first batch creates a missing hull.
        metrics: counts the batches.

    Attributes:
        name: the name of the hull.
        several: whether messages may have several batches, and responses have several results.

    Raises:
        HullNotFoundError: no hull has that name, and `create` is False.
    """

    def __init__(
        self, call: Call, first: Any, name: str, hulls: Hulls, driver: Driver, metrics: Metrics, *, create: bool
    ) -> None:
        self._call = call
        self.name = name
        self._own_names = b"", name.encode()
        self._producer = decode.decode_producer(first.producer)
        self._may_skip = decode.decode_may_skip(self._producer, first.may_skip)
        self._may_be_several = isinstance(first, hull_service_pb2.StreamRequest)
        self.several = self._may_be_several and first.accept_results
        self._hulls = hulls
        self._driver = driver
        self._uid: str = first.uid
        self._owner = call.owner
        self._decode_write = partial(decode_write, name, self._producer, self._owner, self._may_skip)
        self._short: dict[type, Callable[[Any], bool]] = {
            PointsMessage: self._take_points,
            PutsMessage: self._take_puts,
        }
        self._metrics = metrics
        self._news: asyncio.Future[None] | None = None  # set while the caller waits
        self._loop = asyncio.get_running_loop()
        self._room: asyncio.Future[None] | None = None  # set while the reader waits
        self._batches = hulls.stream(name, self._notify, create=create)
        self._arrivals: deque[float] = deque()
        self._failure: Exception | None = None

    def __enter__(self) -> Self:
        self._reading = asyncio.create_task(self._read())
        self._reading.add_done_callback(lambda _: self._notify())
        return self

    def __exit__(self, *_: object) -> None:
        self._reading.cancel()
        self._batches.close()

    async def more(self) -> bool:
        """Wait until `applied` has batches; False after the last.

        The error that refuses a batch is raised after the batches before it, DrainingError after those in flight.
        """
        batches = self._batches
        while not batches.applied:
            if batches.refusal is not None:
                self._metrics.batches.refused()
                raise gap_explained(batches.refusal, self._hulls, self.name, self._uid).with_traceback(None)
            if self._reading.done() and not batches.batches:
                if self._failure is not None:
                    raise self._failure
                return False
            self._news = self._loop.create_future()
            await self._news
        return True

    def applied(self) -> Iterator[tuple[int, Applied]]:
        """The sequence number and the result of each batch applied since the last call."""
        applied = self._batches.applied
        while applied:
            sequence, outcome = applied.popleft()
            room, self._room = self._room, None
            if room is not None and not room.done():
                room.set_result(None)
            self._metrics.batches.applied(outcome, time.perf_counter() - self._arrivals.popleft())
            yield sequence, outcome

    async def take(self, message: Any) -> None:
        """Send the batches of a message; those before an invalid one, too."""
        name, producer = message.name, message.producer
        if name and name != self.name:
            raise decode.InvalidFieldError("name", name, f"this call writes to {self.name!r}")
        if producer and producer != self._producer:
            raise decode.InvalidFieldError("producer", producer, f"the producer of this call is {self._producer!r}")
        if message.may_skip and not self._may_skip:
            raise decode.InvalidFieldError("may_skip", value=True, problem="the first message of the call decides it")
        rows, arrived = self._call.message_bytes // decode.BYTES_PER_POINT, self._driver.time()
        several = message.batches if self._may_be_several else ()
        if several:
            self._require_batches_alone(message, len(several))
            writes: list[Write] = []
            try:
                await decoding(self._driver, rows, self._decode_several, several, arrived, rows, writes)
            except decode.InvalidFieldError:
                self._send(writes)
                raise
            self._send(writes)
        elif message.HasField("batch"):
            self._send([await decoding(self._driver, rows, self._decode_write, message, arrived, rows)])
        else:
            _require_no_number(message)

    def _notify(self) -> None:
        if self._news is not None and not self._news.done():
            self._news.set_result(None)

    async def _read(self) -> None:
        """Take messages until the last, or until an invalid one."""
        try:
            with self._call.cutoff():
                while True:
                    while self._batches.rows >= MOST_ROWS or len(self._arrivals) >= MOST_BATCHES:
                        self._room = self._loop.create_future()
                        await self._room
                    message = await self._call.read()
                    if message is None:
                        return
                    take = self._short.get(type(message))
                    if take is not None:
                        if take(message):
                            continue
                        message = message.whole()
                    await self.take(message)
        except Exception as failure:  # raised after the batches before it are answered
            self._failure = failure

    def _take_points(self, message: PointsMessage) -> bool:
        """Send the batch of a message with points and nothing else; False if it has to be taken as a whole."""
        if self._producer or message.name not in self._own_names:
            return False
        self._arrivals.append(time.perf_counter())
        if not self._batches.apply_points(message):
            rows = self._call.message_bytes // decode.BYTES_PER_POINT
            self._batches.write_one(Write(self.name, message, self._driver.time(), rows, "", 0, self._owner))
        return True

    def _take_puts(self, message: PutsMessage) -> bool:
        """The same of a message with batches that put keys."""
        batches, producer = message.batches, self._producer
        if message.name not in self._own_names or (message.several and not self.several):
            return False
        numbered = [number > 0 for number, _ in batches]
        if len(batches) > MOST_IN_A_MESSAGE or numbered.count(producer != "") < len(batches):
            return False
        arrived, rows = self._driver.time(), self._call.message_bytes // decode.BYTES_PER_POINT // len(batches)
        name, owner, may_skip = self.name, self._owner, self._may_skip
        self._send([Write(name, batch, arrived, rows, producer, number, owner, may_skip) for number, batch in batches])
        return True

    def _require_batches_alone(self, message: Any, batches: int) -> None:
        """Refuse several batches where the call has not asked for them, too many, or one beside them."""
        if not self.several:
            problem = "only in a call whose first message has accept_results"
        elif batches > MOST_IN_A_MESSAGE:
            problem = f"a message has at most {MOST_IN_A_MESSAGE}"
        elif message.HasField("batch") or message.sequence or message.HasField("after_sequence"):
            problem = "use batch or batches, not both"
        else:
            return
        raise decode.InvalidFieldError("batches", f"{batches} batches", problem)

    def _decode_several(self, batches: Sequence[Any], arrived: int, rows: int, writes: list[Write]) -> None:
        """Decode batches of about `rows` points together."""
        for each in batches:
            writes.append(self._decode_write(each, arrived, rows // len(batches)))  # noqa: PERF401  # those before an invalid one are sent

    def _send(self, writes: list[Write]) -> None:
        self._arrivals.extend([time.perf_counter()] * len(writes))
        self._batches.write(writes)


def _require_no_number(message: Any) -> None:
    """Refuse a number in a message without a batch."""
    if message.sequence:
        raise decode.InvalidFieldError("sequence", message.sequence, "a sequence number needs a batch")
    if message.HasField("after_sequence"):
        raise decode.InvalidFieldError("after_sequence", message.after_sequence, "it needs a batch")
