"""Batches of one call, read ahead of the engine and told in order."""

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator
from contextlib import nullcontext
from typing import Any

from ..engine.batch import Applied
from ..engine.live_hull import LiveHull
from ..engine.writer import Write
from . import decode
from .calls import Call
from .metrics import Metrics

# While so many points or batches are under way no more are read, and the client has to wait.
MOST_ROWS = 65_536
MOST_BATCHES = 1_024


def decode_write(request: Any, producer: str) -> Write:
    """The batch of a request, to be decoded when its turn comes."""
    batch = request.batch
    return Write(
        lambda: decode.decode_batch(batch),
        decode.batch_rows(batch),
        producer,
        decode.decode_sequence(producer, request.sequence),
    )


class BatchStream:
    """The batches of a call to one hull.

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
        self._news = asyncio.Event()
        self._writer = hull.writer(self._news.set)
        self._under_way: deque[tuple[int, float]] = deque()
        self._reading: asyncio.Future[Any] | None = None
        self._ended = False
        self._failure: Exception | None = None
        self._take(first)

    async def applied(self) -> AsyncGenerator[tuple[int, Applied], None]:
        """The sequence number of each batch, and what it did.

        What refuses a batch is raised after the ones before it, DrainingError after those that are under way.
        """
        writer = self._writer
        try:
            while True:
                while writer.applied:
                    applied = writer.applied.popleft()
                    sequence, came = self._under_way.popleft()
                    self._metrics.applied(applied, time.perf_counter() - came)
                    yield sequence, applied
                if writer.refusal is not None:
                    self._metrics.refused()
                    raise writer.refusal
                if self._ended and not writer.batches:
                    if self._failure is not None:
                        raise self._failure
                    return
                try:
                    await self._step()
                except Exception as failure:
                    self._failure, self._ended = failure, True
        finally:
            if self._reading is not None:
                self._reading.cancel()

    async def _step(self) -> None:
        """Wait for the next message or for a batch under way, whichever comes first."""
        writer = self._writer
        if not writer.batches and self._reading is None:  # a batch at a time: no need for a second task
            with self._call.cutoff():
                message = await self._call.read()
            self._take(message)
            return
        if self._reading is None and not self._ended and writer.rows < MOST_ROWS and writer.batches < MOST_BATCHES:
            self._reading = asyncio.ensure_future(self._call.read())
            self._reading.add_done_callback(lambda _: self._news.set())
        if self._reading is None or not self._reading.done():  # it may have come while the caller was busy
            self._news.clear()
            with nullcontext() if self._ended else self._call.cutoff():
                await self._news.wait()
        if self._reading is not None and self._reading.done():
            reading, self._reading = self._reading, None
            self._take(reading.result())

    def _take(self, message: Any) -> None:
        if message is None:
            self._ended = True
            return
        if message.name not in ("", self._hull.name):
            raise decode.InvalidFieldError("name", message.name, f"this call writes to {self._hull.name!r}")
        if message.producer not in ("", self._producer):
            raise decode.InvalidFieldError("producer", message.producer, f"this call's is {self._producer!r}")
        if not message.HasField("batch"):
            if message.sequence:
                raise decode.InvalidFieldError("sequence", message.sequence, "there is no batch to number")
            return
        write = decode_write(message, self._producer)
        self._under_way.append((write.sequence, time.perf_counter()))
        self._writer.write(write)
