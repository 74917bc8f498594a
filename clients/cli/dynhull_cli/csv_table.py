"""Reads CSV files whose delimiter, header and encoding are given or detected."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import chain, islice
from typing import IO, Any

from .reading.columns import coordinate_columns, geometry_column, has_pair
from .reading.text import UTF8, UndecodableError, Utf8, lines_of, require_decoded
from .reading.values import is_number

DELIMITERS = "\t;,| "  # of these, in case of doubt the first, one separates the columns
LOOKED_AT = 20  # lines that show which
DELIMITER_NAMES = {"tab": "\t", "\\t": "\t", "space": " "}
END_OF_TEXT = "\0\x04\0"  # after the last line: a row of its own unless a quote is open


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
        keep_bytes: whether rows with bytes that are none of the encoding are bad rows, and not an error.
        geometries: whether a column of geometries is read, if there are no columns of x and y.
        geometry: its name or its number.
    """

    x: str | None = None
    y: str | None = None
    delimiter: str | None = None
    header: bool | None = None
    encoding: str | None = None
    keep_bytes: bool = False
    geometries: bool = False
    geometry: str | None = None


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
        text: what decodes the file.
        notes: lines about what was detected and may surprise.
        geometry: the index of the column of geometries, which is read in place of x and y; None for no such column.
    """

    names: list[str]
    x: int
    y: int
    delimiter: str
    first_line: int
    rows: Iterator[list[str]]
    next_line: Callable[[], int]
    text: Utf8
    notes: list[str]
    geometry: int | None = None

    def require_whole(self, row: list[str]) -> None:
        """Raise ValueError if the row has more fields than columns, but for empty ones, or bytes that are no text."""
        columns = len(self.names)
        if len(row) > columns and any(field.strip() for field in row[columns:]):
            raise ValueError(f"{len(row)} fields in a table of {columns} columns")
        if self.text.kept:
            require_decoded(",".join(row))


@contextmanager
def csv_table(name: str, file: IO[bytes], given: CsvFormat) -> Iterator[CsvTable]:
    """Open a table on a file that can be peeked into; the file stays open.

    Raises:
        ValueError: the file is empty or no CSV, or its columns are not there. The message begins with `name`.
        UnclearTableError: an option is needed.
        UndecodableError: bytes are none of the encoding.
    """
    text = Utf8(name, file, given.encoding, keep=given.keep_bytes)
    lines = lines_of(text)
    skipped, first_line = _first_line(name, lines)
    first_lines = [first_line, *islice(lines, LOOKED_AT)]
    notes = [] if given.encoding or text.encoding == UTF8 else [f"{name} is {text.encoding.upper()}"]
    delimiter = _delimiter(given.delimiter, first_lines)
    reader = _reader(chain(first_lines, lines, [END_OF_TEXT]), delimiter)
    try:
        yield _table(name, reader, given, delimiter, skipped, text, notes)
    except csv.Error as error:
        advice = ": is a quote not closed?" if "field limit" in str(error) else ""
        raise ValueError(f"{name}, line {skipped + reader.line_num}: {error}{advice}") from None


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


def _table(
    name: str, reader: Any, given: CsvFormat, delimiter: str, skipped: int, text: Utf8, notes: list[str]
) -> CsvTable:
    rows = _closed(name, reader, skipped)
    first = [field.strip() for field in next(rows)]
    if len(first) == 1 and not (given.geometries and _geometry(name, first, given)):
        raise UnclearTableError(
            f"{name} has a single column, {first[0]!r}", "give the character between its columns with --delimiter"
        )

    def next_line() -> int:
        return skipped + int(reader.line_num) + 1

    if _is_header(first, given):
        try:
            require_decoded(",".join(first))
        except ValueError as error:
            raise UndecodableError(f"{name}, line {skipped + 1}: {error}") from None
        column = _geometry(name, first, given) if given.geometries else None
        if column is not None:
            at = first.index(column)
            return CsvTable(first, at, at, delimiter, next_line(), rows, next_line, text, notes, at)
        x, y = coordinate_columns(name, first, given.x, given.y)
        return CsvTable(first, x, y, delimiter, next_line(), rows, next_line, text, notes)
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
    return CsvTable(numbers, x, y, delimiter, skipped + 1, chain([first], rows), next_line, text, notes)


def _geometry(name: str, columns: list[str], given: CsvFormat) -> str | None:
    return geometry_column(name, columns, given.x, given.y, given.geometry)


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


def _delimiter(given: str | None, lines: list[str]) -> str:
    if given is None:
        return max(DELIMITERS, key=lambda each: _agreement(lines, each))  # the first one of several
    delimiter = DELIMITER_NAMES.get(given, given)
    if len(delimiter) != 1 or delimiter in '"\r\n':
        raise ValueError(f"--delimiter {given!r} is not one character, nor tab or space")
    return delimiter


def _agreement(lines: list[str], delimiter: str) -> float:
    """The share of rows that have as many fields as the first one, with this delimiter; 0 if that is a single one."""
    fields: list[int] = []
    with suppress(csv.Error):  # which is reported when the row is read
        fields.extend(len(row) for row in _reader((line.strip(" \r\n") for line in lines), delimiter) if row)
    if len(lines) > LOOKED_AT:
        del fields[-1:]  # may go on in lines that are not looked at
    return fields.count(fields[0]) / len(fields) if fields and fields[0] > 1 else 0


def _reader(lines: Iterable[str], delimiter: str) -> Any:
    """A reader for which spaces after a delimiter are no part of a field, and runs of spaces separate columns once."""
    return csv.reader(lines, delimiter=delimiter, skipinitialspace=True)


def _is_header(first: list[str], given: CsvFormat) -> bool:
    """Whether the first row names the columns. Numbers are data, unless the given names of columns are among them."""
    if given.header is not None:
        return given.header
    named = {given.x, given.y} <= set(first) and not (is_number(given.x or "") or is_number(given.y or ""))
    return named or has_pair(first) or not any(map(is_number, first))
