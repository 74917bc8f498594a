"""The state of a watch of an alarm between events and connections. No I/O."""

from collections.abc import Sequence

from dynhull_proto.v1 import alarm_service_pb2 as pb

from ._alarm_messages import AlarmEvent, decode_alarm_event
from ._alarms import WatchingAlarm
from ._errors import AlarmNotFoundError, DynhullError
from ._place import Place


class AlarmPlace(Place[AlarmEvent]):
    """What a watch of an alarm has received, and what it requests next."""

    method = "WatchAlarm"
    request: pb.WatchAlarmRequest

    def __init__(self, watching: WatchingAlarm, retries: int) -> None:
        super().__init__(watching.timeout, watching.reconnect, retries)
        self.request = pb.WatchAlarmRequest()
        self.request.CopyFrom(watching.request)
        self._reports_progress = watching.request.HasField("progress_interval")
        self._closed = False

    def take(self, message: pb.WatchAlarmResponse) -> Sequence[AlarmEvent]:
        """The events of a message. The next connection continues after them, with or without a consumer."""
        self._connected()
        name = self.request.name
        self.request.uid = message.uid or self.request.uid
        uid = self.request.uid
        events = []
        if message.HasField("lost"):
            first, last = message.lost.first_sequence, message.lost.last_sequence
            events.append(AlarmEvent("lost", last, name, uid, first=first, last=last))
        events += [decode_alarm_event(event, name, uid) for event in message.events]
        self.request.after_sequence = message.sequence
        self._closed = any(event.type == "closed" for event in events)
        if not events and self._reports_progress:
            events.append(AlarmEvent("progress", message.sequence, name, uid))
        return events

    def end(self, error: DynhullError) -> Sequence[AlarmEvent]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        if self._closed and isinstance(error, AlarmNotFoundError):
            self.ended = True
        else:
            self.lost = error
            self._continue_later(error)
        return ()
