"""The state of a watch between events and connections. No I/O: `Watch` and `AsyncWatch` do that."""

import logging
from collections.abc import Iterator
from time import monotonic

import grpc
from google.protobuf.unknown_fields import UnknownFieldSet

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Watching
from ._errors import DynhullError, HullNotFoundError, HullReplacedError, RevisionForgottenError
from ._messages import Deleted, Event, Progress, Snapshot, decode_event
from ._retry import LONGEST_PAUSE, LONGEST_PAUSE_FOR_A_HULL, pauses, seconds_until

log = logging.getLogger("dynhull_client")


class Place:
    """What a watch has received, and what it requests next.

    Attributes:
        lost: why there is no connection, or no hull; None while events can arrive.
        request: the request that begins the next connection.
        pause: seconds until then.
    """

    def __init__(self, watching: Watching) -> None:
        self.lost: DynhullError | None = None
        self.request = pb.WatchRequest()
        self.request.CopyFrom(watching.request)
        self.pause = 0.0
        self._deadline = None if watching.timeout is None else monotonic() + watching.timeout
        self._watching = watching
        self._begun = False
        self._revision = -1
        self._unknown: set[int] = set()
        self._pauses = self._new_pauses()

    def timeout(self) -> float | None:
        """Seconds left for the watch."""
        return seconds_until(self._deadline)

    def take(self, message: pb.WatchResponse) -> Event | None:
        """The event to return for a message; None for one that the caller did not request or cannot know."""
        if self.lost is not None or not self._begun:
            self.lost, self._begun, self._pauses = None, True, self._new_pauses()
        event = decode_event(message, keys=self.request.include_keys)
        if event is None:
            self._note(message)
            return None
        if isinstance(event, Snapshot):
            self.request.resume.uid = event.uid
        if self.request.HasField("resume"):  # without one, each event is a whole sketch
            self.request.resume.revision = event.revision
        if self._watching.copy is not None:
            self._watching.copy.update(event)
        news = event.revision > self._revision or self._watching.request.HasField("progress_interval")
        self._revision = event.revision
        return event if news or not isinstance(event, Progress) else None

    def end(self, error: DynhullError) -> Deleted | None:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        self.lost = error
        if self._watching.follow and isinstance(error, HullNotFoundError | HullReplacedError):
            self.pause = next(self._pauses) if isinstance(error, HullNotFoundError) else 0.0
            return self._forget()
        if self._watching.reconnect and isinstance(error, RevisionForgottenError):
            self.request.ClearField("resume")
            self.pause = 0.0
            return None
        if not (self._watching.reconnect and self._begun and error.code == grpc.StatusCode.UNAVAILABLE):
            raise error from None
        if not self.request.HasField("progress_interval"):  # reports the new connection even if nothing changes
            self.request.progress_interval.seconds = 1
        self.pause = next(self._pauses)
        return None

    def _forget(self) -> Deleted | None:
        """Expect another hull; the event is for a hull that the caller has seen."""
        resumed = self.request.resume.revision if self.request.HasField("resume") else -1
        last = max(self._revision, resumed)
        self._begun, self._revision = True, -1
        if last < 0:
            return None
        self.request.ClearField("resume")
        self.request.min_revision = 0
        deleted = Deleted(last)
        if self._watching.copy is not None:
            self._watching.copy.update(deleted)
        return deleted

    def _new_pauses(self) -> Iterator[float]:
        return pauses(LONGEST_PAUSE_FOR_A_HULL if self._watching.follow else LONGEST_PAUSE)

    def _note(self, message: pb.WatchResponse) -> None:
        """Log each kind of event that this version does not know once."""
        fields = UnknownFieldSet(message)
        kinds = {fields[i].field_number for i in range(len(fields))} - self._unknown
        if kinds:
            self._unknown |= kinds
            log.warning(
                "the watch of hull %r skips a kind of event that this version of dynhull does not know (field %s)",
                self.request.name,
                ", ".join(map(str, sorted(kinds))),
            )
