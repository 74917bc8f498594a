"""A subscriber of an MQTT broker."""

import asyncio
import json
import threading
from typing import Any

import aiomqtt
from patience import PATIENCE


class Subscriber:
    """Subscribes to all topics, and collects what arrives. The broker keeps the session of an identifier."""

    def __init__(self, port: int, identifier: str | None = None) -> None:
        self.messages: list[tuple[str, dict[str, Any]]] = []
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run(port, identifier)), daemon=True)
        self._thread.start()
        assert self._ready.wait(PATIENCE)

    async def _run(self, port: int, identifier: str | None) -> None:
        try:
            async with aiomqtt.Client(
                "127.0.0.1", port, identifier=identifier, clean_session=identifier is None
            ) as client:
                await client.subscribe("#", qos=1)
                self._ready.set()
                async for message in client.messages:
                    self.messages.append((str(message.topic), json.loads(message.payload)))
        except aiomqtt.MqttError:  # the broker was killed
            return
