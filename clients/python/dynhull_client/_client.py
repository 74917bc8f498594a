"""The synchronous client."""

from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Concatenate, ParamSpec, Self, TypeVar

from . import _alarms as alarms
from . import _calls as calls
from . import _feed as feeds
from . import _feed_consumers as readers
from . import _fences as fences
from . import _fences_between as between
from . import _history as past
from . import _layers as peeling
from . import _many as many
from . import _past as earlier
from . import _quarantine as quarantine
from . import _replay as playing
from . import _series as kept
from . import _tracks as ways
from . import _uses as uses
from ._calls import Call, Pages
from ._connection import BlockingConnection
from ._ingest import Ingest
from ._messages import HullInfo
from ._methods import Client, answer_of, described, documented, opening
from ._pipeline import Pipeline
from ._sync_past import Past
from ._watch import AlarmWatch, Feed, FenceEvents, FenceWatch, ManyWatch, Replay, Watch
from ._writer import Writer

P = ParamSpec("P")
Result = TypeVar("Result")


def _answering(describe: Callable[P, Call[Result]]) -> Callable[Concatenate["HullClient", P], Result]:
    """The method that makes a call and returns its answer."""

    def method(self: "HullClient", /, *arguments: P.args, **options: P.kwargs) -> Result:
        return self._connection.answer(described(describe, *arguments, **options))

    documented(method, describe, answer_of(describe))
    return method


def _reading(describe: Callable[P, Call[Result]]) -> Callable[Concatenate["HullClient", P], Iterator[Result]]:
    """The method that makes a call and returns its answer part by part."""

    def method(self: "HullClient", /, *arguments: P.args, **options: P.kwargs) -> Iterator[Result]:
        return self._connection.parts(described(describe, *arguments, **options))

    documented(method, describe, f"Iterator[{answer_of(describe)}]")
    return method


def _listing(describe: Callable[P, Pages[Result]]) -> Callable[Concatenate["HullClient", P], Iterator[Result]]:
    """The method that returns a list, one after the other."""

    def method(self: "HullClient", /, *arguments: P.args, **options: P.kwargs) -> Iterator[Result]:
        page, token = described(describe, *arguments, **options), ""
        while True:
            found, token = self._connection.answer(page(token))
            yield from found
            if not token:
                return

    documented(method, describe, f"Iterator[{answer_of(describe)}]")
    return method


def _past(describe: Callable[P, Call[HullInfo]]) -> Callable[Concatenate["HullClient", P], Past]:
    """The method that finds a hull as it was."""

    def method(self: "HullClient", /, *arguments: P.args, **options: P.kwargs) -> Past:
        info = self._connection.answer(described(describe, *arguments, **options))
        return Past(self._connection, info)

    documented(method, describe, "Past")
    return method


