"""The measurements of `dynhull bench`: moves of points and questions about points, on a hull made for them."""

from functools import partial
from time import perf_counter

import numpy as np

from dynhull_client import HullClient

FILL_BATCH = 8192  # points in each batch before the measurement

Milliseconds = list[float]


def write_speed(
    client: HullClient, name: str, seconds: float, points: int, batch: int, in_flight: int
) -> dict[str, float]:
    """Insert points into an empty hull, then move them in batches for `seconds`.

    Returns updates per second, and the median and the 99th percentile of the acknowledgement delay in milliseconds.
    """
    rng = np.random.default_rng(0)
    there = rng.normal(size=(points, 2))
    delays: Milliseconds = []

    def delayed(sent: float, _: object) -> None:
        delays.append(1e3 * (perf_counter() - sent))

    with client.writer(name, batch_points=1, in_flight=in_flight) as writer:
        for part in np.array_split(there, -(-points // FILL_BATCH)):
            writer.put(insert=part)
        writer.flush()
        begun, moved, first = perf_counter(), 0, 0
        while perf_counter() - begun < seconds:
            rows = np.arange(first, first + batch) % points
            fresh = rng.normal(size=(batch, 2))
            writer.put(move=(there[rows], fresh)).add_done_callback(partial(delayed, perf_counter()))
            there[rows] = fresh
            first, moved = (first + batch) % points, moved + batch
        writer.flush()
        passed = perf_counter() - begun
    return {"updates_per_second": 2 * moved / passed, **_summary("acknowledgement", delays)}


def read_speed(client: HullClient, name: str, seconds: float) -> dict[str, float]:
    """Locate one point after the other for `seconds`; returns the median and the 99th percentile in milliseconds."""
    rng = np.random.default_rng(1)
    delays: Milliseconds = []
    begun = perf_counter()
    while perf_counter() - begun < seconds:
        sent = perf_counter()
        client.locate(name, rng.normal(size=(1, 2)) * 4)
        delays.append(1e3 * (perf_counter() - sent))
    return _summary("locate", delays)


def _summary(what: str, delays: Milliseconds) -> dict[str, float]:
    median, tail = np.quantile(delays, [0.5, 0.99]).tolist()
    return {f"{what}_ms_median": median, f"{what}_ms_p99": tail}
