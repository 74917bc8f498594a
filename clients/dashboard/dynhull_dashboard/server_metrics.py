"""Rates and delays of the whole server, from its metrics page for Prometheus."""

import asyncio
import logging
import math
import time
from dataclasses import dataclass
from typing import Self

from prometheus_client.parser import text_string_to_metric_families
from tornado.httpclient import AsyncHTTPClient, HTTPClientError

from .time_line import TimeLine

POLL_SECONDS = 1.0
TIMEOUT_SECONDS = 2.0
PERCENTILE = 0.99
COUNTED = ("insert", "delete", "move")

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Scrape:
    """The server's counters at one moment.

    Attributes:
        at: the moment, by `time.monotonic`.
        updates: the number of points inserted, deleted and moved.
        batches: the number of batches acknowledged.
        seconds: the sum of their acknowledgement delays.
        buckets: the number of batches with at most that delay, by the upper bound of the bucket in seconds.
    """

    at: float
    updates: float
    batches: float
    seconds: float
    buckets: dict[float, float]

    @classmethod
    def read(cls, text: str, at: float) -> Self:
        """Parse the page as the server writes it."""
        updates = batches = seconds = 0.0
        buckets: dict[float, float] = {}
        for family in text_string_to_metric_families(text):
            for sample in family.samples:
                match sample.name:
                    case "dynhull_updates_total" if sample.labels["operation"] in COUNTED:
                        updates += sample.value
                    case "dynhull_batch_duration_seconds_count":
                        batches = sample.value
                    case "dynhull_batch_duration_seconds_sum":
                        seconds = sample.value
                    case "dynhull_batch_duration_seconds_bucket":
                        buckets[float(sample.labels["le"])] = sample.value
                    case _:
                        continue
        return cls(at, updates, batches, seconds, buckets)

    def rates_since(self, before: Self) -> tuple[float, float, float]:
        """Updates per second, and the mean and the 99th percentile of the acknowledgement delay in milliseconds.

        The delays are NaN where there were no batches; all three are NaN where the server has restarted.
        """
        batches = self.batches - before.batches
        if batches < 0:
            return math.nan, math.nan, math.nan
        updates = (self.updates - before.updates) / (self.at - before.at)
        if batches == 0:
            return updates, math.nan, math.nan
        new = {bound: count - before.buckets.get(bound, 0.0) for bound, count in self.buckets.items()}
        mean = (self.seconds - before.seconds) / batches
        return updates, 1000 * mean, 1000 * _quantile(new, PERCENTILE)


def _quantile(buckets: dict[float, float], share: float) -> float:
    """As Prometheus's `histogram_quantile`: linear within a bucket, the largest finite bound in the last one."""
    wanted = share * buckets[math.inf]
    low = below = 0.0
    for bound, count in sorted(buckets.items()):
        if count >= wanted:
            return low if math.isinf(bound) else low + (bound - low) * (wanted - below) / (count - below)
        low, below = bound, count
    return math.nan


class ServerMetrics:
    """Polls the metrics page once per second.

    Attributes:
        time_line: updates per second, and the mean and the 99th percentile of the milliseconds from the arrival of a
            batch to its acknowledgement.
        url: the page.
        error: why the last request for the page failed; None where it did not.
    """

    def __init__(self, url: str) -> None:
        self.time_line = TimeLine("time", "updates", "mean", "percentile")
        self.url = url
        self.error: str | None = None
        self._http = AsyncHTTPClient()
        self._task = asyncio.create_task(self._run())

    async def close(self) -> None:
        """Stop polling."""
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _run(self) -> None:
        before: Scrape | None = None
        while True:
            now = await self._scrape()
            rates = now.rates_since(before) if now and before else (math.nan, math.nan, math.nan)
            self.time_line.append(time.time() * 1000, *rates)
            before = now
            await asyncio.sleep(POLL_SECONDS)

    async def _scrape(self) -> Scrape | None:
        try:
            response = await self._http.fetch(self.url, request_timeout=TIMEOUT_SECONDS)
        except (HTTPClientError, OSError) as error:  # the time lines show a gap
            self.error = str(error)
            log.info("%s: %s", self.url, error)
            return None
        self.error = None
        return Scrape.read(response.body.decode(), time.monotonic())
