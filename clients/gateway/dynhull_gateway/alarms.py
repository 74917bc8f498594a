"""Alarms: create, list, read, acknowledge, mute, delete, and their durable consumers."""

from typing import Annotated

from fastapi import APIRouter, status

from . import alarm_schemas, examples, schemas
from .bodies import JsonRoute
from .callers import Caller
from .fences import NamePrefix
from .pages import page
from .schemas import After, AlarmPath, ConsumerPath, Limit

router = APIRouter(tags=["alarms"], route_class=JsonRoute)


@router.get("/alarms")
async def list_alarms(
    client: Caller, prefix: NamePrefix = "", after: After = "", limit: Limit = 100
) -> alarm_schemas.AlarmPage:
    """List alarms by name, in pages. Each without the hulls for which it is raised."""
    alarms, more = await page(client.list_alarms(prefix), limit, lambda each: each.name <= after)
    shown = [alarm_schemas.Alarm.model_validate(each) for each in alarms]
    return alarm_schemas.AlarmPage(alarms=shown, next=alarms[-1].name if more else None)


@router.post("/alarms", status_code=status.HTTP_201_CREATED)
async def create_alarm(
    client: Caller, alarm: Annotated[alarm_schemas.NewAlarm, schemas.body(examples.ALARMS)]
) -> alarm_schemas.Alarm:
    """Create an alarm: it is raised for a hull when a condition about its outline holds, and cleared when not."""
    return alarm_schemas.Alarm.model_validate(await client.create_alarm(**alarm.arguments()))


@router.get("/alarms/{name}")
async def get_alarm(client: Caller, name: AlarmPath) -> alarm_schemas.Alarm:
    """An alarm with its rule, its counts, its consumers, and the hulls for which it is raised, waits, or is muted."""
    return alarm_schemas.Alarm.model_validate(await client.get_alarm(name))


@router.delete("/alarms/{name}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_alarm(client: Caller, name: AlarmPath) -> None:
    """Delete an alarm and its events."""
    await client.delete_alarm(name)


@router.post("/alarms/{name}/acknowledge")
async def acknowledge_alarm(client: Caller, name: AlarmPath, of: alarm_schemas.OfHull) -> alarm_schemas.AlarmStatus:
    """Say that somebody takes care of an alarm that is raised for a hull, until it is cleared."""
    return alarm_schemas.AlarmStatus.model_validate(await client.acknowledge_alarm(name, of.hull))


@router.post("/alarms/{name}/mute")
async def mute_alarm(client: Caller, name: AlarmPath, muting: alarm_schemas.Muting) -> alarm_schemas.AlarmStatus:
    """Mute an alarm for a hull, for those who show alarms; its events are made and sent as before."""
    return alarm_schemas.AlarmStatus.model_validate(await client.mute_alarm(name, muting.hull, muting.until))


@router.put("/alarms/{name}/consumers/{consumer}")
async def ack_alarm(
    client: Caller, name: AlarmPath, consumer: ConsumerPath, processed: schemas.Acknowledgement
) -> schemas.Consumer:
    """Acknowledge the events of an alarm up to a sequence. A new consumer is created."""
    acknowledged = await client.ack_alarm(name, consumer, processed.sequence, uid=processed.uid)
    return schemas.Consumer.model_validate(acknowledged)


@router.delete("/alarms/{name}/consumers/{consumer}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_alarm_consumer(client: Caller, name: AlarmPath, consumer: ConsumerPath) -> None:
    """Delete a durable consumer of an alarm."""
    await client.delete_alarm_consumer(name, consumer)