class HullClient(Client[BlockingConnection]):
    """A client of a dynhull server. Threads may share it. A context manager, which closes it.

    Every method raises a `DynhullError` if it fails: `UnavailableError` if no server answers, `DeadlineError` after the
    timeout, `HullNotFoundError` if there is no such hull, `InvalidRequestError` if the server refuses a value. Arrays
    that are not finite points raise ValueError or TypeError, as in `dynhull`, and nothing is sent.

    Args:
        address: HOST or HOST:PORT; the port is 50051 unless given. https://HOST asks for TLS.
        timeout: seconds a call may take unless the call has its own timeout; None for no limit. Ingests, writers and
            watches have no limit by default.
        wait_for_ready: whether calls wait, within their timeout, for a server that is not there yet.
        token: the bearer token to send; only over an encrypted connection or to this machine.
        tls: how to encrypt; None for no encryption. `grpc.ssl_channel_credentials()` trusts the certificate authorities
            of this machine; it also takes a root certificate, and a client's key and certificate.
        retries: how often a call that reached no server is repeated, after a growing pause. Only calls that are safe to
            repeat are: reads, batches with a producer and a sequence number, and calls that have certainly not begun,
            as a server says that starts or stops.
        ping_interval: seconds between questions whether the server is still there, on connections without calls, too.
            One without an answer for as long again is lost, though nobody has closed it: calls on it end, and watches
            go on by a new one. Servers permit one each five seconds by default (`--min-ping-interval`).
        read_ahead: bytes that a stream may receive before the program asks for them; None for as many as keep a distant
            server busy, which may be some megabytes. For programs with many streams that are read slowly.
    """

    _connect = BlockingConnection

    create_hull = _answering(calls.create_hull)
    recenter = _answering(calls.recenter)
    reshard = _answering(calls.reshard)
    set_history = _answering(past.set_history)
    history = _answering(past.history)
    erase_history = _answering(past.erase_history)
    wait_for_hull = _answering(calls.wait_for_hull)
    delete_hull = _answering(calls.delete_hull)
    apply = _answering(calls.apply)
    put = _answering(calls.put)
    remove = _answering(calls.remove)
    release = _answering(quarantine.release)
    drop = _answering(quarantine.drop)
    set_quarantine = _answering(quarantine.set_quarantine)
    transfer = _answering(calls.transfer)
    last_sequence = _answering(calls.last_sequence)
    locate = _answering(calls.locate)
    count = _answering(calls.count)
    positions = _answering(calls.positions)
    entities = _answering(calls.entities)
    read_points = _reading(calls.read_points)
    support = _answering(calls.support)
    tangents = _answering(calls.tangents)
    distance = _answering(calls.distance)
    intersect_lines = _answering(calls.intersect_lines)
    get_hull = _answering(calls.get_hull)
    sample_points = _answering(calls.sample_points)
    verify = _answering(calls.verify)
    layers = _answering(peeling.layers)
    influence = _answering(peeling.influence)
    get_measures = _answering(uses.get_measures)
    series = _answering(kept.series)
    track = _answering(ways.track)
    at = _past(earlier.at)
    separate = _answering(uses.separate)
    phase_diagram = _answering(uses.phase_diagram)
    frontier = _answering(uses.frontier)
    create_fence = _answering(fences.create_fence)
    replace_fence = _answering(fences.replace_fence)
    delete_fence = _answering(fences.delete_fence)
    get_fence = _answering(fences.get_fence)
    fence_inside = _answering(fences.fence_inside)
    ack_fence = _answering(fences.ack_fence)
    delete_consumer = _answering(fences.delete_consumer)
    ack_feed = _answering(readers.ack_feed)
    delete_feed_consumer = _answering(readers.delete_feed_consumer)
    create_alarm = _answering(alarms.create_alarm)
    delete_alarm = _answering(alarms.delete_alarm)
    get_alarm = _answering(alarms.get_alarm)
    acknowledge_alarm = _answering(alarms.acknowledge_alarm)
    mute_alarm = _answering(alarms.mute_alarm)
    ack_alarm = _answering(alarms.ack_alarm)
    delete_alarm_consumer = _answering(alarms.delete_alarm_consumer)
    list_hulls = _listing(calls.list_hulls)
    list_held = _listing(quarantine.list_held)
    list_fences = _listing(fences.list_fences)
    list_alarms = _listing(alarms.list_alarms)
    list_feed_consumers = _listing(readers.list_feed_consumers)
    ingest = opening(Ingest, calls.ingest)
    pipeline = opening(Pipeline, calls.pipeline)
    watch = opening(Watch, calls.watch)
    replay = opening(Replay, playing.replay)
    watch_many = opening(ManyWatch, many.watch_many)
    feed = opening(Feed, feeds.feed)
    watch_fence = opening(FenceWatch, fences.watch_fence)
    fence_events_between = opening(FenceEvents, between.fence_events_between)
    watch_alarm = opening(AlarmWatch, alarms.watch_alarm)
    writer = opening(Writer, calls.writer)

    def close(self) -> None:
        """Close the connection and end the calls on it."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
