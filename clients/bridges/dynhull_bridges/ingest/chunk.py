"""Rows of consecutive messages for one hull, which become one batch."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from dynhull_cli.reading.times import LARGEST_TIME, as_times

from .feed import Message
from .mapping import Row

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

MOST_ROWS = 8192


class Taken:
    """Messages of one read, until all of their rows are in the hulls or kept aside.

    Attributes:
        messages: the messages.
        left: the number of chunks that are not settled.
        whole: whether all chunks have been made.
    """

    def __init__(self, messages: Sequence[Message]) -> None:
        self.messages = messages
        self.left = 0
        self.whole = False

    @property
    def settled(self) -> bool:
        """Whether all messages have been taken."""
        return self.whole and self.left == 0


class Chunk:
    """The rows of some messages, each key at most once.

    Args:
        taken: what the messages belong to; it waits for the chunk.

    Attributes:
        deletes: whether its keys are deleted, rather than put.
    """

    def __init__(self, taken: Taken) -> None:
        self.taken = taken
        self.messages: list[tuple[Message, list[Row]]] = []
        self.keys: list[Any] = []
        self.points: list[tuple[float, float]] = []
        self.times: list[int | None] = []
        self.expires: list[int | None] = []
        self._accuracies: list[float] = []
        self.deletes = False
        self._known: set[Any] = set()
        taken.left += 1

    @property
    def number(self) -> int:
        """The number of the last message."""
        return self.messages[-1][0].number

    @property
    def ends(self) -> "npt.NDArray[np.datetime64] | None":
        """The times at which the keys leave; None if none leaves.

        In a batch all keys leave or none does, so that those that stay leave at the last time that there is, in 2255.
        """
        if all(each is None for each in self.expires):
            return None
        return as_times([LARGEST_TIME if each is None else each for each in self.expires])

    @property
    def accuracies(self) -> list[float] | None:
        """How far the positions may be from where the keys really are; None if none has an error."""
        return self._accuracies if any(self._accuracies) else None

    def admits(self, rows: Sequence[Row]) -> bool:
        """Whether the rows of another message fit."""
        if not self.messages:
            return True
        if rows[0].deletes != self.deletes:
            return False
        return len(self.points) + len(rows) <= MOST_ROWS and self._known.isdisjoint(row.key for row in rows)

    def add(self, message: Message, rows: list[Row]) -> None:
        """Add the rows of a message."""
        self.messages.append((message, rows))
        self.deletes = rows[0].deletes
        for row in rows:
            self.points.append((row.x, row.y))
            self.times.append(row.time)
            self.expires.append(row.expires)
            self._accuracies.append(row.accuracy)
            if row.key is not None:
                self.keys.append(row.key)
                self._known.add(row.key)

    def settle(self) -> None:
        """The rows are in the hull, or kept aside."""
        self.taken.left -= 1

    def after(self, number: int) -> "Chunk | None":
        """The messages after this one, as a chunk in place of this one; None, and settled, if there are none."""
        if not self.messages or self.messages[0][0].number > number:
            return self
        rest = [each for each in self.messages if each[0].number > number]
        return next(iter(self._parts([rest])), None)

    def split(self, row: int | None) -> "list[Chunk]":
        """Chunks in place of this one: the message of a row, those before and those after it; else two halves."""
        if row is None or not 0 <= row < len(self.points):
            middle = len(self.messages) // 2
            return self._parts([self.messages[:middle], self.messages[middle:]])
        index, end = 0, len(self.messages[0][1])
        while end <= row:
            index += 1
            end += len(self.messages[index][1])
        return self._parts([self.messages[:index], [self.messages[index]], self.messages[index + 1 :]])

    def _parts(self, parts: Sequence[Sequence[tuple[Message, list[Row]]]]) -> "list[Chunk]":
        chunks = []
        for part in parts:
            if part:
                chunk = Chunk(self.taken)
                for message, rows in part:
                    chunk.add(message, rows)
                chunks.append(chunk)
        self.settle()
        return chunks


def chunks_of(taken: Taken, rows: Iterator[tuple[Message, list[Row]]]) -> Iterator[tuple[str, Chunk]]:
    """Chunks of the rows, each with its hull, in an order that keeps that of each hull's rows."""
    open_chunks: dict[str, Chunk] = {}
    for message, found in rows:
        by_hull: dict[str, list[Row]] = {}
        for row in found:
            by_hull.setdefault(row.hull, []).append(row)
        for hull, own in by_hull.items():
            chunk = open_chunks.get(hull)
            if chunk is not None and not chunk.admits(own):
                yield hull, chunk
                chunk = None
            if chunk is None:
                chunk = open_chunks[hull] = Chunk(taken)
            chunk.add(message, own)
    yield from open_chunks.items()
