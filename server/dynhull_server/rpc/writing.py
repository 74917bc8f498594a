"""Batches of one call, read ahead of the engine and told in order."""

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator
from typing import Any

from ..engine.live_hull import LiveHull
from ..engine.writer import Write
from ..state.batch import Applied
from . import decode
from .calls import Call
from .metrics import Metrics

# While so many points are under way, or so many batches not told of, no more are read, and the client has to wait.
MOST_ROWS = 65_536
MOST_BATCHES = 1_024


def decode_write(request: Any, message_bytes: int, producer: str) -> Write:
    """The batch of a request, to be decoded when its turn comes."""
    batch = request.batch
    return Write(
        lambda: decode.decode_batch(batch),
        message_bytes // decode.BYTES_PER_POINT,  # about: to look at the points is to copy them
        producer,
        decode.decode_sequence(producer, request.sequence),
    )


class BatchStream:
    """The batches of a call to one hull: one task reads and applies them, its caller tells what they did.

    Args:
        call: the call.
        first: its first message, which names the hull and may name a producer.
        hull: the hull.
        metrics: where batches are counted.
    """

    def __init__(self, call: Call, first: Any, hull: LiveHull, metrics: Metrics) -> None:
        self._call = call
        self._hull = hull
        self._producer = decode.decode_producer(first.producer)
        self._metrics = metrics
        self._news: asyncio.Future[None] | None = None  # while the caller waits for some
        self._room = asyncio.Event()
        self._writer = hull.writer(self._notify)
        self._untold: deque[tuple[int, float]] = deque()
        self._failure: Exception | None = None
        self._take(first)

    async def applied(self) -> AsyncGenerator[tuple[int, Applied], None]:
        """The sequence number of each batch, and what it did.

        What refuses a batch is raised after the ones before it, DrainingError after those that are under way.
        """
        writer = self._writer
        reading = asyncio.create_task(self._read())
        reading.add_done_callback(lambda _: self._notify())
        try:
            while True:
                while writer.applied:
                    applied = writer.applied.popleft()
                    sequence, came = self._untold.popleft()
                    self._room.set()
                    self._metrics.batches.applied(applied, time.perf_counter() - came)
                    yield sequence, applied
                if writer.refusal is not None:
                    self._metrics.batches.refused()
                    raise writer.refusal
                if reading.done() and not writer.batches:
                    if self._failure is not None:
                        raise self._failure
                    return
                self._news = asyncio.get_running_loop().create_future()
                await self._news
        finally:
            reading.cancel()

    def _notify(self) -> None:
        if self._news is not None and not self._news.done():
            self._news.set_result(None)

    async def _read(self) -> None:
        """Take messages until the last, or until something is wrong with one."""
        try:
            with self._call.cutoff():
                while True:
                    while self._writer.rows >= MOST_ROWS or len(self._untold) >= MOST_BATCHES:
                        self._room.clear()
                        await self._room.wait()
                    message = await self._call.read()
                    if message is None:
                        return
                    self._take(message)
        except Exception as failure:  # told after the batches before it
            self._failure = failure

    def _take(self, message: Any) -> None:
        if message.name not in ("", self._hull.name):
            raise decode.InvalidFieldError("name", message.name, f"this call writes to {self._hull.name!r}")
        if message.producer not in ("", self._producer):
            raise decode.InvalidFieldError("producer", message.producer, f"this call's is {self._producer!r}")
        if not message.HasField("batch"):
            if message.sequence:
                raise decode.InvalidFieldError("sequence", message.sequence, "there is no batch to number")
            return
        write = decode_write(message, self._call.message_bytes, self._producer)
        self._untold.append((write.sequence, time.perf_counter()))
        self._writer.write(write)
