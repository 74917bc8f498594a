"""The server's page for Prometheus, passed on to the pages of the dashboard."""

import asyncio
import time
import urllib.request

SECONDS = 2.0
FRESH_SECONDS = 0.5


class Metrics:
    """Asks for the page, at most as often as one viewer does.

    Args:
        url: the page.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self._asking = asyncio.Lock()
        self._last: dict[str, str] = {}
        self._asked = -FRESH_SECONDS

    async def read(self) -> dict[str, str]:
        """The text of the page, or why it cannot be had."""
        async with self._asking:
            if time.monotonic() - self._asked > FRESH_SECONDS:
                self._last = await asyncio.to_thread(self._read)
                self._asked = time.monotonic()
        return self._last

    def _read(self) -> dict[str, str]:
        try:
            with urllib.request.urlopen(self.url, timeout=SECONDS) as answer:  # noqa: S310  # of the command line
                return {"text": answer.read().decode()}
        except (OSError, ValueError) as error:
            return {"error": str(getattr(error, "reason", error))}
