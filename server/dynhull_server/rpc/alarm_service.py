"""AlarmService, one method per RPC of dynhull.v1. The .proto files document the methods."""

from functools import partial

from dynhull_proto.v1 import alarm_service_pb2 as pb

from ..engine.alarms import Alarms, calling_them_alarms
from ..engine.fences import LiveFence
from ..engine.watch_fence import watch_fence
from . import decode
from .calls import Call
from .decode_alarm import decode_alarm, decode_alarm_name
from .decode_batch import decode_timestamp
from .decode_fence import decode_consumer, decode_start
from .encode_alarm import encode_alarm, encode_sent_alarm, encode_status, rule_of
from .fence_service import acknowledged, first_after, oldest_events, sent_as
from .metrics import Metrics
from .outgoing import Counted, send_each


class AlarmService:
    """The service.

    Args:
        alarms: the alarms.
        metrics: counts the work.
        max_watch_lag: the seconds that a watcher may take to receive a response.
    """

    def __init__(self, alarms: Alarms, metrics: Metrics, *, max_watch_lag: float) -> None:
        self._alarms = alarms
        self._metrics = metrics
        self._max_watch_lag = max_watch_lag

    async def CreateAlarm(self, request: pb.CreateAlarmRequest, call: Call) -> pb.CreateAlarmResponse:
        name = decode_alarm_name(request.name)
        call.access.require_write(name)
        config = decode_alarm(request)
        call.access.require_read(config.subjects)
        if config.area_hull is not None:
            call.access.require_read(config.area_hull)
        alarm = await self._alarms.create(name, config)
        return pb.CreateAlarmResponse(alarm=encode_alarm(alarm, {}))

    async def DeleteAlarm(self, request: pb.DeleteAlarmRequest, call: Call) -> pb.DeleteAlarmResponse:
        name = decode_alarm_name(request.name)
        call.access.require_write(name)
        config = self._alarms.get(name).fence.row.config
        call.access.require_read(config.subjects)
        if config.area_hull is not None:
            call.access.require_read(config.area_hull)
        await self._alarms.delete(name)
        return pb.DeleteAlarmResponse()

    async def GetAlarm(self, request: pb.GetAlarmRequest, call: Call) -> pb.GetAlarmResponse:
        alarm = self._read(call, request.name)
        statuses = await self._alarms.statuses(alarm)
        return pb.GetAlarmResponse(
            alarm=encode_alarm(alarm, await oldest_events(alarm)), statuses=map(encode_status, statuses)
        )

    async def ListAlarms(self, request: pb.ListAlarmsRequest, call: Call) -> pb.ListAlarmsResponse:
        prefix, after, size = decode.decode_page(request)
        alarms, more = self._alarms.page(call.access.readable(prefix), after, size)
        messages = [encode_alarm(alarm, await oldest_events(alarm)) for alarm in alarms]
        return pb.ListAlarmsResponse(alarms=messages, next_page_token=messages[-1].name if more else "")

    async def WatchAlarm(self, request: pb.WatchAlarmRequest, call: Call) -> None:
        alarm = self._read(call, request.name)
        start = decode_start(request)
        progress = decode.decode_interval(request)
        with calling_them_alarms():
            after = await first_after(alarm, request.uid, start, call)
        responses = watch_fence(alarm, after, progress_interval=progress)
        encoded = sent_as(partial(encode_sent_alarm, rule=rule_of(alarm)), alarm.uid)
        await send_each(call, responses, encoded, self._max_watch_lag, Counted(self._metrics, "alarm"))

    async def AckAlarm(self, request: pb.AckAlarmRequest, call: Call) -> pb.AckAlarmResponse:
        alarm = self._read(call, request.name)
        with calling_them_alarms():
            return pb.AckAlarmResponse(consumer=await acknowledged(alarm, request))

    async def DeleteAlarmConsumer(
        self, request: pb.DeleteAlarmConsumerRequest, call: Call
    ) -> pb.DeleteAlarmConsumerResponse:
        alarm = self._read(call, request.name)
        with calling_them_alarms():
            await alarm.drop_consumer(decode_consumer(request.consumer))
        return pb.DeleteAlarmConsumerResponse()

    async def AcknowledgeAlarm(self, request: pb.AcknowledgeAlarmRequest, call: Call) -> pb.AcknowledgeAlarmResponse:
        name, hull = self._written(call, request)
        return pb.AcknowledgeAlarmResponse(status=encode_status(await self._alarms.acknowledge(name, hull)))

    async def MuteAlarm(self, request: pb.MuteAlarmRequest, call: Call) -> pb.MuteAlarmResponse:
        name, hull = self._written(call, request)
        until = decode_timestamp(request.mute_time, "mute_time") if request.HasField("mute_time") else 0
        return pb.MuteAlarmResponse(status=encode_status(await self._alarms.mute(name, hull, until)))

    def _written(self, call: Call, request: pb.AcknowledgeAlarmRequest | pb.MuteAlarmRequest) -> tuple[str, str]:
        """The names of an alarm that the caller may write, and of a hull that it may read."""
        name = decode_alarm_name(request.name)
        call.access.require_write(name)
        hull = decode.decode_name(request.hull, "hull")
        call.access.require_read(hull)
        return name, hull

    def _read(self, call: Call, name: str) -> LiveFence:
        name = decode_alarm_name(name)
        call.access.require_read(name)
        return self._alarms.get(name)
