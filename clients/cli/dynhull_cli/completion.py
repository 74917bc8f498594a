"""Names that shell completion offers, asked of the server: at most some, and none where it does not answer at once."""

from itertools import islice
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from dynhull_client import HullClient

MOST_OFFERED = 100
PATIENCE_SECONDS = 1.0


def hulls(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of hulls that begin so."""
    return _asked(ctx, lambda client: client.list_hulls(incomplete, timeout=PATIENCE_SECONDS))


def fences(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of fences that begin so."""
    return _asked(ctx, lambda client: client.list_fences(incomplete, timeout=PATIENCE_SECONDS))


def alarms(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of alarms that begin so."""
    return _asked(ctx, lambda client: client.list_alarms(incomplete, timeout=PATIENCE_SECONDS))


def _asked(ctx: typer.Context, ask: "Callable[[HullClient], Iterable[Any]]") -> list[str]:
    from dynhull_client import DynhullError, HullClient

    from .certificates import credentials

    given = ctx.params
    try:
        encryption = credentials(given["tls"], given["tls_ca"], given["client_cert"], given["client_key"])
        with HullClient(given["address"], token=given["token"], tls=encryption, retries=0) as client:
            return [each.name for each in islice(ask(client), MOST_OFFERED)]
    except (DynhullError, OSError, ValueError, TypeError):
        return []  # a word is being typed: what is wrong says the command once it runs
