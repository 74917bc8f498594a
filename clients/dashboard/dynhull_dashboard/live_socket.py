"""The websocket of one page."""

import asyncio
import logging

from tornado.websocket import WebSocketClosedError, WebSocketHandler

from .hub import Hub
from .viewer import Viewer

INTERVAL_SECONDS = 0.1
BAD_MESSAGE = 1003  # of the websocket protocol: data that cannot be accepted

log = logging.getLogger(__name__)


class LiveSocket(WebSocketHandler):
    """Sends what is new on the page, and does what the page asks for.

    The query names hulls, fences, prefixes of hulls and a key, and may ask for outliers. Without `hull` or `fence` the
    dashboard chooses; an empty one stands for none.
    """

    def initialize(self, hub: Hub, version: str) -> None:
        """Tornado passes the application's arguments."""
        self._hub = hub
        self._version = version
        self._viewer: Viewer | None = None
        self._sending: asyncio.Task[None] | None = None

    def check_origin(self, _: str) -> bool:
        """True: `KnownHosts` has checked the origin, which behind a proxy may differ from the host."""
        return True

    def open(self) -> None:
        """The page has connected."""
        key = self.get_query_argument("key", "", strip=False)
        outliers = bool(self.get_query_argument("outliers", ""))
        picked = self._names("hull"), self._names("fence"), self._names("prefix") or []
        viewer = Viewer(self._hub, *picked, key, outliers=outliers, version=self._version)
        self._viewer = viewer
        self._sending = asyncio.create_task(self._send(viewer))

    def on_message(self, message: str | bytes) -> None:
        """The viewer has picked, or looks for, something."""
        assert self._viewer is not None  # open comes first
        try:
            self._viewer.take(message if isinstance(message, str) else message.decode(errors="replace"))
        except (ValueError, RecursionError) as error:
            self.close(BAD_MESSAGE, str(error).encode()[:100].decode(errors="ignore"))

    def on_close(self) -> None:
        """The page has closed."""
        if self._sending is not None:
            self._sending.cancel()
        if self._viewer is not None:
            self._viewer.close()

    def _names(self, name: str) -> list[str] | None:
        found = self.get_query_arguments(name, strip=False)
        return [each for each in dict.fromkeys(found) if each] if found else None

    async def _send(self, viewer: Viewer) -> None:
        try:
            while True:
                for message in viewer.messages():
                    await self.write_message(message)
                await asyncio.sleep(INTERVAL_SECONDS)
        except WebSocketClosedError:
            return
        except Exception:
            log.exception("a page could not be sent what is new")
            self.close()
