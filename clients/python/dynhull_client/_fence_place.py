"""The state of a watch of a fence between events and connections. No I/O."""

from collections.abc import Sequence

from dynhull_proto.v1 import fence_service_pb2 as pb

from ._errors import DynhullError, FenceNotFoundError
from ._fence_messages import FenceEvent, decode_fence_event
from ._fences import WatchingFence
from ._place import Place


class FencePlace(Place[FenceEvent]):
    """What a watch of a fence has received, and what it requests next."""

    method = "WatchFence"
    request: pb.WatchFenceRequest

    def __init__(self, watching: WatchingFence, retries: int) -> None:
        super().__init__(watching.timeout, watching.reconnect, retries)
        self.request = pb.WatchFenceRequest()
        self.request.CopyFrom(watching.request)
        self._reports_progress = watching.request.HasField("progress_interval")
        self._conflated = 0  # events that were left out since the last one
        self._closed = False

    def take(self, message: pb.WatchFenceResponse) -> Sequence[FenceEvent]:
        """The events of a message. The next connection continues after them, with or without a consumer."""
        self._connected()
        name = self.request.name
        self.request.uid = message.uid or self.request.uid
        uid = self.request.uid
        events = []
        if message.HasField("lost"):
            first, last = message.lost.first_sequence, message.lost.last_sequence
            events.append(FenceEvent("lost", last, name, uid, first=first, last=last, after=last))
        self._conflated += message.conflated
        for i, event in enumerate(message.events, start=1):
            conflated, after = 0, None if message.conflated else event.sequence
            if i == len(message.events):
                conflated, after = self._conflated, message.sequence
            events.append(decode_fence_event(event, name, uid, conflated, after))
        if message.events:
            self._conflated = 0
        self.request.after_sequence = message.sequence
        self._closed = any(event.type == "closed" for event in events)
        if not events and self._reports_progress:
            events.append(FenceEvent("progress", message.sequence, name, uid, after=message.sequence))
        return events

    def end(self, error: DynhullError) -> Sequence[FenceEvent]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        if self._closed and isinstance(error, FenceNotFoundError):
            self.ended = True
        else:
            self.lost = error
            self._continue_later(error)
        return ()
