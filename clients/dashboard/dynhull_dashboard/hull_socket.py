"""A websocket that sends drawings of hulls to a page.

Bokeh's own protocol would serialize every outline for each viewer, in several frames: a millisecond each, and half a
processor for many viewers. Here all viewers are sent the same text.
"""

import asyncio

from tornado.websocket import WebSocketClosedError, WebSocketHandler

from .hub import Hub
from .looks import LOOKS

INTERVAL_SECONDS = 0.1


class HullSocket(WebSocketHandler):
    """Sends the drawings of the hulls named in the query: each when it is new, and only the newest."""

    def initialize(self, hub: Hub) -> None:
        """Tornado passes the application's arguments."""
        self._hub = hub
        self._sending: asyncio.Task[None] | None = None

    def check_origin(self, _: str) -> bool:
        """True: `KnownHosts` has checked the origin, which behind a proxy may differ from the host."""
        return True

    def open(self) -> None:
        """The page has connected."""
        names = list(dict.fromkeys(self.get_query_arguments("hull")))
        self._sending = asyncio.create_task(self._send(names[: len(LOOKS)]))

    def on_close(self) -> None:
        """The page has closed, or shows other hulls."""
        if self._sending is not None:
            self._sending.cancel()

    async def _send(self, names: list[str]) -> None:
        feeds = [self._hub.open_feed(name) for name in names]
        sent: dict[str, str] = {}
        try:
            while True:
                for drawing in [each for feed in feeds for each in feed.drawings()]:
                    if sent.get(drawing.source) is not drawing.message:
                        sent[drawing.source] = drawing.message
                        await self.write_message(drawing.message)
                await asyncio.sleep(INTERVAL_SECONDS)
        except WebSocketClosedError:
            return
        finally:
            for name in names:
                self._hub.release_feed(name)
