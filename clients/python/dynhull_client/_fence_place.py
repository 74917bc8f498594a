"""The state of a watch of a fence between events and connections. No I/O."""

from dynhull_proto.v1 import fence_service_pb2 as pb

from ._errors import FenceNotFoundError
from ._fence_messages import FenceEvent, decode_fence_event
from ._fences import WatchingFence
from ._numbered_place import NumberedPlace


class FencePlace(NumberedPlace[FenceEvent]):
    """What a watch of a fence has received, and what it requests next."""

    method = "WatchFence"
    gone = FenceNotFoundError
    request: pb.WatchFenceRequest

    def __init__(self, watching: WatchingFence, retries: int) -> None:
        super().__init__(watching, retries)
        self._conflated = 0  # events that were left out since the last one

    def _events(self, message: pb.WatchFenceResponse) -> list[FenceEvent]:
        name, uid = self.request.name, self.request.uid
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
        return events

    def _progress(self, sequence: int) -> FenceEvent:
        return FenceEvent("progress", sequence, self.request.name, self.request.uid, after=sequence)
