"""A body as it arrives, cut into its lines or records."""

from collections.abc import AsyncIterator

from .rows import RowError

LONGEST = 2**20
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
RECORD = b"\x1e"
LINE = b"\n"


async def texts(body: AsyncIterator[bytes], mark: bytes) -> AsyncIterator[list[bytes]]:
    """The texts between marks, some at a time; empty ones are left out.

    Raises:
        RowError: a text is longer than 1 MiB; its row is counted from the last text that was returned.
    """
    begun = bytearray()
    first = True
    async for part in body:
        begun += part
        if first and len(begun) >= len(BYTE_ORDER_MARK):
            first = False
            if begun.startswith(BYTE_ORDER_MARK):
                del begun[: len(BYTE_ORDER_MARK)]
        if mark in part:
            *complete, rest = bytes(begun).split(mark)
            begun = bytearray(rest)
            if found := _stripped(complete):
                yield found
        if len(begun) > LONGEST:
            raise RowError(0, f"longer than {LONGEST} bytes")
    if found := _stripped([bytes(begun)]):
        yield found


def _stripped(found: list[bytes]) -> list[bytes]:
    return [text for each in found if (text := each.strip())]
