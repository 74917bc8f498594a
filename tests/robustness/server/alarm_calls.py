"""Calls about alarms whose callers disconnect: see `callers`."""

import random
from collections import defaultdict
from collections.abc import Sequence

import grpc
from patience import PATIENCE
from promises import require

from dynhull_proto.v1 import alarm_pb2
from dynhull_proto.v1 import alarm_service_pb2 as pb
from dynhull_proto.v1 import hull_service_pb2 as hulls_pb
from dynhull_proto.v1.alarm_service_pb2_grpc import AlarmServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

# The alarms, each over a prefix: hulls that come and go, and hulls that stay and change their vertices.
RULES = {
    "churned/count": ("churned/", "count > 2"),
    "churned/vertices": ("churned/", "vertices >= 2"),
    "kept/vertices": ("kept/", "vertices > 40"),
}
TYPES = alarm_pb2.ALARM_EVENT_TYPE_RAISED, alarm_pb2.ALARM_EVENT_TYPE_CLEARED
CONSUMER = "consumer"


class AlarmCalls:
    """Makes them at random.

    Args:
        draws: what they depend on.
        hulls: the hulls that they name.
    """

    def __init__(self, draws: random.Random, hulls: Sequence[str]) -> None:
        self._random, self._hulls = draws, hulls

    async def call(self, channel: grpc.aio.Channel) -> None:
        """One of them."""
        stub, name, hull = AlarmServiceStub(channel), self._random.choice(list(RULES)), self._random.choice(self._hulls)
        make = [
            lambda: self.create(stub, name),
            lambda: self.create(stub, name),
            lambda: stub.DeleteAlarm(pb.DeleteAlarmRequest(name=name)),
            lambda: stub.GetAlarm(pb.GetAlarmRequest(name=name)),
            lambda: stub.ListAlarms(pb.ListAlarmsRequest()),
            lambda: stub.AcknowledgeAlarm(pb.AcknowledgeAlarmRequest(name=name, hull=hull)),
            lambda: stub.MuteAlarm(pb.MuteAlarmRequest(name=name, hull=hull)),
            lambda: stub.AckAlarm(pb.AckAlarmRequest(name=name, consumer=CONSUMER)),
            lambda: stub.DeleteAlarmConsumer(pb.DeleteAlarmConsumerRequest(name=name, consumer=CONSUMER)),
            lambda: self._watch(stub, name),
        ]
        await self._random.choice(make)()

    async def create(self, stub: AlarmServiceStub, name: str) -> None:
        prefix, when = RULES[name]
        await stub.CreateAlarm(pb.CreateAlarmRequest(name=name, rule=alarm_pb2.AlarmRule(prefix=prefix, when=when)))

    async def _watch(self, stub: AlarmServiceStub, name: str) -> None:
        call = stub.WatchAlarm(pb.WatchAlarmRequest(name=name, after_sequence=0))
        try:
            async for _ in call:
                return
        finally:
            call.cancel()

    async def check(self, channel: grpc.aio.Channel) -> int:
        """No event is missing, and each hull is raised once between two clears, and as it should be. Counts events."""
        stub, hulls, events = AlarmServiceStub(channel), HullServiceStub(channel), 0
        for alarm in (await stub.ListAlarms(pb.ListAlarmsRequest(), timeout=PATIENCE)).alarms:
            made = await self._events(stub, alarm)
            events += len(made)
            require([each.sequence for each in made] == list(range(1, len(made) + 1)), f"{alarm.name}: {made}")
            types = defaultdict[str, list[int]](list)
            for event in made:
                types[event.hull].append(event.type)
            answer = await stub.GetAlarm(pb.GetAlarmRequest(name=alarm.name), timeout=PATIENCE)
            statuses = {each.hull: each for each in answer.statuses}
            for hull, found in types.items():
                raised = hull in statuses and statuses[hull].raised
                expected = (list(TYPES) * len(found))[: len(found)]
                require(found == expected and raised == len(found) % 2, f"{alarm.name} at {hull}: {found}, {raised}")
            for hull in self._hulls:
                if hull.startswith(alarm.rule.prefix):
                    await self._holds(hulls, alarm, hull, raised=hull in statuses and statuses[hull].raised)
        return events

    async def _events(self, stub: AlarmServiceStub, alarm: alarm_pb2.Alarm) -> list[alarm_pb2.AlarmEvent]:
        found: list[alarm_pb2.AlarmEvent] = []
        call = stub.WatchAlarm(pb.WatchAlarmRequest(name=alarm.name, after_sequence=0), timeout=PATIENCE)
        while len(found) < alarm.last_sequence:
            response = await call.read()
            found += response.events
        call.cancel()
        return found

    async def _holds(self, stub: HullServiceStub, alarm: alarm_pb2.Alarm, name: str, *, raised: bool) -> None:
        try:
            hull = (await stub.GetHull(hulls_pb.GetHullRequest(name=name), timeout=PATIENCE)).hull
        except grpc.RpcError as error:
            require(error.code() == grpc.StatusCode.NOT_FOUND, f"{name}: {error.details()}")
            require(not raised, f"{alarm.name} is raised for {name}, which is not there")
            return
        measure, op, bound = alarm.rule.when.split()
        value = hull.point_count if measure == "count" else hull.distinct_point_count  # each is a vertex of a parabola
        holds = value > int(bound) if op == ">" else value >= int(bound)
        require(raised == holds, f"{alarm.name} at {name}: raised is {raised}, {measure} is {value}")
