"""What the page says, and advises, where a hull, a fence or the server cannot be shown."""

from collections.abc import Iterable

from dynhull_client import (
    DynhullError,
    FenceNotFoundError,
    HullNotFoundError,
    InvalidRequestError,
    PermissionDeniedError,
    UnauthenticatedError,
)

from .feed import HullFeed
from .fence_feed import FenceFeed
from .many_feed import ManyFeed
from .past_play import PastHull
from .server_lists import FenceList, HullList
from .server_metrics import ServerMetrics

UNKNOWN_FENCE = FenceNotFoundError, InvalidRequestError  # the latter for what cannot be a name
TOO_OLD = "This server has no fences: it is older than they are. Update it with pip install --upgrade dynhull"


def is_unsupported(error: DynhullError) -> bool:
    """Whether the server does not know the call."""
    return error.code.name == "UNIMPLEMENTED"


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
        case _:
            return (
                f"No connection to {address}: {cause}. Check that the server runs (dynhull serve) and that the "
                "dashboard's --address names it. The page shows what it last received, and reconnects by itself."
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


def about_past(hull: PastHull) -> str | None:
    """For the table: why a hull cannot be shown as it was, or not all of it; None where all can be."""
    if hull.waits_for is not None:
        return "Its past begins later"
    match hull.trouble:
        case PermissionDeniedError() as error:
            return f"{error}. Start the dashboard with a --token that may read its past"
        case None if not hull.followed:
            return "Reading the past"
        case None:
            erasure = hull.kept.erased(hull.revision)
            return None if erasure is None else f"Keys were erased from this past on {erasure.time:%Y-%m-%d} (UTC)"
        case error:
            return str(error)


def about_fence(feed: FenceFeed) -> str | None:
    """For the table: why a fence cannot be followed, and what to do; None where it can."""
    match feed.trouble:
        case None:
            return None if feed.fence is not None else "Waiting for the server"
        case FenceNotFoundError() if feed.deleted:
            return "Deleted. Remove it above, or create it again: it appears here by itself"
        case error if isinstance(error, UNKNOWN_FENCE):
            return "No such fence. Check the name, or create the fence: it appears here by itself"
        case PermissionDeniedError() as error:
            return f"{error}. Start the dashboard with a --token that may read this fence"
        case error if is_unsupported(error):
            return TOO_OLD
        case error:
            return str(error)


def about_fences(address: str, fences: FenceList, shown: bool) -> str:
    """Below the tables: why there are no fences to pick, and what to do; empty where there are."""
    if fences.error is not None:
        return f"{TOO_OLD}." if is_unsupported(fences.error) and not shown else ""
    if not fences.listed or fences.by_name or shown:
        return ""
    begin = f" whose names begin with {fences.prefix}" if fences.prefix else ""
    return (
        f"The server has no fences{begin} yet. Make one: dynhull fences create {fences.prefix}NAME --area HULL "
        f"--subjects KEYED_HULL --address {address}"
    )


def _in_place_of(name: str, hull_list: HullList) -> str:
    """What to do where a hull is not there."""
    prefix = name.rstrip("/") + "/"
    if any(each.startswith(prefix) for each in hull_list.by_name):
        return f"Others begin with that name: pick {prefix}* above to see them all."
    return "Check the name, or pick another hull above. One that is made with this name appears here by itself."


def about_picture(
    address: str,
    hull_list: HullList,
    feeds: Iterable[HullFeed],
    fences: Iterable[FenceFeed] = (),
    many: Iterable[ManyFeed] = (),
) -> str:
    """For the picture: why it is empty, and what to do; empty where it is not, or where the banner says it."""
    feeds, fences, many = list(feeds), list(fences), list(many)
    if hull_list.error is not None or not hull_list.listed or any(feed.bounds for feed in feeds) or any(map(len, many)):
        return ""
    if any(fence.area.bounds for fence in fences):
        return ""
    if nothing := [each.prefix for each in many if each.complete]:
        return f"No hull has a name that begins with {nothing[0]} yet. Those that are made appear here by themselves."
    if not feeds and (unknown := [fence.name for fence in fences if isinstance(fence.trouble, UNKNOWN_FENCE)]):
        return f"The server has no fence {unknown[0]}. Check the name, or pick another fence above."
    if empty := [feed.name for feed in feeds if feed.trouble is None and feed.followed]:
        return f"{empty[0]} has no points yet. Add some: dynhull load {empty[0]} FILE.csv --address {address}"
    if missing := [feed.name for feed in feeds if isinstance(feed.trouble, HullNotFoundError | InvalidRequestError)]:
        return f"The server has no hull {missing[0]}. {_in_place_of(missing[0], hull_list)}"
    if feeds or many:
        return ""
    if hull_list.by_name:
        return "Pick a hull above."
    begin = f" whose names begin with {hull_list.prefix}" if hull_list.prefix else ""
    name = f"{hull_list.prefix}NAME"
    return f"The server has no hulls{begin} yet. Make one: dynhull load {name} FILE.csv --address {address}"
