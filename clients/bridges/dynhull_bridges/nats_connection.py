"""One connection to NATS, which ends where it breaks: whoever uses it begins again."""

from contextlib import suppress

from nats.aio.client import Client
from nats.errors import Error


async def connected(server: str, timeout: float) -> Client:
    """A connection; OSError, TimeoutError or an Error of NATS if there is none."""
    client = Client()
    try:
        await client.connect(
            server,
            # The first connect would never return otherwise.
            allow_reconnect=False,
            max_reconnect_attempts=1,
            reconnect_time_wait=0,
            connect_timeout=timeout,  # type: ignore[arg-type]  # passed on to asyncio
            error_cb=_quiet,
        )
    except BaseException:
        await closed(client)  # which the client does not do itself if the server refuses it
        raise
    return client


async def closed(client: Client) -> None:
    """Close a connection, even if it is lost."""
    with suppress(Error, OSError, TimeoutError):
        await client.close()


async def _quiet(_: Exception) -> None:
    """What fails reports the error itself."""
