"""Delivery to NATS JetStream: an event counts as delivered when a stream has stored it."""

import asyncio
from collections.abc import Sequence
from urllib.parse import urlsplit

from nats.aio.client import Client
from nats.errors import BadSubjectError, Error, MaxPayloadError
from nats.js.errors import NoStreamResponseError

from .bodies.body import CLOUD_EVENTS, Body
from .letters import Letter
from .nats_connection import closed, connected
from .refusals.nats import NATS, code_of
from .sources import Kind
from .target import NotDeliveredError, RefusedError, filled, not_delivered
from .urls import check_subject, options_of, without_secrets

SUBJECTS: dict[Kind, str] = {"fence": "dynhull.{name}.{type}", "alarm": "dynhull.alarm.{name}.{type}"}


class JetStream:
    """Publishes to the subject in nats://[USER:PASSWORD@]HOST[:PORT][/SUBJECT], or tls:// for TLS.

    {kind}, {name} and {type} in the subject are filled in. The header Nats-Msg-Id has the id of the event, so that the
    stream drops repetitions within its duplicate window. All sources share one connection.
    """

    most = 1

    def __init__(self, url: str, timeout: float, body: Body = CLOUD_EVENTS) -> None:
        parts = urlsplit(url, allow_fragments=False)
        if not parts.hostname:
            raise ValueError(f"--to {without_secrets(url)} has no host")
        self._server = parts._replace(path="").geturl()
        options_of(url)
        self._subject = parts.path.removeprefix("/")
        if self._subject:
            check_subject(self._subject)
        if {"*", ">"} & set(self._subject):
            raise ValueError(f"the subject {self._subject!r} has a wildcard, * or >: events go to one subject")
        self._timeout = timeout
        self._body = body
        self._client: Client | None = None
        self._connecting = asyncio.Lock()

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Publish the letters, each after the one before was stored."""
        client = await self._connected()
        for each in letters:
            subject = self._filled(each)
            headers = {"Nats-Msg-Id": each.id, "Content-Type": self._body.content_type}
            body = self._body.text(each).encode()
            try:
                await client.jetstream(timeout=self._timeout).publish(subject, body, headers=headers)
            except MaxPayloadError:
                raise RefusedError(f"NATS: {len(body)} bytes are too many for the server") from None
            except BadSubjectError:  # the name of the source has empty words
                raise RefusedError(f"NATS: {subject!r} is no subject") from None
            except NoStreamResponseError:
                raise NotDeliveredError(f"NATS: no stream stores the subject {subject}; create one") from None
            except (Error, OSError, TimeoutError) as error:
                refused = not_delivered(NATS.meaning(code_of(error)), f"NATS: {error}")
                if not isinstance(refused, RefusedError):
                    await self._disconnect(client)
                raise refused from None

    def place(self, letter: Letter) -> str:
        """The server and the subject."""
        return f"{without_secrets(self._server)}/{self._filled(letter)}"

    async def close(self) -> None:
        """Disconnect."""
        if self._client is not None:
            await self._disconnect(self._client)

    def _filled(self, letter: Letter) -> str:
        return filled(self._subject or SUBJECTS[letter.source.kind], letter)

    async def _connected(self) -> Client:
        async with self._connecting:
            if self._client is None:
                try:
                    self._client = await connected(self._server, self._timeout)
                except (Error, OSError, TimeoutError) as error:
                    raise NotDeliveredError(f"NATS: {type(error).__name__}: {error}") from None
            return self._client

    async def _disconnect(self, client: Client) -> None:
        """Give up a connection, unless another source has done so already."""
        async with self._connecting:
            if self._client is client:
                self._client = None
                await closed(client)
