"""Where a watch stands. No I/O: `Watch` and `AsyncWatch` do that."""

from dynhull_proto.v1 import hull_service_pb2 as pb

from .calls import Watching
from .errors import DynhullError, RevisionForgottenError, UnavailableError
from .messages import Event, Progress, Snapshot, decode_event
from .retry import Attempts, pauses


class Place:
    """What a watch has received, and what it asks for next.

    Attributes:
        lost: what the connection was lost with; None while there is one.
    """

    def __init__(self, watching: Watching) -> None:
        self.lost: DynhullError | None = None
        self.request = pb.WatchRequest()
        self.request.CopyFrom(watching.request)
        self.timeout = Attempts(watching.timeout, retries=0).timeout
        self._watching = watching
        self._begun = False
        self._revision = -1
        self._pauses = pauses()

    def take(self, message: pb.WatchResponse) -> Event | None:
        """The event received, from which the watch can go on; None where it is not one that the watcher asked for."""
        event = decode_event(message)
        if isinstance(event, Snapshot):
            self.request.resume.uid = event.uid
        if self.request.HasField("resume"):  # a sketch is sent whole each time
            self.request.resume.revision = event.revision
        if self._watching.copy is not None:
            self._watching.copy.update(event)
        if self.lost is not None or not self._begun:
            self.lost, self._begun, self._pauses = None, True, pauses()
        news = event.revision > self._revision or self._watching.request.HasField("progress_interval")
        self._revision = event.revision
        return event if news or not isinstance(event, Progress) else None

    def pause_after(self, error: DynhullError) -> float:
        """Seconds until the next connection; raises the error where there is none."""
        self.lost = error
        if self._watching.reconnect and isinstance(error, RevisionForgottenError):
            self.request.ClearField("resume")
            return 0.0
        if not (self._watching.reconnect and self._begun and isinstance(error, UnavailableError)):
            raise error from None
        if not self.request.HasField("progress_interval"):  # to know of the new connection even if nothing changes
            self.request.progress_interval.seconds = 1
        return next(self._pauses)
