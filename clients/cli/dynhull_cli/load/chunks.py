"""Points as they are read: a chunk of good rows at a time, and what is wrong with the bad ones."""

from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points as Points

from ..reading.labels import Key, Labels

CHUNK_ROWS = 8192
LINE = "line"

Position = tuple[float, float]
Numbers = npt.NDArray[np.int64]
Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that cannot be read as points: where it is, why, and its text."""

    place: str
    reason: str
    text: str


@dataclass(frozen=True, slots=True)
class Rows:
    """Good rows in the order of the file.

    Attributes:
        points: (n, 2) finite points.
        numbers: (n,) the numbers of their rows in the file, from 1,
        unit: and what is counted: lines, say.
        keys: the key of each; None without a column of keys.
        times: the time of each in microseconds since 1970; None without a column of times.
        expires: the time at which each leaves, None for never; None where none leaves.
        accuracies: how far each may be from where it really is, None for not at all; None where none has an error.
    """

    points: Points
    numbers: Numbers
    unit: str
    keys: list[Key] | None = None
    times: list[int] | None = None
    expires: list[int | None] | None = None
    accuracies: list[float | None] | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> "Rows":
        keys, times, expires, accuracies = self.keys, self.times, self.expires, self.accuracies
        return Rows(
            self.points[rows],
            self.numbers[rows],
            self.unit,
            None if keys is None else keys[rows],
            None if times is None else times[rows],
            None if expires is None else expires[rows],
            None if accuracies is None else accuracies[rows],
        )

    def by_expiry(self) -> "list[Rows]":
        """The rows that stay, and those that leave: a batch has such a time for each of its keys, or for none."""
        if self.expires is None or None not in self.expires:
            return [self]
        stay = [row for row, time in enumerate(self.expires) if time is None]
        leave = [row for row, time in enumerate(self.expires) if time is not None]
        return [replace(self.at(stay), expires=None), self.at(leave)]

    def without(self, bad: Collection[int]) -> "Rows":
        """The rows but for some, given by their numbers in this."""
        return self.at([row for row in range(len(self)) if row not in bad]) if bad else self

    def bad(self, row: int, reason: str) -> BadRow:
        """One of the rows as a bad one; its text is made of what was read."""
        columns: tuple[list[Any] | None, ...] = self.keys, self.times, self.expires, self.accuracies
        labels = (None if each is None else each[row] for each in columns)
        text = ",".join(str(each) for each in (*self.points[row].tolist(), *labels) if each is not None)
        return BadRow(f"{self.unit} {self.numbers[row]}", reason, text)

    def at(self, rows: list[int]) -> "Rows":
        """Some rows, given by their numbers."""
        columns: list[Any] = [self.keys, self.times, self.expires, self.accuracies]
        kept = self.points[rows], self.numbers[rows], self.unit
        return Rows(*kept, *(None if each is None else [each[row] for row in rows] for each in columns))


@dataclass(frozen=True, slots=True)
class Chunk:
    """Good rows, and the bad rows between them."""

    rows: Rows
    bad: list[BadRow] = field(default_factory=list)


Chunks = Generator[Chunk, None, None]


def picked(
    unit: str,
    rows: Iterable[tuple[int, Row]],
    positions: Callable[[Row], Sequence[Position]],
    text: Callable[[Row], str] = str,
    labels: Callable[[Row], Labels] | None = None,
) -> Chunk:
    """Make a chunk from rows with their numbers, of lines, say: the `unit`.

    `positions` returns the points of a row, and `labels` their key, time, time to leave and accuracy; they raise
    ValueError if it has none.
    `text` returns its text for messages.
    """
    points: list[Position] = []
    numbers: list[int] = []
    columns: tuple[list[Any], ...] = [], [], [], []
    bad = []
    for number, row in rows:
        try:
            found = positions(row)
            of_row = () if labels is None else labels(row)
        except ValueError as reason:
            bad.append(BadRow(f"{unit} {number}", str(reason), text(row)))
            continue
        points.extend(found)
        numbers.extend([number] * len(found))
        for column, label in zip(columns, of_row, strict=False):
            column.extend([label] * len(found))
    known: Iterable[Any] = (column if any(each is not None for each in column) else None for column in columns)
    return Chunk(
        Rows(np.array(points, np.float64).reshape(-1, 2), np.array(numbers, np.int64), unit, *known),
        bad,
    )


def cut(rows: Iterable[Row], size: int) -> Iterator[list[Row]]:
    """The same rows in lists of `size`, the last one shorter."""
    iterator = iter(rows)
    while piece := list(islice(iterator, size)):
        yield piece


def blocks(chunks: Iterable[Rows], size: int) -> Iterator[Rows]:
    """The same rows in blocks of `size`, the last one shorter. A block also ends before a key comes again in it."""
    held: list[Rows] = []
    count = 0
    known: set[Key] = set()
    for rows in chunks:
        begin = 0
        for end in _ends(rows, size - count, size, known):
            held.append(rows[begin:end])
            yield _joined(held)
            held, count, begin = [], 0, end
        if begin < len(rows):
            held.append(rows[begin:])
            count += len(rows) - begin
    if held:
        yield _joined(held)


def _ends(rows: Rows, room: int, size: int, known: set[Key]) -> Iterator[int]:
    """The rows before which a block ends; `room` is the number of rows that the first block still takes."""
    if rows.keys is None:
        yield from range(room, len(rows) + 1, size)
        return
    for row, key in enumerate(rows.keys):
        if key in known or not room:
            yield row
            known.clear()
            room = size
        known.add(key)
        room -= 1


def _joined(parts: list[Rows]) -> Rows:
    keys = None if parts[0].keys is None else list(chain.from_iterable(part.keys or () for part in parts))
    times = None if parts[0].times is None else list(chain.from_iterable(part.times or () for part in parts))
    expires: list[int | None] | None = None
    if any(part.expires is not None for part in parts):
        expires = list(chain.from_iterable(part.expires or [None] * len(part) for part in parts))
    accuracies: list[float | None] | None = None
    if any(part.accuracies is not None for part in parts):
        accuracies = list(chain.from_iterable(part.accuracies or [None] * len(part) for part in parts))
    points, numbers = (
        np.concatenate(each) for each in zip(*((part.points, part.numbers) for part in parts), strict=True)
    )
    return Rows(points, numbers, parts[0].unit, keys, times, expires, accuracies)
