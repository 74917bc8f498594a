"""Time lines: the latest rows of a table that grows."""

from collections import deque
from collections.abc import Mapping

ROWS = 600


class History:
    """The last `ROWS` rows. Each viewer asks for those that are new to it.

    Attributes:
        columns: the columns' names.
        length: how many rows there have ever been.
    """

    def __init__(self, *columns: str) -> None:
        self.columns = columns
        self.length = 0
        self._rows: deque[tuple[float, ...]] = deque(maxlen=ROWS)

    def append(self, *row: float) -> None:
        """Add a row: a number for each column, NaN where there is none."""
        self._rows.append(row)
        self.length += 1

    def since(self, length: int) -> Mapping[str, list[float]]:
        """The rows after the first `length`, as far as they are kept, by column."""
        new = min(self.length - length, len(self._rows))
        rows = list(self._rows)[len(self._rows) - new :]
        return {name: [row[i] for row in rows] for i, name in enumerate(self.columns)}
