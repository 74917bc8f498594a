"""Delivery by HTTP POST, in the form of Standard Webhooks, with CloudEvents as bodies."""

import time
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from ipaddress import ip_address

import aiohttp
import yarl

import dynhull_client

from .addresses import PublicOnly, is_public
from .bodies.body import CLOUD_EVENTS, Body, Header
from .letters import BATCH_CONTENT_TYPE, Letter
from .refusals.http import HTTP
from .signatures import signature
from .target import GoneError, NotDeliveredError, filled, not_delivered
from .urls import without_secrets

LONGEST_ANSWER = 200  # bytes of a refusal that are shown


class Webhook:
    """Delivers to a URL, in which {kind}, {name} and {type} are filled in.

    Args:
        url: http or https.
        keys: the keys to sign with; none for no signature.
        batch: the most events in one request; 1 for single events rather than batches.
        timeout: the seconds that a request may take.
        allow_private: whether private addresses are allowed.
        body: makes the bodies of single events.
        headers: those that are sent besides.

    Raises:
        ValueError: the URL has no host, or names a private address that is not allowed.
    """

    def __init__(
        self,
        url: str,
        keys: Sequence[bytes],
        *,
        batch: int,
        timeout: float,
        allow_private: bool,
        body: Body = CLOUD_EVENTS,
        headers: Sequence[Header] = (),
    ) -> None:
        host = yarl.URL(url).host
        if not host or "{" in host:
            raise ValueError(f"--to {without_secrets(url)} has no host of its own")
        if batch > 1 and "{type}" in url:
            raise ValueError("--to has {type}, but a batch has events of several types: leave out --batch")
        if not allow_private and _is_private(host):
            raise ValueError(f"--to {without_secrets(url)} is a private address: allow it with --allow-private")
        self.most = batch
        self._url = url
        self._keys = keys
        self._body = body
        self._headers = headers
        resolver = None if allow_private else PublicOnly()
        self._session = aiohttp.ClientSession(
            connector=aiohttp.TCPConnector(resolver=resolver),
            timeout=aiohttp.ClientTimeout(total=timeout),
            cookie_jar=aiohttp.DummyCookieJar(),
            headers={"User-Agent": f"dynhull/{dynhull_client.__version__}"},
        )

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Post the letters in one request."""
        first, last = letters[0], letters[-1]
        if self.most == 1:
            identity, content_type, body = first.id, self._body.content_type, self._body.text(first)
        else:
            identity = first.id if first is last else f"{first.id}-{last.sequence}"
            content_type, body = BATCH_CONTENT_TYPE, f"[{','.join(each.text for each in letters)}]"
        now = int(time.time())
        headers = {each.name: each.value(first) for each in self._headers}
        headers |= {"Content-Type": content_type, "webhook-id": identity, "webhook-timestamp": str(now)}
        if self._keys:
            headers["webhook-signature"] = signature(self._keys, identity, now, body)
        try:
            async with self._session.post(
                filled(self._url, first), data=body.encode(), headers=headers, allow_redirects=False
            ) as response:
                if not HTTPStatus.OK <= response.status < HTTPStatus.MULTIPLE_CHOICES:
                    await self._refuse(response)
        except (aiohttp.ClientError, TimeoutError, OSError) as error:
            raise NotDeliveredError(f"{type(error).__name__}: {error}".removesuffix(": ")) from None

    def place(self, letter: Letter) -> str:
        """The URL."""
        return without_secrets(filled(self._url, letter))

    async def close(self) -> None:
        """Close the connections."""
        await self._session.close()

    async def _refuse(self, response: aiohttp.ClientResponse) -> None:
        status = response.status
        answer = b""
        with suppress(aiohttp.ClientError, TimeoutError, OSError):  # the status counts, whatever its explanation is
            answer = await response.content.read(LONGEST_ANSWER)
        message = f"HTTP {status} {response.reason or ''} {answer.decode(errors='replace')!r}"
        if status == HTTPStatus.GONE:
            raise GoneError(message)
        raise not_delivered(HTTP.meaning(status), message, retry_after(response.headers.get("Retry-After")))


def retry_after(text: str | None) -> float | None:
    """The seconds in a header Retry-After, which has a number or a date; None if it has neither."""
    if text is None:
        return None
    if text.strip().isdecimal():
        return float(text)
    try:
        then = parsedate_to_datetime(text)
    except (ValueError, OverflowError):
        return None
    then = then.replace(tzinfo=UTC) if then.tzinfo is None else then
    return max(0.0, (then - datetime.now(UTC)).total_seconds())


def _is_private(host: str) -> bool:
    """Whether a host is an address that is not public; names are resolved when it matters."""
    try:
        ip_address(host.partition("%")[0])
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
    return not is_public(host)
