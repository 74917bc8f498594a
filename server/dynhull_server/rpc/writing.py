"""Batches of one call, read ahead of the engine and told in order."""

import asyncio
import time
from collections import deque
from collections.abc import Iterator
from typing import Any, Self

from ..engine.engine import Engine
from ..state.batch import Applied
from ..state.events import WriteBatch
from . import decode
from .calls import Call
from .metrics import Metrics

# While so many points are under way, or so many batches not told of, no more are read, and the client has to wait.
MOST_ROWS = 65_536
MOST_BATCHES = 1_024


def decode_write(request: Any, message_bytes: int, producer: str, owner: str) -> WriteBatch:
    """The batch of a request, to be decoded when its turn comes; `owner` is who answers for the producer."""
    batch = request.batch
    return WriteBatch(
        message_bytes // decode.BYTES_PER_POINT,  # about: to look at the points is to copy them
        lambda: decode.decode_batch(batch),
        producer,
        decode.decode_sequence(producer, request.sequence),
        owner,
    )


class StreamedBatches:
    """The batches of a call to one hull: one task reads and applies them, its caller tells what they did.

    A context manager: it reads inside, and batches that have not begun when it ends are not applied.

    Args:
        call: the call.
        first: its first message, which names the hull and may name a producer.
        name: the hull's name.
        engine: where it is.
        create: whether a hull that is not there is created with its first batch.
        metrics: where batches are counted.

    Attributes:
        name: the hull's name.

    Raises:
        HullNotFoundError: there is no such hull, and none is to be created.
    """

    def __init__(self, call: Call, first: Any, name: str, engine: Engine, metrics: Metrics, *, create: bool) -> None:
        self._call = call
        self.name = name
        self._producer = decode.decode_producer(first.producer)
        self._metrics = metrics
        self._news: asyncio.Future[None] | None = None  # while the caller waits for some
        self._room = asyncio.Event()
        self._batches = engine.stream(name, self._notify, create=create)
        self._arrivals: deque[float] = deque()
        self._failure: Exception | None = None
        self._take(first)

    def __enter__(self) -> Self:
        self._reading = asyncio.create_task(self._read())
        self._reading.add_done_callback(lambda _: self._notify())
        return self

    def __exit__(self, *_: object) -> None:
        self._reading.cancel()
        self._batches.close()

    async def more(self) -> bool:
        """Wait until batches have been applied, to be taken with `applied`; False after the last.

        What refuses a batch is raised after the ones before it, DrainingError after those that are under way.
        """
        batches = self._batches
        while not batches.applied:
            if batches.refusal is not None:
                self._metrics.batches.refused()
                raise batches.refusal.with_traceback(None)
            if self._reading.done() and not batches.batches:
                if self._failure is not None:
                    raise self._failure
                return False
            self._news = asyncio.get_running_loop().create_future()
            await self._news
        return True

    def applied(self) -> Iterator[tuple[int, Applied]]:
        """The sequence number of each batch that has been applied, and what it did."""
        applied = self._batches.applied
        while applied:
            sequence, outcome = applied.popleft()
            self._room.set()
            self._metrics.batches.applied(outcome, time.perf_counter() - self._arrivals.popleft())
            yield sequence, outcome

    def _notify(self) -> None:
        if self._news is not None and not self._news.done():
            self._news.set_result(None)

    async def _read(self) -> None:
        """Take messages until the last, or until something is wrong with one."""
        try:
            with self._call.cutoff():
                while True:
                    while self._batches.rows >= MOST_ROWS or len(self._arrivals) >= MOST_BATCHES:
                        self._room.clear()
                        await self._room.wait()
                    message = await self._call.read()
                    if message is None:
                        return
                    self._take(message)
        except Exception as failure:  # told after the batches before it
            self._failure = failure

    def _take(self, message: Any) -> None:
        if message.name not in ("", self.name):
            raise decode.InvalidFieldError("name", message.name, f"this call writes to {self.name!r}")
        if message.producer not in ("", self._producer):
            raise decode.InvalidFieldError("producer", message.producer, f"this call's is {self._producer!r}")
        if not message.HasField("batch"):
            if message.sequence:
                raise decode.InvalidFieldError("sequence", message.sequence, "there is no batch to number")
            return
        request = decode_write(message, self._call.message_bytes, self._producer, self._call.owner)
        self._arrivals.append(time.perf_counter())
        self._batches.write(request)
