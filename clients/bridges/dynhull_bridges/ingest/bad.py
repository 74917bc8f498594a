"""Messages that cannot be taken: counted, logged and kept aside."""

import base64
import json
import os
from pathlib import Path
from typing import Any

import structlog

from dynhull_cli.fields import in_options
from dynhull_client import InvalidRequestError

from ..lines import whole_or_nothing, write_all
from .feed import Message

log = structlog.get_logger("dynhull_ingest")
# This many are logged one by one; later ones are counted, and written to the file if there is one.
LOGGED = 10


class BadMessages:
    """Keeps bad messages aside, each as a line of JSON with its topic, number (if it has one), error and payload.

    Args:
        path: the file to append to; None to count them only.
        most: the ingest ends if there are more than this; None for no limit.

    Raises:
        OSError: the file cannot be opened.
    """

    def __init__(self, path: Path | None, most: int | None) -> None:
        self.count = 0
        self._file = None if path is None else os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        self._path = path
        self._most = most

    def add(self, message: Message, error: Exception) -> None:
        """Keep a message aside. TooManyBadError if there are too many, OSError if it cannot be written."""
        self.count += 1
        reason = in_options(error) if isinstance(error, InvalidRequestError) else str(error)
        if self._file is not None:
            line = json.dumps(_line(message, reason), ensure_ascii=False) + "\n"
            try:
                with whole_or_nothing(self._file):
                    write_all(self._file, line.encode())
            except OSError as failure:
                raise OSError(failure.errno, failure.strerror, str(self._path)) from None
        if self.count <= LOGGED:
            log.warning("bad message", **_place(message), error=reason)
        if self.count == LOGGED + 1:
            log.warning("more bad messages are counted, not logged")
        if self._most is not None and self.count > self._most:
            raise TooManyBadError(f"more than {self._most} bad messages; the last one, of {message.topic}: {reason}")

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            os.close(self._file)


class TooManyBadError(Exception):
    """There are more bad messages than `--max-bad` allows."""


def _place(message: Message) -> dict[str, Any]:
    """Where a message stands: its topic, and its number where the broker has a log."""
    return {"topic": message.topic, **({"number": message.number} if message.number else {})}


def _line(message: Message, reason: str) -> dict[str, Any]:
    line = {**_place(message), "error": reason}
    payload = message.payload or b""
    try:
        line["payload"] = payload.decode()
    except UnicodeDecodeError:
        line["payload_base64"] = base64.b64encode(payload).decode()
    return line
