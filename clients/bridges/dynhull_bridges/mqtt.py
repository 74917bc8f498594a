"""Delivery to an MQTT broker with QoS 1: an event counts as delivered when the broker has accepted it."""

import asyncio
import ssl
from collections.abc import Sequence
from typing import Any
from urllib.parse import unquote, urlsplit

import aiomqtt
from aiomqtt import ProtocolVersion
from paho.mqtt.enums import MQTTErrorCode
from paho.mqtt.reasoncodes import ReasonCode

from .bodies.body import CLOUD_EVENTS, Body
from .letters import Letter
from .refusals.mqtt import MQTT
from .sources import Kind
from .target import NotDeliveredError, filled, not_delivered
from .urls import options_of, without_secrets

TOPICS: dict[Kind, str] = {"fence": "dynhull/{name}/{type}", "alarm": "dynhull/alarm/{name}/{type}"}
PORT, TLS_PORT = 1883, 8883
AT_LEAST_ONCE = 1


class _Client(aiomqtt.Client):
    """A client that hears what the broker answers: to aiomqtt each answer to a publication is a success."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._answers: dict[int, asyncio.Future[ReasonCode]] = {}

    async def send(self, topic: str, text: str) -> ReasonCode:
        """Publish, and return the answer. A broker of MQTT 3.1.1 cannot say that it refuses."""
        info = self._client.publish(topic, text, AT_LEAST_ONCE)
        if info.rc != MQTTErrorCode.MQTT_ERR_SUCCESS:
            raise aiomqtt.MqttCodeError(info.rc, "Could not publish message")
        answer: asyncio.Future[ReasonCode] = asyncio.get_running_loop().create_future()
        self._answers[info.mid] = answer
        try:
            async with asyncio.timeout(self.timeout):
                return await answer
        except TimeoutError:
            raise aiomqtt.MqttError("Operation timed out") from None
        finally:
            del self._answers[info.mid]

    def _on_publish(self, _client: Any, _data: Any, number: int, reason: ReasonCode, _properties: Any) -> None:
        answer = self._answers.get(number)
        if answer is not None and not answer.done():
            answer.set_result(reason)


class Mqtt:
    """Publishes to the topic in mqtt://[USER:PASSWORD@]HOST[:PORT][/TOPIC], or mqtts:// for TLS.

    {kind}, {name} and {type} in the topic are filled in. All sources share one connection.
    """

    most = 1

    def __init__(self, url: str, timeout: float, body: Body = CLOUD_EVENTS) -> None:
        parts = urlsplit(url, allow_fragments=False)
        if not parts.hostname:
            raise ValueError(f"--to {without_secrets(url)} has no host")
        options_of(url)
        encrypted = parts.scheme == "mqtts"
        self._host, self._port = parts.hostname, parts.port or (TLS_PORT if encrypted else PORT)
        self._user = unquote(parts.username) if parts.username else None
        self._password = unquote(parts.password) if parts.password else None
        self._tls = ssl.create_default_context() if encrypted else None
        self._topic = parts.path.removeprefix("/")
        if {"+", "#"} & set(self._topic):
            raise ValueError(f"the topic {self._topic!r} has a wildcard, + or #: events go to one topic")
        self._timeout = timeout
        self._body = body
        self._client: _Client | None = None
        self._connecting = asyncio.Lock()

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Publish the letters, each after the one before was acknowledged."""
        client = await self._connected()
        for each in letters:
            try:
                reason = await client.send(self._filled(each), self._body.text(each))
            except aiomqtt.MqttError as error:
                await self._disconnect(client)
                raise NotDeliveredError(f"MQTT: {error}") from None
            if reason.is_failure:
                raise not_delivered(MQTT.meaning(reason.value), f"MQTT: refused: {reason}")

    def place(self, letter: Letter) -> str:
        """The broker and the topic."""
        return f"mqtt://{self._host}:{self._port}/{self._filled(letter)}"

    async def close(self) -> None:
        """Disconnect."""
        if self._client is not None:
            await self._disconnect(self._client)

    def _filled(self, letter: Letter) -> str:
        return filled(self._topic or TOPICS[letter.source.kind], letter)

    async def _connected(self) -> _Client:
        async with self._connecting:
            if self._client is None:
                try:
                    self._client = await self._connect(ProtocolVersion.V5)
                except aiomqtt.MqttError as error:
                    if isinstance(error.__cause__, OSError):  # nobody has answered
                        raise NotDeliveredError(f"MQTT: {error}") from None
                    try:
                        self._client = await self._connect(ProtocolVersion.V311)
                    except aiomqtt.MqttError:
                        raise NotDeliveredError(f"MQTT: {error}") from None
            return self._client

    async def _connect(self, protocol: ProtocolVersion) -> _Client:
        client = _Client(
            self._host,
            self._port,
            username=self._user,
            password=self._password,
            tls_context=self._tls,
            timeout=self._timeout,
            protocol=protocol,
        )
        await client.__aenter__()
        return client

    async def _disconnect(self, client: _Client) -> None:
        """Give up a connection, unless another source has done so already."""
        async with self._connecting:
            if self._client is client:
                self._client = None
                try:
                    await client.__aexit__(None, None, None)
                except aiomqtt.MqttError:
                    return  # it is lost, which is why it is given up
