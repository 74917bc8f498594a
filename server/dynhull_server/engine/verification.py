"""The live hull against Chan's algorithm."""

import asyncio
import json
import sys
import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from dynhull import KERNEL
from dynhull.arrays import Points
from dynhull.static import chan
from dynhull.static.trace import Round, Rounds

from . import chan_process
from .steps import Run

# So many points take a thread a third of a second, about as long as a process takes to start.
LARGE = 20_000


@dataclass(frozen=True, slots=True)
class Difference:
    """The first place where two lists of vertices differ; (0, 2) where a list has ended."""

    index: int
    live: Points
    recomputed: Points


@dataclass(frozen=True, slots=True)
class Verification:
    """What Chan's algorithm made of the points; no `difference` where the live hull has the same vertices.

    `seconds` are of processor time.
    """

    points: int
    vertices: int
    rounds: list[Round]
    difference: Difference | None
    seconds: float


async def verify(points: Points, vertices: Points, run: Run) -> Verification:
    """Compare `vertices`, a live hull's, with the hull of `points` computed anew, in a thread: `run` calls it there."""
    if KERNEL == "cpp" or len(points) < LARGE:  # the kernel leaves the interpreter to others
        recomputed, rounds, seconds = await run(partial(_recompute, points))
    else:
        recomputed, rounds, seconds = await _recompute_apart(points)
    return Verification(len(points), len(vertices), rounds, first_difference(vertices, recomputed), seconds)


def first_difference(live: Points, recomputed: Points) -> Difference | None:
    """The first row in which two lists of vertices differ, None where they are the same."""
    if np.array_equal(live, recomputed):
        return None
    shorter = min(len(live), len(recomputed))
    rows = np.flatnonzero((live[:shorter] != recomputed[:shorter]).any(axis=1))
    i = int(rows[0]) if rows.size else shorter
    return Difference(i, live[i : i + 1], recomputed[i : i + 1])


def _recompute(points: Points) -> tuple[Points, list[Round], float]:
    begun = time.thread_time()
    trace = Rounds()
    vertices = chan(points, trace=trace)
    return vertices, [event for event in trace if isinstance(event, Round)], time.thread_time() - begun


async def _recompute_apart(points: Points) -> tuple[Points, list[Round], float]:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", chan_process.__name__, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    try:
        output, _ = await process.communicate(points.tobytes())
    except BaseException:
        process.kill()
        await process.wait()
        raise
    if process.returncode:
        raise RuntimeError(f"the verifying process ended with {process.returncode}")
    answer = json.loads(output)
    vertices = np.array(answer["vertices"], np.float64).reshape(-1, 2)
    return vertices, [Round(**each) for each in answer["rounds"]], answer["seconds"]
