"""Reads about the keys of hulls, each at one revision."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Checked, Points
from dynhull.keys import take_keys

from ..state.batch import NO_POINTS
from ..state.contents.deadlines import Key
from ..state.contents.keyed import Found, Keyed
from ..state.contents.live import layer_of
from ..state.contents.quarantine import OFF, Quarantine
from ..state.errors import HullEmptyError, HullUnsuitableError
from ..state.hull_state import Counts, HullState, VertexKeys
from ..state.numbers import rows_of
from ..state.outline import Outline
from ..state.records import Contents, HeldRows, Keys
from ..state.sample import sample_rows
from .divided_hull import NO_LAYERS, DividedHull
from .live_hull import LiveHull
from .steps import BLOCK, Run, in_blocks

# Called with a hull and (n, 2) points; the answer has a row for each.
Question = Callable[[Outline, Checked], npt.NDArray[Any]]


@dataclass(frozen=True, slots=True)
class KeyAnswers:
    """The answers of one hull about the positions of keys.

    Attributes:
        counts: the counts of the hull that answered.
        rows: the answer for each key; meaningless for a missing key.
        missing: which keys are missing.
        keys_counts: the counts of the hull that has the keys, None if it is the hull that answered.
    """

    counts: Counts
    rows: npt.NDArray[Any]
    missing: npt.NDArray[np.bool_]
    keys_counts: Counts | None


def _keyed(state: HullState) -> Keyed:
    assert isinstance(state.contents, Keyed)  # `LiveHull.keys` has refused the others
    return state.contents


async def positions(hull: LiveHull, keys: Keys, min_revision: int) -> tuple[Counts, Found]:
    """The positions of keys of a keyed hull."""
    if isinstance(hull, DividedHull):
        await hull.reached(min_revision)
        counts, found, _ = await hull.division.find(keys)
        return counts, found
    return await hull.read(lambda state: _keyed(state).find(keys), len(keys), min_revision)


async def entities(hull: LiveHull, min_revision: int) -> tuple[Counts, Contents]:
    """All keys of a keyed hull in order, with their positions."""
    if isinstance(hull, DividedHull):
        await hull.reached(min_revision)
        return await hull.division.contents()
    return await hull.read(lambda state: _keyed(state).stored(), hull.counts.points, min_revision)


async def contents(hull: LiveHull, min_revision: int) -> tuple[Counts, Contents]:
    """All points of a hull; of a keyed one in the order of their keys."""
    if isinstance(hull, DividedHull):
        await hull.reached(min_revision)
        return await hull.division.contents()
    return await hull.read(lambda state: state.contents.stored(), hull.counts.points, min_revision)


async def held(hull: LiveHull, after: Key | None, most: int, min_revision: int) -> tuple[Counts, HeldRows, bool]:
    """At most that many positions in the quarantine of a keyed hull, after a key; and whether there are more."""

    def read(state: HullState) -> tuple[HeldRows, bool]:
        quarantine = state.quarantine or Quarantine(_keyed(state).hull.key_type, OFF)
        return quarantine.page(after, most)

    counts, (rows, more) = await hull.read(read, hull.counts.held, min_revision)
    return counts, rows, more


async def ask_of_keys(
    hull: LiveHull,
    min_revision: int,
    owner: LiveHull,
    owner_min_revision: int,
    keys: Keys,
    question: Question,
    layer: int = 1,
) -> KeyAnswers:
    """Ask a hull, or one of its convex layers, about the positions of keys that it has itself, or another one."""
    owner.require_frame_of(hull, "keys_of")
    if isinstance(owner, DividedHull):
        return await _ask_of_divided(hull, min_revision, owner, owner_min_revision, keys, question, layer)

    def ask(state: HullState, keyed: HullState) -> tuple[Found, npt.NDArray[Any] | None, Points]:
        found = _keyed(keyed).find(keys)
        if layer > 1:
            return found, None, layer_of(state.hull, layer)
        if len(keys) > BLOCK or hull.geographic:
            return found, None, state.vertices()
        return found, question(state.outline(), _known(found)), NO_POINTS

    counts, owner_counts, (found, answers, vertices) = await hull.read_beside(
        owner, ask, len(keys) if layer == 1 else max(len(keys), BLOCK), min_revision, owner_min_revision
    )
    if answers is None:
        xy = _known(found)
        answers = await hull.ask_vertices(counts, vertices, lambda live, block: question(live, xy[block]), len(xy))
    return KeyAnswers(counts, answers, ~found.present, None if owner is hull else owner_counts)


async def _ask_of_divided(
    hull: LiveHull,
    min_revision: int,
    owner: DividedHull,
    owner_min_revision: int,
    keys: Keys,
    question: Question,
    layer: int,
) -> KeyAnswers:
    """Ask a hull over shards about the positions of its own keys."""
    if owner is not hull:
        reason = "is divided among shards, so its keys are compared with itself only"
        raise HullUnsuitableError(owner.name, reason, field="keys_of")
    if layer > 1:
        raise HullUnsuitableError(owner.name, NO_LAYERS, field="layer")
    await owner.reached(max(min_revision, owner_min_revision))
    counts, found, vertices = await owner.division.find(keys)
    xy = _known(found)
    answers = await owner.ask_vertices(counts, vertices, lambda live, block: question(live, xy[block]), len(xy))
    return KeyAnswers(counts, answers, ~found.present, None)


def _known(found: Found) -> Checked:
    """The positions; the origin for a missing key, whose answer is ignored."""
    return Checked(np.where(found.present[:, np.newaxis], found.points, 0.0))


async def support(
    hull: LiveHull, directions: Checked, min_revision: int, run: Run, layer: int = 1
) -> tuple[Counts, Points, VertexKeys]:
    """The extreme vertices of a keyed hull and their keys, or raise HullEmptyError."""

    def extreme(state: HullState) -> tuple[Points, VertexKeys]:
        if not len(state.hull):
            raise HullEmptyError(hull.name)
        vertices = state.outline().support(directions)
        return vertices, state.keys_at(vertices)

    if len(directions) <= BLOCK and layer == 1:
        counts, (extremes, keys) = await hull.read(extreme, len(directions), min_revision)
        return counts, extremes, keys
    counts, vertices, vertex_keys = await hull.named_vertices(min_revision, layer)
    if not len(vertices):
        raise HullEmptyError(hull.name)
    outline = await hull.outline(counts, vertices)
    extremes = await in_blocks(run, lambda rows: outline.support(directions[rows]), len(directions))
    return counts, extremes, vertex_keys[await run(partial(rows_of, extremes, vertices))]


async def sample(hull: LiveHull, size: int, min_revision: int, run: Run) -> tuple[Counts, Points, Keys]:
    """A sample of at most `size` of the points of a keyed hull, with their keys. Writes continue meanwhile."""
    counts, contents = await entities(hull, min_revision)

    def chosen() -> tuple[Points, Keys]:
        assert contents.keys is not None  # those of a keyed hull
        x, y = contents.points.T
        order = np.lexsort((np.arange(len(x)), y, x))
        if len(order) > size:
            order = order[sample_rows(contents.points[order], size)]
        return contents.points[order], take_keys(contents.keys, order)

    points, keys = await run(chosen)
    return counts, points, keys
