"""Fences after the fact: the call, and the state of its stream. No I/O."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dynhull_proto.v1 import fence_service_pb2 as pb
from dynhull_surface.settings import FenceSettings

from ._fence_messages import FenceEvent, decode_fence_event
from ._fences import encode_fence
from ._past import encode_moment
from ._place import Place
from ._settings import SPAN, documenting_settings

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import timedelta

    from dynhull_surface.settings import Boundary, Initial

    from ._areas import Prefix
    from ._errors import DynhullError
    from ._past import When


@dataclass(frozen=True, slots=True)
class ReadingBetween:
    """The events of a fence after the fact to read."""

    request: pb.FenceEventsBetweenRequest
    timeout: float | None


@documenting_settings(FenceSettings, SPAN)
def fence_events_between(  # noqa: D417  # the settings have their descriptions
    area: Any,
    subjects: str | Prefix | None = None,
    start: When | None = None,
    end: When | None = None,
    *,
    other_hull: str | None = None,
    boundary: Boundary = "closed",
    margin: float = 0.0,
    initial: Initial = "snapshot",
    crosses: bool = False,
    dwell: float | timedelta | str | None = None,
    confirmations: int = 0,
    min_dwell: float | timedelta | str | None = None,
    by_accuracy: bool = False,
    expected: Any = None,
    expected_by: str | None = None,
    expected_within: float | timedelta | str | None = None,
    near: float = 0.0,
    without_self: bool = False,
    layer: int = 1,
    max_events: int = 0,
    max_event_age: float | timedelta | str | None = None,
    timeout: float | None = None,
) -> ReadingBetween:
    """The events that a fence with these settings would have made between two moments. None is created.

    >>> yard = [[0, 0], [4, 0], [4, 3]]
    >>> for event in client.fence_events_between(yard, "vehicles", start="2026-11-23T00:00Z"):  # doctest: +SKIP
    ...     print(event.time, event.type, event.key)

    The events of `watch_fence`, in order and with sequences from 1; they have neither `fence` nor `uid`. Their `time`
    is that of the commit of the batch; of what time has made, as "dwell", that at which it was due. With tokens it
    needs the permission "past" for the hulls that it names.

    RevisionForgottenError if the server does not keep a part of that past, or it has not come.

    Args:
        area: as for `create_fence`; a hull is the area as it was at each moment.
        subjects: the keyed hull whose keys are compared, or a `Prefix` of those that there are; then start and end are
            times,
        start: where the fence begins, with what it says about subjects that are inside then: a revision of the hull of
            the subjects; or a time, a datetime with a time zone or such a text of ISO 8601, which stands for the last
            revision committed at or before it. None for the oldest one that the server keeps.
        end: the last revision, or the last time, that counts; None for all that is committed.
        other_hull: or a hull that is compared as a whole, with an area that is a hull.
        expected: keys that should be inside by `expected_by` or `expected_within`, as for `put`; None for none.
        SETTINGS
        timeout: seconds after which the stream ends with DeadlineError; None for never.
    """
    request = pb.FenceEventsBetweenRequest(config=encode_fence(locals()))
    encode_moment(request, "start", start, "start")
    encode_moment(request, "end", end, "end")
    return ReadingBetween(request, timeout)


class BetweenPlace(Place[FenceEvent]):
    """What a stream of events of a fence after the fact has received. A lost connection ends it."""

    method = "FenceEventsBetween"
    request: pb.FenceEventsBetweenRequest

    def __init__(self, reading: ReadingBetween, retries: int) -> None:
        super().__init__(reading.timeout, False, retries)
        self.request = reading.request

    @property
    def subject(self) -> str:
        """What is read, for people."""
        config = self.request.config
        return f"a fence over {config.subject_hull or config.subject_prefix or config.other_hull!r}"

    def take(self, message: pb.FenceEventsBetweenResponse) -> Sequence[FenceEvent]:
        """The events of a message."""
        self._connected()
        return [decode_fence_event(event, "", "", 0, None) for event in message.events]

    def end(self, error: DynhullError) -> Sequence[FenceEvent]:
        """Prepare another connection, if nothing has come so far; raises the error otherwise."""
        self.lost = error
        self._continue_later(error)
        return ()

    def _report_connection(self) -> None:
        """Its first response says so."""
