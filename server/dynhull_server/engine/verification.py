"""Comparison of a live hull with Chan's algorithm."""

import asyncio
import json
import sys
import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from dynhull import KERNEL
from dynhull.arrays import Points
from dynhull.globe import Gnomonic
from dynhull.static import chan
from dynhull.static.trace import Round, Rounds

from ..state.contents.key_rows import keys_match
from ..state.fences.model.faults import FenceFault
from ..state.numbers import as_numbers
from ..state.records import Center, Contents
from . import chan_process
from .steps import Run

# A thread computes the hull of this many points in a third of a second, about the time to start a process.
LARGE = 20_000


@dataclass(frozen=True, slots=True)
class FirstDifference:
    """The first row where two lists of vertices differ; a shape of (0, 2) where a list is shorter."""

    index: int
    live: Points
    recomputed: Points


@dataclass(frozen=True, slots=True)
class Verification:
    """The result of Chan's algorithm; `difference` is None where the live hull has the same vertices.

    `seconds` is processor time. `keys_equal` is whether the positions of the keys are the points of the hull, each key
    once, and its quarantine is as it was held; True for a hull without keys. `fences` is the number of fences that
    compare the hull, and `fence_faults` what is wrong with them.
    """

    points: int
    vertices: int
    rounds: list[Round]
    difference: FirstDifference | None
    seconds: float
    keys_equal: bool = True
    fences: int = 0
    fence_faults: tuple[FenceFault, ...] = ()

    @property
    def equal(self) -> bool:
        """Whether there is no fault."""
        return self.difference is None and self.keys_equal and not self.fence_faults


async def verify(
    points: Points, vertices: Points, run: Run, entities: Contents | None = None, center: Center | None = None
) -> Verification:
    """Compare the vertices of a live hull with the hull of `points`, computed in a thread by `run`.

    With `entities`, the keys of a keyed hull, also compare their positions with `points`. With `center`, the points are
    places on the globe, and the hull is that of their projections.
    """
    places = points if center is None else await run(partial(Gnomonic(center).project_all, points))
    keys_equal = entities is None or await run(partial(keys_match, entities, points))
    if KERNEL == "cpp" or len(points) < LARGE:  # the kernel releases the interpreter
        recomputed, rounds, seconds = await run(partial(_recompute, places))
    else:
        recomputed, rounds, seconds = await _recompute_apart(places)
    if center is not None:
        recomputed = await run(partial(_given_at, points, places, recomputed))
    return Verification(len(points), len(vertices), rounds, first_difference(vertices, recomputed), seconds, keys_equal)


def _given_at(points: Points, places: Points, vertices: Points) -> Points:
    """The vertices as they were given: the least pair at each of these projections, from the least vertex."""
    order = np.lexsort((*points.T[::-1], *places.T[::-1]))
    given = points[order[np.searchsorted(as_numbers(places[order]), as_numbers(vertices))]]
    start = int(np.lexsort(given.T[::-1])[0]) if len(given) else 0
    return np.roll(given, -start, axis=0)


def first_difference(live: Points, recomputed: Points) -> FirstDifference | None:
    """The first row where two lists of vertices differ, None where they are equal."""
    if np.array_equal(live, recomputed):
        return None
    shorter = min(len(live), len(recomputed))
    rows = np.flatnonzero((live[:shorter] != recomputed[:shorter]).any(axis=1))
    i = int(rows[0]) if rows.size else shorter
    return FirstDifference(i, live[i : i + 1], recomputed[i : i + 1])


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
        raise RuntimeError(f"the verification process exited with code {process.returncode}")
    answer = json.loads(output)
    vertices = np.array(answer["vertices"], np.float64).reshape(-1, 2)
    return vertices, [Round(**each) for each in answer["rounds"]], answer["seconds"]
