"""Delivery to a file or to standard output, a CloudEvent on each line."""

import asyncio
import os
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from .letters import Letter, read_letter
from .target import NotDeliveredError, ReaderGoneError

MOST_LETTERS = 1000
# What is read of a file at the start. Only what was written after the last acknowledgement can be repeated.
TAIL_BYTES = 2**24


class LinesFile:
    """Appends to a file and syncs it. After a restart it continues: events that the file has are not written again.

    Raises:
        OSError: the file cannot be opened.
    """

    most = MOST_LETTERS

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        self._written: dict[str, int] = {}  # the last sequence of each source, by its uid
        # Of a pipe or a device nothing is known, and nothing can be taken back.
        self._regular = stat.S_ISREG(os.fstat(self._file).st_mode)
        if self._regular:
            self._repair()
        self._writing = asyncio.Lock()

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Append the letters that the file does not have, and sync it."""
        async with self._writing:
            new = [each for each in letters if each.sequence > self._written.get(each.uid, 0)]
            if not new:
                return
            text = "".join(f"{each.text}\n" for each in new).encode()
            try:
                await asyncio.to_thread(self._append, text)
            except OSError as error:
                raise NotDeliveredError(f"{self._path}: {error.strerror}") from None
            for each in new:
                self._written[each.uid] = each.sequence

    def place(self, letter: Letter) -> str:  # noqa: ARG002
        """The path."""
        return str(self._path)

    async def close(self) -> None:
        """Close the file."""
        os.close(self._file)

    def _append(self, text: bytes) -> None:
        with whole_or_nothing(self._file):
            write_all(self._file, text)
            if self._regular:
                os.fsync(self._file)

    def _repair(self) -> None:
        """Find the last events, and cut off a line that a killed relay did not complete."""
        size = os.fstat(self._file).st_size
        start = max(0, size - TAIL_BYTES)
        tail = os.pread(self._file, size - start, start)
        whole = tail.rfind(b"\n") + 1
        if whole < len(tail):
            os.ftruncate(self._file, start + whole)
        lines = tail[:whole].split(b"\n")[1 if start else 0 : -1]
        for line in lines:
            try:
                found = read_letter(line.decode())
            except ValueError:  # somebody else's line
                continue
            self._written[found.uid] = found.sequence


class StandardOutput:
    """Writes to standard output."""

    most = MOST_LETTERS

    def __init__(self) -> None:
        self._writing = asyncio.Lock()
        self._output = sys.stdout.fileno()

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Write the letters."""
        async with self._writing:
            text = "".join(f"{each.text}\n" for each in letters).encode()
            try:
                await asyncio.to_thread(write_all, self._output, text)
            except BrokenPipeError:
                raise ReaderGoneError from None
            except OSError as error:
                raise NotDeliveredError(f"standard output: {error.strerror}") from None

    def place(self, letter: Letter) -> str:  # noqa: ARG002
        """A dash."""
        return "-"

    async def close(self) -> None:
        """Nothing to release."""


@contextmanager
def whole_or_nothing(file: int) -> Iterator[None]:
    """Take back what was appended to a regular file if the rest fails: half a line would spoil the next one."""
    before = os.fstat(file)
    try:
        yield
    except OSError:
        if stat.S_ISREG(before.st_mode):
            os.ftruncate(file, before.st_size)
        raise


def write_all(file: int, text: bytes) -> None:
    """Write a text to a file, a pipe or a device."""
    rest = memoryview(text)
    while rest:
        rest = rest[os.write(file, rest) :]
