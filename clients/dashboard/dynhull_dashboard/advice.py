"""What the page says, and advises, where a hull or the server cannot be shown."""

from collections.abc import Iterable

from dynhull_client import (
    DynhullError,
    HullNotFoundError,
    InvalidRequestError,
    PermissionDeniedError,
    UnauthenticatedError,
)

from .feed import HullFeed
from .server_metrics import ServerMetrics
from .server_state import ServerState


def about_server(address: str, error: DynhullError) -> str:
    """For the banner: why the server does not answer, and what to do."""
    cause = str(error).rstrip(".")
    match error:
        case UnauthenticatedError():
            return (
                f"{address} refuses the dashboard: {cause}. Start the dashboard with a --token that the server knows."
            )
        case PermissionDeniedError():
            return f"{address} refuses the dashboard: {cause}. Start the dashboard with a --token that may read."
    return (
        f"No connection to {address}: {cause}. Check that the server runs (dynhull serve) and that the dashboard's "
        "--address names it. The page shows what it last received, and reconnects by itself."
    )


def about_metrics(metrics: ServerMetrics | None) -> str:
    """For the banner: why the time lines of the whole server are empty, and what to do; empty where they are not."""
    if metrics is None or metrics.error is None:
        return ""
    return (
        f"No metrics from {metrics.url}: {metrics.error}. Check that the server runs with --metrics-port, and that the "
        "dashboard's --metrics has that port."
    )


def about_hull(feed: HullFeed) -> str | None:
    """For the table: why a hull cannot be followed, and what to do; None where it can."""
    match feed.trouble:
        case None:
            return None if feed.followed else "Waiting for the first event"
        case HullNotFoundError():
            return "No such hull. Check the name, or create the hull: it appears here by itself"
        case PermissionDeniedError() as error:
            return f"{error}. Start the dashboard with a --token that may read this hull"
        case error:
            return str(error)


def about_picture(address: str, server: ServerState, feeds: Iterable[HullFeed]) -> str:
    """For the picture: why it is empty, and what to do; empty where it is not, or where the banner says it."""
    feeds = list(feeds)
    if server.error is not None or not server.listed or any(feed.bounds for feed in feeds):
        return ""
    if empty := [feed.name for feed in feeds if feed.trouble is None and feed.followed]:
        return f"{empty[0]} has no points yet. Add some: dynhull load {empty[0]} FILE.csv --address {address}"
    if missing := [feed.name for feed in feeds if isinstance(feed.trouble, HullNotFoundError | InvalidRequestError)]:
        return f"The server has no hull {missing[0]}. Check the name, or pick another hull above."
    if feeds:
        return ""
    if server.hulls:
        return "Pick a hull above."
    begin = f" whose names begin with {server.prefix}" if server.prefix else ""
    name = f"{server.prefix}NAME"
    return f"The server has no hulls{begin} yet. Make one: dynhull load {name} FILE.csv --address {address}"
