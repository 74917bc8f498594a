"""Rows that cannot be read as points: counts them, shows the first ones, and can write all to a file."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TextIO

from ..csv_points import SHOWN_BAD_ROWS, bad_rows_left_out
from ..plural import plural
from ..reading.text import KEPT_BYTES
from .chunks import BadRow, Chunk, Rows
from .refusals import TOO_FAR
from .source import Source

ADVICE = (
    "A hull on the globe has points within 85 degrees of its centre. `dynhull create NAME --geographic "
    "--center LON,LAT` makes one about another; --replace --plane loads degrees as points of a plane."
)


class BadRows:
    """The bad rows of an input, written to `file` if there is one; ValueError when there are more than `most`."""

    def __init__(self, name: str, file: TextIO | None, most: int | None) -> None:
        self._name = name
        self.count = 0
        self._first: list[BadRow] = []
        self._too_far = False
        self._most = most
        self._writer = None if file is None else csv.writer(file)
        if self._writer is not None:
            self._writer.writerow(["place", "reason", "row"])

    def left_out(self, chunks: Iterable[Chunk]) -> Iterator[Rows]:
        """The good rows of the chunks."""
        for chunk in chunks:
            self.add(chunk.bad)
            yield chunk.rows

    def report(self) -> list[str]:
        """Lines for the user: how many there are, and the first ones."""
        left_out = bad_rows_left_out(self._name, [f"{each.place}: {each.reason}" for each in self._first], self.count)
        return [*left_out, ADVICE] if self._too_far else left_out

    def add(self, rows: Sequence[BadRow]) -> None:
        """Count and keep bad rows; ValueError if there are too many."""
        self.count += len(rows)
        self._too_far |= any(TOO_FAR in each.reason for each in rows)
        self._first += rows[: SHOWN_BAD_ROWS - len(self._first)]
        if self._writer is not None:
            self._writer.writerows((each.place, each.reason, each.text) for each in rows)
        if self._most is not None and self.count > self._most:
            raise ValueError("\n".join([f"more than {plural(self._most, 'bad row')} (--max-bad)", *self.report()]))


def open_bad_rows(path: Path | None, source: Source) -> AbstractContextManager[TextIO | None]:
    """Open the file for the bad rows; without a path, None. ValueError where it is the file that is being read."""
    if path is None:
        return nullcontext()
    if path.exists() and source.is_file(path):
        raise ValueError(f"--bad-rows {path} is the file that is loaded, and would replace it: name another file")
    return path.open("w", encoding="utf-8", errors=KEPT_BYTES, newline="")
