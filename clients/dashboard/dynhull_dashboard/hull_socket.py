"""The hulls on their way to a page.

Bokeh's own protocol would write every outline anew for each viewer, in several frames: a millisecond each, and half a
processor for many viewers. Here all are sent the same text.
"""

import asyncio

from tornado.websocket import WebSocketClosedError, WebSocketHandler

from .hub import Hub
from .looks import LOOKS

INTERVAL_SECONDS = 0.1


class HullSocket(WebSocketHandler):
    """One page that shows the hulls named in its query. Each drawing is sent when it is new, and only the newest."""

    def initialize(self, hub: Hub) -> None:
        """As the application says."""
        self._hub = hub
        self._sending: asyncio.Task[None] | None = None

    def check_origin(self, _: str) -> bool:
        """Any, for `KnownHosts` has looked at it: behind a proxy the host may be another of its names."""
        return True

    def open(self) -> None:
        """The page is there."""
        names = list(dict.fromkeys(self.get_query_arguments("hull")))
        self._sending = asyncio.create_task(self._send(names[: len(LOOKS)]))

    def on_close(self) -> None:
        """The page has gone, or shows other hulls."""
        if self._sending is not None:
            self._sending.cancel()

    async def _send(self, names: list[str]) -> None:
        feeds = [self._hub.look(name) for name in names]
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
                self._hub.look_away(name)
