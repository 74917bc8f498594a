"""A websocket that sends drawings of hulls and fences to a page.

Bokeh's own protocol would serialize every outline for each viewer, in several frames: a millisecond each, and half a
processor for many viewers. Here all viewers are sent the same text.
"""

import asyncio
from collections.abc import Iterable

from tornado.websocket import WebSocketClosedError, WebSocketHandler

from .feed import HullFeed
from .fence_feed import FenceFeed
from .hub import Hub
from .looks import FENCE_LOOKS, LOOKS

INTERVAL_SECONDS = 0.1


class HullSocket(WebSocketHandler):
    """Sends the drawings of the hulls and fences named in the query: each when it is new, and only the newest."""

    def initialize(self, hub: Hub) -> None:
        """Tornado passes the application's arguments."""
        self._hub = hub
        self._sending: asyncio.Task[None] | None = None

    def check_origin(self, _: str) -> bool:
        """True: `KnownHosts` has checked the origin, which behind a proxy may differ from the host."""
        return True

    def open(self) -> None:
        """The page has connected."""
        hulls, fences = (list(dict.fromkeys(self.get_query_arguments(name))) for name in ("hull", "fence"))
        self._sending = asyncio.create_task(self._send(hulls[: len(LOOKS)], fences[: len(FENCE_LOOKS)]))

    def on_close(self) -> None:
        """The page has closed, or shows something else."""
        if self._sending is not None:
            self._sending.cancel()

    async def _send(self, hull_names: list[str], fence_names: list[str]) -> None:
        hulls = [self._hub.hulls.open(name) for name in hull_names]
        fences = [self._hub.fences.open(name) for name in fence_names]
        sent: dict[str, str] = {}
        try:
            while True:
                for source, message in _messages(hulls, fences):
                    if sent.get(source) is not message:
                        sent[source] = message
                        await self.write_message(message)
                await asyncio.sleep(INTERVAL_SECONDS)
        except WebSocketClosedError:
            return
        finally:
            for name in hull_names:
                self._hub.hulls.release(name)
            for name in fence_names:
                self._hub.fences.release(name)


def _messages(hulls: Iterable[HullFeed], fences: Iterable[FenceFeed]) -> list[tuple[str, str]]:
    """All that there is to draw, each with a name of its own. Hulls first: fences may have their outlines."""
    drawings = [(each.source, each.message) for feed in hulls for each in feed.drawings()]
    return drawings + [(f"{kind} of {feed.name}", text) for feed in fences for kind, text in feed.messages().items()]
