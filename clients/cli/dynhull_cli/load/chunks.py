"""Points as they are read: a chunk of good rows at a time, and what is wrong with the bad ones."""

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import TypeVar

import numpy as np

from dynhull.arrays import Points as Points

CHUNK_ROWS = 8192

Position = tuple[float, float]
Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that cannot be read as points: where it is, why, and its text."""

    place: str
    reason: str
    text: str


@dataclass(frozen=True, slots=True)
class Chunk:
    """(n, 2) finite points in the order of the file, and the bad rows between them."""

    points: Points
    bad: list[BadRow] = field(default_factory=list)


Chunks = Generator[Chunk, None, None]


def picked(
    rows: Iterable[tuple[str, Row]], positions: Callable[[Row], Sequence[Position]], text: Callable[[Row], str] = str
) -> Chunk:
    """Make a chunk from rows with their places.

    `positions` returns the points of a row, and raises ValueError if it has none; `text` returns its text for messages.
    """
    points: list[Position] = []
    bad = []
    for place, row in rows:
        try:
            points.extend(positions(row))
        except ValueError as reason:
            bad.append(BadRow(place, str(reason), text(row)))
    return Chunk(np.array(points, np.float64).reshape(-1, 2), bad)


def cut(rows: Iterable[Row], size: int) -> Iterator[list[Row]]:
    """The same rows in lists of `size`, the last one shorter."""
    iterator = iter(rows)
    while piece := list(islice(iterator, size)):
        yield piece


def blocks(chunks: Iterable[Points], size: int) -> Iterator[Points]:
    """The same points in arrays of `size`, the last one shorter."""
    held: list[Points] = []
    rows = 0
    for points in chunks:
        held.append(points)
        rows += len(points)
        if rows >= size:
            whole = np.concatenate(held)
            full = rows - rows % size
            yield from np.split(whole[:full], full // size)
            held, rows = [whole[full:]], rows % size
    if rows:
        yield np.concatenate(held)
