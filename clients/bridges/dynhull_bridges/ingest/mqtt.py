"""A subscription of MQTT: the broker resends a message until the server has its rows."""

import asyncio
import hashlib
import socket
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Any
from urllib.parse import unquote, urlsplit

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from ..refusals.mqtt import MQTT
from ..refusals.table import Meaning
from ..urls import options_of, without_secrets
from .feed import PING_INTERVAL, Beginning, FeedError, Message, feed_error, refusal
from .topics import captures_of

PORT, TLS_PORT = 1883, 8883
AT_LEAST_ONCE = 1
WAIT = 1.0  # seconds that a read waits for messages
GATHER = 0.003  # seconds that the first message of a read waits for others: brokers send one at a time
TIMEOUT = 10.0  # seconds for a connection
MOST = 4096  # messages of one read
WAITING = 65_536  # messages that may wait to be read: with QoS 1 the broker sends no more
KEPT = 7 * 24 * 3600  # seconds for which the broker keeps a session of MQTT 5
VERSIONS = {"3": MQTTProtocolVersion.MQTTv311, "3.1.1": MQTTProtocolVersion.MQTTv311, "5": MQTTProtocolVersion.MQTTv5}
SHARED = "$share/"
LONGEST_FILTER, LONGEST_SHOWN = 65_535, 200  # bytes, characters


