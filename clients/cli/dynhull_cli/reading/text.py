"""Text in any encoding. Bytes that are none of it are refused with their place, or kept as they are; never replaced."""

import codecs
import io
import re
import sys
from typing import IO, Any

PART = 2**16  # bytes
MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # begins like the mark of UTF-16
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
LONGEST_MARK = max(map(len, MARKS))
UTF8 = "utf-8"
MARK = "\ufeff"
KEPT_BYTES = "dynhull.kept_bytes"
"""An error handler: bytes that are no text are U+DC00 to U+DCFF, which no text has, and become such bytes again."""

KEPT = re.compile("[\udc00-\udcff]")


def _kept(error: UnicodeError) -> tuple[str | bytes, int]:
    if isinstance(error, UnicodeDecodeError):
        return "".join(chr(0xDC00 + each) for each in error.object[error.start : error.end]), error.end
    if isinstance(error, UnicodeEncodeError) and KEPT.fullmatch(error.object[error.start]):
        return bytes([ord(error.object[error.start]) - 0xDC00]), error.start + 1
    raise error


codecs.register_error(KEPT_BYTES, _kept)


class UndecodableError(ValueError):
    """A text has bytes that are none of its encoding."""


class Utf8(io.RawIOBase):
    """A text as UTF-8 without a byte order mark.

    Args:
        name: of the text, for messages.
        file: its bytes, buffered; it stays open.
        given: its encoding; None for UTF-8, or for that which a byte order mark names.
        keep: whether bytes that are none of the encoding are kept. Otherwise UndecodableError names the first one.

    Attributes:
        encoding: its encoding; UTF-8 until a byte order mark has been read.
        kept: whether there were such bytes in what has been read.

    Raises:
        ValueError: there is no such encoding.
    """

    def __init__(self, name: str, file: IO[bytes], given: str | None = None, *, keep: bool = False) -> None:
        self.encoding = UTF8 if given is None else _encoding(given)
        self.kept = False
        self._name, self._file, self._given, self._keep = name, file, given, keep
        self._decoder: codecs.IncrementalDecoder | None = None
        self._ready = memoryview(b"")
        self._ended = False
        self._line, self._character = 1, 0  # of the end of what has been read
        self._returned = False  # whether that end is a carriage return

    def readable(self) -> bool:
        """True."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Read what there is."""
        while not self._ready and not self._ended:
            self._ready = memoryview(self._encoded(self._read()))
        size = min(len(buffer), len(self._ready))
        buffer[:size] = self._ready[:size]
        self._ready = self._ready[size:]
        return size

    def _read(self) -> str:
        """More of the text, perhaps nothing. A terminal is not read again after its end."""
        if self._decoder is not None:
            part = self._part()
            self._ended = not part
            return self._decoder.decode(part, self._ended)
        start = self._file.read(LONGEST_MARK)
        part = self._part() if len(start) == LONGEST_MARK else b""
        self._ended = not part
        if self._given is None:
            self.encoding = next((each for mark, each in MARKS.items() if start.startswith(mark)), UTF8)
        self._decoder = codecs.getincrementaldecoder(self.encoding)(KEPT_BYTES)
        return self._decoder.decode(start + part, self._ended).removeprefix(MARK)

    def _part(self) -> bytes:
        return bytes(self._file.read1(PART))  # type: ignore[attr-defined]

    def _encoded(self, text: str) -> bytes:
        try:
            encoded = text.encode()
        except UnicodeEncodeError as error:  # a kept byte
            self.kept = True
            if not self._keep:
                self._pass(text[: error.start])
                place = f"{self._name}, line {self._line}, character {self._character + 1}"
                byte = ord(text[error.start]) & 0xFF
                raise UndecodableError(f"{place}: the byte 0x{byte:02x} is not {self.encoding.upper()}") from None
            encoded = text.encode(errors=KEPT_BYTES)
        self._pass(text)
        return encoded

    def _pass(self, text: str) -> None:
        """Count the lines, which end in any of three ways."""
        ends = text.count("\n") + text.count("\r") - text.count("\r\n") - (self._returned and text.startswith("\n"))
        self._line += ends
        last = max(text.rfind("\n"), text.rfind("\r"))
        self._character = len(text) - last - 1 + (self._character if last < 0 else 0)
        self._returned = text.endswith("\r") or (self._returned and not text)


def lines_of(text: Utf8) -> io.TextIOWrapper:
    """The lines of a text, with their ends."""
    return io.TextIOWrapper(io.BufferedReader(text, PART), UTF8, KEPT_BYTES, newline="")


def standard_input() -> io.TextIOWrapper:
    """The lines of standard input, which is UTF-8 whatever the locale says; UndecodableError where it is not."""
    return lines_of(Utf8("standard input", sys.stdin.buffer))


def require_decoded(text: str) -> None:
    """Raise ValueError if bytes have been kept in a text."""
    if not text.isascii() and (found := KEPT.search(text)):
        raise ValueError(f"its byte 0x{ord(found[0]) - 0xDC00:02x} is none of the encoding of the file")


def _encoding(given: str) -> str:
    try:
        "".encode(given)  # refuses what Python calls an encoding and is none of text, such as hex
        return codecs.lookup(given).name
    except (LookupError, UnicodeError):
        raise ValueError(f"there is no encoding {given!r}: write for example utf-16 or latin-1") from None
