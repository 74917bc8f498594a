"""The line between the supervisor and one of its processes: messages as lines of JSON, over a pair of sockets.

The supervisor sends what the process needs to begin, and asks for its metrics. The process says when it serves. Each
notices the end of the other by the end of the line.
"""

import asyncio
import json
import socket
from typing import Any, Self

# Bytes of a message: a page of metrics has some hundred kilobytes.
MOST_BYTES = 2**26


class ProcessLine:
    """One end of the line."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    @classmethod
    async def on(cls, end: socket.socket) -> Self:
        """The line over a connected socket, which it owns from then on."""
        return cls(*await asyncio.open_connection(sock=end, limit=MOST_BYTES))

    async def receive(self) -> dict[str, Any] | None:
        """The next message; None when the other process has ended."""
        try:
            message = await self._reader.readline()
        except OSError:
            return None
        return json.loads(message) if message.endswith(b"\n") else None

    def send(self, message: dict[str, Any]) -> None:
        """Send a message; it is lost if the other process has ended."""
        self._writer.write(json.dumps(message).encode() + b"\n")

    def close(self) -> None:
        """Close the line."""
        self._writer.close()
