"""Reads the beginning of a file without consuming it, to detect its format."""

from typing import Any


def peek(file: Any, size: int) -> bytes:
    """The next bytes of a buffered file, at most `size`, which remain to be read. A slow pipe may have fewer."""
    return bytes(file.peek(size)[:size])
