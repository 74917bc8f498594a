"""Counted work: orientations evaluated by one insert or one delete, on inputs that are hard in different ways.

A sign that floating point cannot decide is counted once, like any other; so is the `crossing` of two edges' lines.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from dynhull import _nodes as nodes
from dynhull import _tree as tree
from dynhull._tree import HullTree

Point = tuple[float, float]
Update = tuple[Point, Point]  # delete, insert


@dataclass
class Workload:
    """Points to begin with, and for a tree that holds them an endless stream of updates."""

    start: np.ndarray
    updates: Callable[[HullTree], Iterator[Update]]


@dataclass
class Steps:
    inserts: list[int] = field(default_factory=list)
    deletes: list[int] = field(default_factory=list)

    @property
    def worst(self) -> int:
        return max(self.inserts + self.deletes)


def window(points: Callable[[int, int], np.ndarray], n: int) -> Workload:
    """Delete the oldest point, insert a new one."""

    def updates(_: HullTree) -> Iterator[Update]:
        chunk = 1024
        for i in range(0, 2**62, chunk):
            yield from zip(tuples(points(i, chunk)), tuples(points(n + i, chunk)), strict=True)

    return Workload(points(0, n), updates)


def uniform(first: int, count: int) -> np.ndarray:
    """The points with these numbers in one endless random sequence."""
    return np.random.Generator(np.random.Philox(1).advance(first)).random((count, 4))[:, :2]


def circle(first: int, count: int) -> np.ndarray:
    angle = 2 * math.pi * uniform(first, count)[:, 0]
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def increasing(first: int, count: int) -> np.ndarray:
    points = uniform(first, count)
    points[:, 0] = np.arange(first, first + count)
    return points


def spiral(first: int, count: int) -> np.ndarray:
    """Every new point lies outside the hull of all before it."""
    i = np.arange(first, first + count)
    angle = i * math.pi * (3 - math.sqrt(5))
    return (1.0 + i)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def vertices_first(points: Callable[[int, int], np.ndarray]) -> Callable[[int], Workload]:
    """Always delete a vertex of the hull."""

    def workload(n: int) -> Workload:
        def updates(hull: HullTree) -> Iterator[Update]:
            for i in range(n, 2**62):
                direction = uniform(2**40 + i, 1) - 0.5
                yield tuples(hull.support(direction))[0], tuples(points(i, 1))[0]

        return Workload(points(0, n), updates)

    return workload


WORKLOADS: dict[str, Callable[[int], Workload]] = {
    "random": lambda n: window(uniform, n),
    "circle": lambda n: window(circle, n),
    "sorted": lambda n: window(increasing, n),
    "spiral": lambda n: window(spiral, n),
    "delete a vertex": vertices_first(uniform),
    "delete a vertex, circle": vertices_first(circle),
}


def tuples(array: np.ndarray) -> list[Point]:
    return list(map(tuple, array.tolist()))


@contextmanager
def replaced(wrapped: Callable[[Callable[..., int]], Callable[..., int]]) -> Iterator[None]:
    """Make the tree call `wrapped(predicate)` wherever it evaluates an `orientation` or a `crossing`."""
    chain_module = nodes.half_chain.__globals__
    places = [(vars(nodes), "orientation"), (vars(nodes), "crossing"), (vars(tree), "orientation")]
    places.append((chain_module, "orientation"))
    originals = [(names, name, names[name]) for names, name in places]
    for names, name, predicate in originals:
        names[name] = wrapped(predicate)
    try:
        yield
    finally:
        for names, name, predicate in originals:
            names[name] = predicate


@contextmanager
def counted() -> Iterator[list[int]]:
    """Count every sign the tree evaluates, in the list's only entry."""
    total = [0]

    def counting(predicate):
        def count(*points):
            total[0] += 1
            return predicate(*points)

        return count

    with replaced(counting):
        yield total


def count_steps(name: str, n: int, updates: int, tree_type: type[HullTree] = HullTree) -> Steps:
    workload = WORKLOADS[name](n)
    hull = tree_type(workload.start)
    steps = Steps()
    with counted() as total:
        for old, new in islice(workload.updates(hull), updates):
            before = total[0]
            hull.delete(*old)
            between = total[0]
            hull.insert(*new)
            steps.deletes.append(between - before)
            steps.inserts.append(total[0] - between)
    return steps
