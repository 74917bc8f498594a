"""The latest rows of a growing table, for the time lines."""

import math
from collections import deque
from collections.abc import Mapping

ROWS = 600


class History:
    """The last `ROWS` rows. Each viewer asks for the rows it has not seen.

    Attributes:
        columns: the names of the columns.
        length: the number of rows ever appended.
    """

    def __init__(self, *columns: str) -> None:
        self.columns = columns
        self.length = 0
        self._rows: deque[tuple[float, ...]] = deque(maxlen=ROWS)

    def append(self, *row: float) -> None:
        """Add a row: one number per column, NaN for an unknown one."""
        self._rows.append(row)
        self.length += 1

    def since(self, length: int) -> Mapping[str, list[float | None]]:
        """The rows after the first `length`, as far as they are kept, as lists by column; None for NaN, as in JSON."""
        new = min(self.length - length, len(self._rows))
        rows = list(self._rows)[len(self._rows) - new :]
        return {name: [None if math.isnan(row[i]) else row[i] for row in rows] for i, name in enumerate(self.columns)}
