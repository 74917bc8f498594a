"""Plays a replay again, from the past that the server has kept of it."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import attrgetter

import numpy as np

from dynhull_client import HullClient, HullCopy

from .replay import ReplayStep
from .scene import Scene


def play_again(client: HullClient, scene: Scene, steps: Sequence[ReplayStep]) -> Iterator[str | None]:
    """Compare the past with what was live, step by step: what differs first, None for each step that agrees."""
    if not steps:
        return
    copy = HullCopy()
    name, first, last = scene.hull_name, steps[0].revision, steps[-1].revision
    events = client.replay(name, first, last, keys=scene.keyed, copy=copy)
    for revision, same in groupby(steps, attrgetter("revision")):
        while copy.revision < revision and next(events, None) is not None:
            continue
        for step in same:
            yield _different(copy, step)


def _different(copy: HullCopy, step: ReplayStep) -> str | None:
    if copy.revision != step.revision:
        return f"the past has no revision {step.revision}"
    if not np.array_equal(copy.vertices, step.vertices):
        return f"the past has {copy.vertices.tolist()}, and {step.vertices.tolist()} was live"
    if copy.vertex_keys != step.keys:
        return f"the past has the keys {copy.vertex_keys}, and {step.keys} were live"
    return None
