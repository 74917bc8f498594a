"""The latest rows of a growing table, for the time lines."""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from itertools import chain

ROWS = 600
# Of what is older, rows for an hour, at least these milliseconds apart.
OLDER_ROWS, APART_MILLISECONDS = 360, 10_000


class TimeLine:
    """The last `ROWS` rows, and some of those before. Each viewer asks for the rows it has not seen.

    Attributes:
        columns: the names of the columns; the first one is the time in milliseconds.
        length: the number of rows ever appended.
    """

    def __init__(self, *columns: str) -> None:
        self.columns = columns
        self.length = 0
        self._rows: deque[tuple[float, ...]] = deque()
        self._older: deque[tuple[float, ...]] = deque(maxlen=OLDER_ROWS)

    def begin(self, rows: Iterable[tuple[float, ...]]) -> None:
        """Begin with older rows, before any are appended."""
        self._older.extend(rows)

    def append(self, *row: float) -> None:
        """Add a row: one number per column, NaN for an unknown one."""
        self._rows.append(row)
        self.length += 1
        if len(self._rows) > ROWS:
            old = self._rows.popleft()
            if not self._older or old[0] - self._older[-1][0] >= APART_MILLISECONDS:
                self._older.append(old)

    def since(self, length: int) -> Mapping[str, list[float | None]]:
        """The rows after the first `length`, as far as they are kept, as lists by column; None for NaN, as in JSON."""
        new = min(self.length - length, len(self._rows))
        rows = list(self._rows)[len(self._rows) - new :]
        if not length and rows:
            rows = list(chain(self._older, rows))
        return {name: [None if math.isnan(row[i]) else row[i] for row in rows] for i, name in enumerate(self.columns)}
