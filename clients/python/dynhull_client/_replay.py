"""Playing the past of a hull."""

from __future__ import annotations

from time import monotonic
from typing import TYPE_CHECKING

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._arguments import positive
from ._calls import Watching, encode_layer, encode_progress, encoded
from ._hull_place import HullPlace
from ._past import encode_moment
from ._times import encode_duration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import timedelta

    import numpy.typing as npt

    from ._errors import DynhullError
    from ._hull_copy import HullCopy
    from ._messages import Event
    from ._past import When

MICROSECONDS = 1_000_000


def replay(
    name: str,
    start: When | None = None,
    end: When | None = None,
    *,
    speed: float = 0.0,
    every: float | timedelta | str | None = None,
    max_rate: float = 0.0,
    progress_interval: float | None = None,
    measures: bool = False,
    copy: HullCopy | None = None,
    directions: npt.ArrayLike | None = None,
    keys: bool = False,
    outline: bool = False,
    layer: int = 1,
    max_vertices: int | None = None,
    reconnect: bool = True,
    timeout: float | None = None,
) -> Watching:
    """Play the past of a hull: an iterator of the events that a watch of it would have had, which ends.

    >>> from dynhull_client import HullClient, HullCopy
    >>> client, copy = HullClient(), HullCopy()  # doctest: +SKIP
    >>> for event in client.replay("fleet", "2026-11-24T06:00Z", "2026-11-24T18:00Z", speed=3600, copy=copy):
    ...     print(event.changed, copy.area)  # doctest: +SKIP

    The first event is a Snapshot of the hull at `start`; `changed` of an event is when its revision was committed.
    After a lost connection it goes on after the last event.

    Raises:
        RevisionForgottenError: the server does not keep these revisions any more, or drops them before they are played.

    Args:
        name: the hull.
        start: a revision, or a time as for `at`: the last revision committed at or before it. None for the oldest
            revision that can be read.
        end: the same for the last event; None for the newest revision when it begins.
        speed: how many seconds of the past go by in one. Changes are then combined for a program that reads slowly. 0:
            as fast as they are read, and each revision is an event.
        every: the least number of seconds of the past between events, each with all changes since the one before; a
            timedelta is taken, too.
        max_rate: the most events a second; 0 for no limit.
        progress_interval: seconds without an event after which a Progress is sent; None for never or, with a copy that
            has a `max_staleness`, for a third of it.
        measures: whether events include measures.
        copy: a copy that the replay itself updates before it returns an event.
        directions: as for `watch`.
        keys: whether events name the vertices, in a keyed hull.
        outline: whether there are events only when the vertices change.
        layer: the convex layer to follow, as for `locate`.
        max_vertices: as for `watch`.
        reconnect: whether it goes on after a lost connection, however long that takes. Without it, UnavailableError
            ends it. Until the first event it is tried again as other reads are, in both cases.
        timeout: seconds after which it ends with DeadlineError; None for never.
    """
    request = pb.ReplayRequest(
        name=name,
        speed=speed,
        max_events_per_second=max_rate,
        include_measures=measures,
        include_keys=keys,
        outline_only=outline,
        layer=encode_layer(layer),
        max_vertices=positive("max_vertices", max_vertices),
    )
    encode_moment(request, "start", start, "start")
    encode_moment(request, "end", end, "end")
    if every is not None:
        request.every.CopyFrom(encode_duration(every, "every"))
    if directions is not None:
        request.directions.CopyFrom(encoded(directions, "directions"))
    encode_progress(request, progress_interval, copy)
    return Watching(request, copy, False, reconnect, timeout)


class ReplayPlace(HullPlace):
    """What a replay has received, and what it requests next."""

    method = "Replay"

    def __init__(self, watching: Watching, retries: int) -> None:
        super().__init__(watching, retries)
        self._origin: tuple[int, float] | None = None  # a time of the past, and when it was, by our clock

    def take(self, message: pb.ReplayResponse) -> Sequence[Event]:
        """The event of a message."""
        event, request = message.event, self.request
        if self._origin is None and event.HasField("changed_time"):
            begun = request.start_time if request.HasField("start_time") else event.changed_time
            self._origin = begun.ToMicroseconds(), monotonic()
        events = super().take(event)
        request.resume.uid, request.resume.revision = self._uid, event.revision
        return events

    def end(self, error: DynhullError) -> Sequence[Event]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        self.lost = error
        if error.reason == "STORAGE_FAILED":  # keys were erased meanwhile, or an object store is away: it begins anew
            raise error from None
        self._continue_later(error)
        if self._origin is not None and self.request.speed:
            time, begun = self._origin
            passed = round((monotonic() - begun) * self.request.speed * MICROSECONDS)
            self.request.start_time.FromMicroseconds(time + passed)
            self._origin = None
        return ()
