"""The state of a watch of a hull between events and connections. No I/O."""

import logging
from collections.abc import Sequence
from typing import Any

from google.protobuf.unknown_fields import UnknownFieldSet

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Watching, resumable
from ._errors import DynhullError, HullNotFoundError, HullReplacedError, RevisionForgottenError
from ._messages import Deleted, Event, Progress, Sketch, Snapshot, decode_event
from ._place import Place
from ._retry import LONGEST_PAUSE, LONGEST_PAUSE_FOR_A_HULL

log = logging.getLogger("dynhull_client")


class HullPlace(Place[Event]):
    """What a watch of a hull has received, and what it requests next."""

    method = "Watch"
    request: Any

    def __init__(self, watching: Watching, retries: int) -> None:
        longest_pause = LONGEST_PAUSE_FOR_A_HULL if watching.follow else LONGEST_PAUSE
        super().__init__(watching.timeout, watching.reconnect, retries, longest_pause)
        self.request = type(watching.request)()
        self.request.CopyFrom(watching.request)
        self._watching = watching
        self._revision = -1
        self._uid = self.request.resume.uid
        self._unknown: set[int] = set()

    def take(self, message: Any) -> Sequence[Event]:
        """The event of a message; none for one that the caller did not request or cannot know."""
        self._connected()
        event = decode_event(message, keys=self.request.include_keys)
        if event is None:
            self._note(message)
            return ()
        deleted = self._identify(event.uid) if isinstance(event, Snapshot | Sketch) else ()
        if isinstance(event, Snapshot) and resumable(self.request):
            self.request.resume.uid = event.uid
        if self.request.HasField("resume"):  # without one, each connection begins with the whole state
            self.request.resume.revision = event.revision
        if self._watching.copy is not None:
            self._watching.copy.update(event)
        news = event.revision > self._revision or self._watching.request.HasField("progress_interval")
        self._revision = event.revision
        return (*deleted, event) if news or not isinstance(event, Progress) else ()

    def end(self, error: DynhullError) -> Sequence[Event]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        self.lost = error
        if self._watching.follow and isinstance(error, HullNotFoundError | HullReplacedError):
            self.pause = next(self._pauses) if isinstance(error, HullNotFoundError) else 0.0
            return self._forget()
        if self._watching.reconnect and isinstance(error, RevisionForgottenError):
            self.request.ClearField("resume")
            self.pause = 0.0
        else:
            self._continue_later(error)
        return ()

    def _identify(self, uid: str) -> Sequence[Event]:
        """Learn which hull this is: the one before was deleted where a watch that does not resume sees another one."""
        before, self._uid = self._uid, uid
        return self._forget() if self._watching.follow and before not in ("", uid) else ()

    def _forget(self) -> Sequence[Event]:
        """Expect another hull; the event is for a hull that the caller has seen."""
        resumed = self.request.resume.revision if self.request.HasField("resume") else -1
        last = max(self._revision, resumed)
        self._begun, self._revision = True, -1
        if last < 0:
            return ()
        self.request.ClearField("resume")
        self.request.min_revision = 0
        deleted = Deleted(last)
        if self._watching.copy is not None:
            self._watching.copy.update(deleted)
        return (deleted,)

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
