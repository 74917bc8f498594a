"""Logging of refused calls, at a limited rate, so that strangers cannot fill the log."""

import asyncio
import logging
import time

LINES, SECONDS = 5, 1.0

log = logging.getLogger(__name__)


class RefusalLog:
    """Logs at most LINES refusals in SECONDS, and the number of those left out."""

    def __init__(self) -> None:
        self._since = -SECONDS
        self._lines = 0
        self._left_out = 0

    def add(self, what: str, method: str, code: str, peer: str) -> None:
        """Log a refused call, or count it as left out."""
        now = time.monotonic()
        if now - self._since >= SECONDS:
            self._since, self._lines = now, 0
        self._lines += 1
        if self._lines <= LINES:
            log.warning(what, extra={"method": method, "code": code, "peer": peer})
            return
        if not self._left_out:
            asyncio.get_running_loop().call_later(SECONDS, self.flush)
        self._left_out += 1

    def flush(self) -> None:
        """Log the number of refusals left out."""
        if self._left_out:
            log.warning("more calls were refused", extra={"left_out": self._left_out})
            self._left_out = 0
