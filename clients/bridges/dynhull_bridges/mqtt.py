"""Delivery to an MQTT broker with QoS 1: an event counts as delivered when the broker has acknowledged it."""

import asyncio
import ssl
from collections.abc import Sequence
from urllib.parse import unquote, urlsplit

import aiomqtt

from .letters import Letter
from .target import NotDeliveredError, filled
from .urls import options_of, without_secrets

TOPIC = "dynhull/{fence}/{type}"
PORT, TLS_PORT = 1883, 8883
AT_LEAST_ONCE = 1


class Mqtt:
    """Publishes to the topic in mqtt://[USER:PASSWORD@]HOST[:PORT][/TOPIC], or mqtts:// for TLS.

    {fence} and {type} in the topic are filled in. All fences share one connection.
    """

    most = 1

    def __init__(self, url: str, timeout: float) -> None:
        parts = urlsplit(url, allow_fragments=False)
        if not parts.hostname:
            raise ValueError(f"--to {without_secrets(url)} has no host")
        options_of(url)
        encrypted = parts.scheme == "mqtts"
        self._host, self._port = parts.hostname, parts.port or (TLS_PORT if encrypted else PORT)
        self._user = unquote(parts.username) if parts.username else None
        self._password = unquote(parts.password) if parts.password else None
        self._tls = ssl.create_default_context() if encrypted else None
        self._topic = parts.path.removeprefix("/") or TOPIC
        if {"+", "#"} & set(self._topic):
            raise ValueError(f"the topic {self._topic!r} has a wildcard, + or #: events go to one topic")
        self._timeout = timeout
        self._client: aiomqtt.Client | None = None
        self._connecting = asyncio.Lock()

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Publish the letters, each after the one before was acknowledged."""
        client = await self._connected()
        for each in letters:
            try:
                await client.publish(filled(self._topic, each), each.text, AT_LEAST_ONCE)
            except aiomqtt.MqttError as error:
                await self._disconnect(client)
                raise NotDeliveredError(f"MQTT: {error}") from None

    def place(self, letter: Letter) -> str:
        """The broker and the topic."""
        return f"mqtt://{self._host}:{self._port}/{filled(self._topic, letter)}"

    async def close(self) -> None:
        """Disconnect."""
        if self._client is not None:
            await self._disconnect(self._client)

    async def _connected(self) -> aiomqtt.Client:
        async with self._connecting:
            if self._client is None:
                client = aiomqtt.Client(
                    self._host,
                    self._port,
                    username=self._user,
                    password=self._password,
                    tls_context=self._tls,
                    timeout=self._timeout,
                )
                try:
                    await client.__aenter__()
                except aiomqtt.MqttError as error:
                    raise NotDeliveredError(f"MQTT: {error}") from None
                self._client = client
            return self._client

    async def _disconnect(self, client: aiomqtt.Client) -> None:
        """Give up a connection, unless another fence has done so already."""
        async with self._connecting:
            if self._client is client:
                self._client = None
                try:
                    await client.__aexit__(None, None, None)
                except aiomqtt.MqttError:
                    return  # it is lost, which is why it is given up
