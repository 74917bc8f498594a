"""The state of a watch of an alarm between events and connections. No I/O."""

from dynhull_proto.v1 import alarm_service_pb2 as pb

from ._alarm_messages import AlarmEvent, decode_alarm_event
from ._errors import AlarmNotFoundError
from ._numbered_place import NumberedPlace


class AlarmPlace(NumberedPlace[AlarmEvent]):
    """What a watch of an alarm has received, and what it requests next."""

    method = "WatchAlarm"
    gone = AlarmNotFoundError
    request: pb.WatchAlarmRequest

    def _events(self, message: pb.WatchAlarmResponse) -> list[AlarmEvent]:
        name, uid = self.request.name, self.request.uid
        events = []
        if message.HasField("lost"):
            first, last = message.lost.first_sequence, message.lost.last_sequence
            events.append(AlarmEvent("lost", last, name, uid, first=first, last=last))
        return events + [decode_alarm_event(event, name, uid) for event in message.events]

    def _progress(self, sequence: int) -> AlarmEvent:
        return AlarmEvent("progress", sequence, self.request.name, self.request.uid)