class MqttSource:
    """Reads mqtt://[USER:PASSWORD@]HOST[:PORT]/FILTER[?version=3.1.1&client_id=NAME], or mqtts:// for TLS.

    The filter may have wildcards, and begin with $share/GROUP/ to share its messages with other subscribers. The broker
    keeps the session of the client id while nobody is connected.
    """

    def __init__(self, url: str, hull: str, ping_interval: float = PING_INTERVAL) -> None:
        self._keepalive = max(1, round(ping_interval))  # MQTT counts seconds
        parts = urlsplit(url, allow_fragments=False)
        # A filter may have +, # and $, which need no escapes here.
        query = options_of(url, ("version", "client_id"))
        self._filter = unquote(parts.path.removeprefix("/"))
        if not parts.hostname or not self._filter:
            raise ValueError(f"{without_secrets(url)}: give mqtt://HOST/FILTER")
        version = query.get("version", ["5"])[0]
        if version not in VERSIONS:
            raise ValueError(f"{without_secrets(url)}: version is {version!r}, not 3.1.1 or 5")
        encrypted = parts.scheme == "mqtts"
        self.name = without_secrets(url)
        self.producer: str | None = None
        self._host, self._port = parts.hostname, parts.port or (TLS_PORT if encrypted else PORT)
        plain = _checked(self._filter)
        self._captures = captures_of(plain, "/", "+", "#")
        digest = hashlib.sha256(f"{self._filter} {hull}".encode()).hexdigest()[:12]
        name = query.get("client_id", [f"dynhull-{socket.gethostname()}-{digest}"])[0]
        self._version = VERSIONS[version]
        five = self._version == MQTTProtocolVersion.MQTTv5
        self._client = Client(
            CallbackAPIVersion.VERSION2,
            name,
            clean_session=None if five else False,
            protocol=self._version,
            manual_ack=True,
            reconnect_on_failure=False,  # the feed begins again itself
        )
        if parts.username:
            self._client.username_pw_set(unquote(parts.username), unquote(parts.password or ""))
        if encrypted:
            self._client.tls_set()
        self._client.on_connect = self._connected
        self._client.on_subscribe = self._subscribed
        self._client.on_disconnect = self._disconnected
        self._client.on_message = self._arrive
        self._connections = 0  # an acknowledgement is for the connection that its message came on
        self._ready: asyncio.Future[None]
        self._loop: asyncio.AbstractEventLoop
        self._lock = threading.Condition()
        self._arrived: deque[tuple[int, MQTTMessage]] = deque()
        self._news = asyncio.Event()
        self._lost: str | None = None
        self._closed = False

    async def begin(self, known: int | None) -> Beginning:  # noqa: ARG002  # a subscription has no numbers
        """Connect; see `Feed.begin`."""
        self._loop = asyncio.get_running_loop()
        self._ready = self._loop.create_future()
        self._lost, self._closed = None, False
        options: dict[str, Any] = {}
        if self._version == MQTTProtocolVersion.MQTTv5:
            properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
            properties.SessionExpiryInterval = KEPT
            properties.ReceiveMaximum = 65_535
            options = {"clean_start": False, "properties": properties}
        try:
            await asyncio.to_thread(self._client.connect, self._host, self._port, self._keepalive, **options)
            self._client.loop_start()
            async with asyncio.timeout(TIMEOUT):
                await self._ready
        except (OSError, TimeoutError) as error:
            raise feed_error("MQTT", error) from None
        return Beginning(0)

    async def read(self) -> Sequence[Message]:
        """The next messages; see `Feed.read`."""
        if not self._arrived:
            self._news.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(WAIT):
                    await self._news.wait()
        if len(self._arrived) < MOST and self._lost is None:
            await asyncio.sleep(GATHER)
        if self._lost is not None and not self._arrived:
            raise FeedError(f"MQTT: {self._lost}")
        with self._lock:
            found = [self._arrived.popleft() for _ in range(min(len(self._arrived), MOST))]
            self._lock.notify()
        messages = []
        for connection, each in found:
            token = connection << 32 | each.qos << 16 | each.mid
            messages.append(Message(each.topic, self._captures(each.topic), bytes(each.payload) or None, token=token))
        return messages

    async def keep(self, messages: Sequence[Message]) -> None:
        """Acknowledge the messages, unless they came on an earlier connection."""
        for each in messages:
            connection, qos, number = each.token >> 32, each.token >> 16 & 3, each.token & 0xFFFF
            if connection == self._connections and qos:
                self._client.ack(number, qos)

    async def lag(self) -> int | None:
        """None: a subscription has no end."""
        return None

    async def close(self) -> None:
        """Disconnect."""
        with self._lock:
            self._closed = True
            self._arrived.clear()
            self._lock.notify()
        self._client.disconnect()
        await asyncio.to_thread(self._client.loop_stop)

    # These run in the thread of the MQTT client.

    def _connected(self, _client: Client, _data: Any, _flags: Any, reason: ReasonCode, _properties: Any) -> None:
        if reason.is_failure:
            self._tell(refusal(MQTT.meaning(reason.value), f"the broker refuses the connection: {reason}"))
            return
        with self._lock:
            self._connections += 1
            self._arrived.clear()  # what is not acknowledged comes again
        self._client.subscribe(self._filter, AT_LEAST_ONCE)

    def _subscribed(self, _client: Client, _data: Any, _number: int, reasons: list[ReasonCode], _props: Any) -> None:
        if reasons[0].is_failure:
            meaning = MQTT.meaning(reasons[0].value)
            self._tell(refusal(meaning, f"the broker refuses the filter {self._filter!r}: {reasons[0]}"))
        else:
            self._tell(None)

    def _disconnected(self, _client: Client, _data: Any, _flags: Any, reason: ReasonCode, _properties: Any) -> None:
        self._lost = str(reason)
        final = MQTT.meaning(reason.value) is Meaning.FINAL
        self._tell(
            ValueError(f"the broker refuses the connection: {reason}") if final else FeedError(f"MQTT: {reason}")
        )
        self._loop.call_soon_threadsafe(self._news.set)

    def _arrive(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        with self._lock:
            self._lock.wait_for(lambda: len(self._arrived) < WAITING or self._closed)
            self._arrived.append((self._connections, message))
            first = len(self._arrived) == 1
        if first:
            self._loop.call_soon_threadsafe(self._news.set)

    def _tell(self, error: Exception | None) -> None:
        def settle() -> None:
            if not self._ready.done():
                if error is None:
                    self._ready.set_result(None)
                else:
                    self._ready.set_exception(error)

        self._loop.call_soon_threadsafe(settle)


def _checked(whole: str) -> str:
    """The filter without $share/GROUP/; ValueError where MQTT has no such filter."""
    problem, topics = None, whole
    if whole.startswith(SHARED):
        group, _, topics = whole.removeprefix(SHARED).partition("/")
        if not group or not topics or {"+", "#"} & set(group):
            problem = "must be $share/GROUP/FILTER, the group without wildcards"
    levels = topics.split("/")
    if "#" in "".join(levels[:-1]) or levels[-1] not in ("#", levels[-1].replace("#", "")):
        problem = problem or "# must be the last level, alone between slashes"
    elif any("+" in each and each != "+" for each in levels):
        problem = problem or "+ must be a whole level, alone between slashes"
    elif "\0" in whole or len(whole.encode()) > LONGEST_FILTER:
        problem = problem or f"has a zero character, or more than {LONGEST_FILTER} bytes"
    if problem is not None:
        raise ValueError(f"the filter {whole[:LONGEST_SHOWN]!r}: {problem}")
    return topics
