"""Reads CSV files whose delimiter, header and encoding are given or detected."""

import codecs
import csv
import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from typing import IO, Any

from .peek import peek
from .reading.columns import coordinate_columns, has_pair
from .reading.values import is_number

DELIMITERS = "\t;,| "  # the first of these in the first line, outside quotes, separates the columns
DELIMITER_NAMES = {"tab": "\t", "\\t": "\t", "space": " "}
END_OF_TEXT = "\0\x04\0"  # after the last line: a row of its own unless a quote is open
UTF16_MARKS = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE


class UnclearTableError(ValueError):
    """A file that cannot be read without further options; `advice` names them, for commands that have them."""

    def __init__(self, message: str, advice: str) -> None:
        super().__init__(message)
        self.advice = advice


@dataclass(frozen=True, slots=True)
class CsvFormat:
    """What the caller knows of a file; None for what is to be detected.

    Attributes:
        x: the column of x: its name, or its number from 1.
        y: the column of y.
        delimiter: the character between columns, or its name: tab, space.
        header: whether the first row names the columns.
        encoding: a name that Python knows, such as latin-1.
    """

    x: str | None = None
    y: str | None = None
    delimiter: str | None = None
    header: bool | None = None
    encoding: str | None = None


@dataclass(frozen=True, slots=True)
class CsvTable:
    """An open CSV file.

    Attributes:
        names: the names of the columns; column 1 and so on where there is no header.
        x: the index of the column of x.
        y: the index of the column of y.
        delimiter: the character between columns.
        first_line: the line of the first row.
        rows: the rows, without the header.
        next_line: returns the line of the row that `rows` gives next, once it has given one.
        notes: lines about what was detected and may surprise.
    """

    names: list[str]
    x: int
    y: int
    delimiter: str
    first_line: int
    rows: Iterator[list[str]]
    next_line: Callable[[], int]
    notes: list[str]

    def require_no_more_fields(self, row: list[str]) -> None:
        """Raise ValueError if the row has more fields than there are columns, other than empty ones at its end."""
        columns = len(self.names)
        if len(row) > columns and any(field.strip() for field in row[columns:]):
            raise ValueError(f"{len(row)} fields in a table of {columns} columns")


@contextmanager
def csv_table(name: str, file: IO[bytes], given: CsvFormat) -> Iterator[CsvTable]:
    """Open a table on a file that can be peeked into; the file stays open.

    Raises:
        ValueError: the file is empty or no CSV, or its columns are not there. The message begins with `name`.
        UnclearTableError: an option is needed.
    """
    notes: list[str] = []
    text = io.TextIOWrapper(file, _encoding(name, file, given.encoding, notes), errors="replace", newline="")
    try:
        skipped, first_line = _first_line(name, text)
        delimiter = _delimiter(given.delimiter, first_line)
        # Runs of spaces separate columns once.
        lines = chain([first_line], text, [END_OF_TEXT])
        reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=delimiter == " ")
        try:
            yield _table(name, reader, given, delimiter, skipped, notes)
        except csv.Error as error:
            advice = ": is a quote not closed?" if "field limit" in str(error) else ""
            raise ValueError(f"{name}, line {skipped + reader.line_num}: {error}{advice}") from None
    finally:
        text.detach()


def numbered(rows: Iterable[list[str]], first_line: int) -> Iterator[tuple[int, list[str]]]:
    """The rows that are not blank, each with its line. A quoted field may contain line ends."""
    for row in rows:
        if row:
            yield first_line, row
        first_line += 1 + sum(field.count("\n") for field in row)


def _closed(name: str, reader: Any, skipped: int) -> Iterator[list[str]]:
    """The rows; ValueError for a quote that is still open at the end of the file: it holds all lines after it."""
    before = reader.line_num
    for row in reader:
        if row and row[-1].endswith(END_OF_TEXT):
            if row == [END_OF_TEXT]:
                return
            raise ValueError(f"{name}, line {skipped + before + 1}: a quote is opened and not closed before the end")
        yield row
        before = reader.line_num


def _table(name: str, reader: Any, given: CsvFormat, delimiter: str, skipped: int, notes: list[str]) -> CsvTable:
    rows = _closed(name, reader, skipped)
    first = [field.strip() for field in next(rows)]
    if len(first) == 1:
        raise UnclearTableError(
            f"{name} has a single column, {first[0]!r}", "give the character between its columns with --delimiter"
        )

    def next_line() -> int:
        return skipped + int(reader.line_num) + 1

    if _is_header(first, given):
        x, y = coordinate_columns(name, first, given.x, given.y)
        return CsvTable(first, x, y, delimiter, next_line(), rows, next_line, notes)
    numbers = [f"column {number}" for number in range(1, len(first) + 1)]
    if given.x is not None or given.y is not None:
        x, y = coordinate_columns(name, numbers, given.x, given.y)
    elif len(first) == 2:
        x, y = 0, 1
    else:
        raise UnclearTableError(
            f"{name} has no header and {len(first)} columns, first {', '.join(first)}: "
            "choose two by number, for example --x 1 --y 2",
            "if the first row names the columns, add --header",
        )
    notes.append(f"{name} has no header: x is column {x + 1}, y is column {y + 1}")
    return CsvTable(numbers, x, y, delimiter, skipped + 1, chain([first], rows), next_line, notes)


def _encoding(name: str, file: IO[bytes], given: str | None, notes: list[str]) -> str:
    if given is not None:
        try:
            return codecs.lookup(given).name
        except LookupError:
            raise ValueError(f"there is no encoding {given!r}: write for example utf-16 or latin-1") from None
    if peek(file, len(UTF16_MARKS[0])) in UTF16_MARKS:
        notes.append(f"{name} is UTF-16")
        return "utf-16"
    return "utf-8-sig"


def _first_line(name: str, text: io.TextIOWrapper) -> tuple[int, str]:
    """The number of blank lines before the first line that is not, and that line."""
    for skipped, line in enumerate(text):
        if "\0" in line:
            order = "be" if line.startswith("\0") else "le"
            raise UnclearTableError(
                f"{name} looks like UTF-16 without a byte order mark", f"read it with --encoding utf-16-{order}"
            )
        if line.strip():
            return skipped, line
    raise ValueError(f"{name} is empty")


def _delimiter(given: str | None, line: str) -> str:
    if given is None:
        outside_quotes = "".join(line.split('"')[::2]).strip("\r\n ")
        return next((each for each in DELIMITERS if each in outside_quotes), ",")
    delimiter = DELIMITER_NAMES.get(given, given)
    if len(delimiter) != 1 or delimiter in '"\r\n':
        raise ValueError(f"--delimiter {given!r} is not one character, nor tab or space")
    return delimiter


def _is_header(first: list[str], given: CsvFormat) -> bool:
    """Whether the first row names the columns. Numbers are data, unless the given names of columns are among them."""
    if given.header is not None:
        return given.header
    named = {given.x, given.y} <= set(first) and not (is_number(given.x or "") or is_number(given.y or ""))
    return named or has_pair(first) or not any(map(is_number, first))
