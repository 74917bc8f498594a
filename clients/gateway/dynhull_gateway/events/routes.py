"""Where events are read."""

from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Header, Query, Request, Response
from pydantic import BaseModel, Field

from dynhull_client import (
    Alarm,
    AsyncHullClient,
    DeadlineError,
    Fence,
    HullNotFoundError,
    InvalidRequestError,
    UnavailableError,
)

from .. import examples, schemas
from ..bodies import JsonRoute
from ..callers import Caller, address_of, token_of
from ..fences import arguments_of
from ..problems import ProblemError, cut
from ..schemas import LARGEST, NAME, AlarmPath, FencePath, HullPath, Prefix
from . import documents
from .alarm_events import AlarmReading, alarm_events
from .batches import FeedReading, batches, look
from .feeds import PATIENCE_SECONDS, Feed
from .fence_events import Reading
from .fence_events import events as fence_events
from .many import ManyFeed, ManyView
from .messages import (
    ENDING_ID,
    MANY_ENDING_ID,
    MANY_ID,
    PART_ID,
    REVISION_ID,
    SEQUENCE_ID,
    is_over,
    parted,
    position_of,
    resumed,
)
from .past_fence import PastEvents
from .shared import begin_at
from .stream import EventStream
from .texts import Form, View

router = APIRouter(tags=["events"], route_class=JsonRoute)


def last_event_id(most: int = 300) -> Any:
    """The header with the id of the last event that a reader has."""
    said = "The id of the last event that was received."
    return Header(alias="Last-Event-ID", max_length=most, description=said)


LastRevision = Annotated[str | None, last_event_id(), REVISION_ID]
LastSequence = Annotated[str | None, last_event_id(), SEQUENCE_ID]
LastPart = Annotated[str | None, last_event_id(), PART_ID]
LastOrEnd = Annotated[str | None, last_event_id(), ENDING_ID]
LastOfMany = Annotated[str | None, last_event_id(2000), MANY_ID]
# Forty digits for each of at most 1024 partitions.
LastOfManyOrEnd = Annotated[str | None, last_event_id(40_960), MANY_ENDING_ID]
ONE_A_DAY = 1 / 86400  # the least that a watch takes
Rate = Annotated[
    float, Query(ge=ONE_A_DAY, le=100, description="The most events a second, each with all changes before it.")
]
OLD_NAME = "The old name of `f`, which takes its place."
FormOf = Annotated[
    Form | None,
    Query(
        description="changes, the default: a snapshot, then what differs; vertices: the whole hull in each event; "
        "geojson: the whole hull as a Feature."
    ),
]
WithKeys = Annotated[bool, Query(description="Whether to name the vertices, in a keyed hull.")]
WithMeasures = Annotated[bool, Query(description="Whether events include measures.")]
Wait = Annotated[bool, Query(description="Whether to wait for a hull that is not there yet, in place of 404.")]
Layer = Annotated[int, Query(ge=1, le=1000, description="The convex layer to follow; 1 is the hull.")]
MaxVertices = Annotated[
    int | None,
    Query(
        ge=1,
        le=1000,
        description="Show at most this many of the vertices. Each event is then a snapshot; its error is the distance "
        "by which the hull reaches beyond them, rounded up; on the globe in metres.",
    ),
]
Names = Annotated[
    Sequence[Annotated[str, Field(pattern=NAME)]],
    Query(
        max_length=10_000, description="In place of a prefix, a hull that has this name, or will have it; repeatable."
    ),
]
WithOutlines = Annotated[bool, Query(description="Whether to send the vertices of each hull.")]
Consumer = Annotated[
    str | None,
    Query(pattern=NAME, description="A durable consumer, which knows its place: events after the acknowledged one."),
]
AfterSequence = Annotated[
    int | None, Query(ge=0, le=LARGEST, description="Begin after this sequence; 0 for all that is kept.")
]
AfterRevision = Annotated[
    int | None, Query(ge=0, le=LARGEST, description="Begin after this revision; 0 for all batches that are kept.")
]
FromTheBeginning = Annotated[bool, Query(description="Begin with the oldest batches that are kept.")]
FeedConsumer = Annotated[
    str | None,
    Query(
        pattern=NAME,
        description="A durable consumer, which knows its place: batches after those acknowledged, or all that is kept.",
    ),
]
OF_A_HULL = documents.HullSnapshot, documents.HullChange, documents.HullProgress
Conflate = Annotated[bool, Query(description="Leave out events that cancel each other.")]


class Described(Response):
    """What the description of a stream says; an `EventStream` needs more than a status."""

    media_type = EventStream.media_type


def events(example: str, *data: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """The description of a stream of events, with this data."""
    schemas = [{"$ref": f"#/components/schemas/{each.__name__}"} for each in data]
    of_one = {"anyOf": schemas} if len(schemas) > 1 else schemas[0]
    schema = {"type": "string", "contentMediaType": Described.media_type, "contentSchema": of_one}
    content = {"schema": schema, "example": example}
    return {200: {"description": "Events.", "content": {Described.media_type: content}}}


IS_OVER: dict[int | str, dict[str, Any]] = {
    204: {"description": "The stream has ended with a problem that does not pass."}
}


@router.get("/hulls/{name}/events", response_class=Described, responses=events(documents.OF_HULL, *OF_A_HULL))
async def hull_events(
    request: Request,
    client: Caller,
    name: HullPath,
    f: FormOf = None,
    form: Annotated[Form | None, Query(deprecated=True, description=OLD_NAME)] = None,
    rate: Rate = 10.0,
    keys: WithKeys = False,
    measures: WithMeasures = False,
    layer: Layer = 1,
    max_vertices: MaxVertices = None,
    wait: Wait = False,
    last_event_id: LastRevision = None,
) -> Response:
    """Follow a hull: events "snapshot", "change", "progress" and "deleted", with ids UID:REVISION.

    A reader that connects again with the id of its last event continues from there, with the changes since then or with
    a snapshot; so does one that is too slow. A hull that is created again begins with a snapshot. What ends the stream
    is an event "problem".

    The data is JSON, as described by the schemas HullSnapshot, HullChange and HullProgress. With f=changes, the
    events after the first one are "change", with what differs: HullChange says how to apply it. With f=vertices and
    f=geojson each change is a "snapshot" of the whole hull. "progress" is a revision with the same vertices,
    "deleted" has its revision alone, and "problem" is a Problem.

    Events of a stream with max_vertices have no ids: each shows all there is, and a reader that connects again begins
    with the present one. An inner layer begins with a snapshot also when the gateway has lost the server for a while.
    """
    if f is not None and form is not None:
        raise ProblemError(400, f"form: {OLD_NAME}: give f alone", "INVALID_FIELD", field="form", value=form)
    admit(request)
    awaited = (UnavailableError, HullNotFoundError) if wait else (UnavailableError,)
    with suppress(*awaited):  # an answer of 503 or 404 would end an EventSource for good
        await client.count(name, np.empty((0, 2)))  # whether it is there, and may be read
        if keys:
            await _require_keys(client, name)
    view = View(token_of(request), name, f or form or "changes", rate, keys, measures, layer, max_vertices)
    state = request.app.state
    place, keepalive = resumed(last_event_id), state.settings.keepalive_seconds
    texts = state.shared.read(
        view, partial(Feed, client, view), lambda feed: feed.read(place, keepalive, state.figures)
    )
    return EventStream(texts, state.health, state.figures)


@router.get("/events", response_class=Described, responses=events(documents.OF_MANY, documents.Hulls))
async def watch_many(
    request: Request,
    client: Caller,
    prefix: Prefix = "",
    name: Names = (),
    outlines: WithOutlines = False,
    max_vertices: MaxVertices = None,
    rate: Rate = 10.0,
    last_event_id: LastOfMany = None,
) -> Response:
    """Follow many hulls: those of a prefix, or those with the given names, which may come later.

    From "begin" to "complete" every hull that there is is named, in events "hulls" with their states; what a reader
    holds of others is no more. Then "hulls" has the newest state of each that has changed or is new, and the names of
    those that are gone. "restored" is a "begin" after which states may be older than those before it. A reader that
    connects again with the id of its last event gets what differs, and the names of the others as "unchanged".

    The data of "hulls" is JSON, as described by the schema Hulls; "problem", a Problem, ends the stream.
    """
    if name and prefix:
        raise ProblemError(400, "name: give prefix or name, not both", "INVALID_FIELD", field="name", value=name[0])
    if max_vertices is not None and not outlines:
        detail = "max_vertices: only with outlines=true: without it no vertices are sent"
        raise ProblemError(400, detail, "INVALID_FIELD", field="max_vertices", value=str(max_vertices))
    admit(request)
    token, figures = token_of(request), request.app.state.figures
    caller = address_of(request) if token is None else token
    _admit_many(request, caller)
    view = ManyView(token, prefix, tuple(sorted(set(name))), outlines, max_vertices, rate)
    position = position_of(last_event_id)
    with suppress(UnavailableError, DeadlineError), _in_header(last_event_id):  # 503 would end an EventSource for good
        async with client.watch_many(**view.arguments(), position=position, timeout=PATIENCE_SECONDS) as allowed:
            await anext(allowed)  # whether these hulls may be read
    state = request.app.state
    keepalive = state.settings.keepalive_seconds
    texts = state.shared.read(view, partial(ManyFeed, client, view), lambda feed: feed.read(position, keepalive))
    return EventStream(texts, state.health, figures, figures.many_stream(caller))


@router.get(
    "/fences/{name}/events", response_class=Described, responses=events(documents.OF_FENCE, documents.FenceEvent)
)
async def follow_fence(
    request: Request,
    client: Caller,
    name: FencePath,
    consumer: Consumer = None,
    after: AfterSequence = None,
    conflate: Conflate = False,
    last_event_id: LastPart = None,
) -> Response:
    """Follow a fence: each event once and in order, named by its type, with ids UID:SEQUENCE.

    With `conflate`, events that are sent together may belong together; the ids of all but the last one then say so. Who
    connects again with such an id is sent all of them once more, and what was left out of them.

    It begins with the next event unless Last-Event-ID, a sequence or a consumer says where; a consumer acknowledges
    with `PUT /fences/{name}/consumers/{consumer}`, and is sent what it has not acknowledged. `POST /fences` creates a
    fence. The data is JSON, as described by the schema FenceEvent. Also: "replaced", when another fence has the name
    now, and "problem", which ends the stream.
    """
    if consumer is not None and (after is not None or conflate):
        raise ValueError("give either consumer, which knows its place, or after and conflate")
    admit(request)
    ident, exact = parted(last_event_id)
    resume = _resumed(ident, consumer, after)
    uid, place = resume or ("", after)
    reading = Reading(name, consumer, uid, place, conflate, exact, told=resume is not None)
    await _require_events(client.get_fence, reading, "after" if resume is None else "Last-Event-ID")
    state = request.app.state
    texts = fence_events(client, reading, state.settings.keepalive_seconds)
    return EventStream(texts, state.health, state.figures)


@router.get(
    "/alarms/{name}/events", response_class=Described, responses=events(documents.OF_ALARM, documents.AlarmEvent)
)
async def follow_alarm(
    request: Request,
    client: Caller,
    name: AlarmPath,
    consumer: Consumer = None,
    after: AfterSequence = None,
    last_event_id: LastSequence = None,
) -> Response:
    """Follow an alarm: each event once and in order, named by its type, with ids UID:SEQUENCE.

    It begins with the next event unless Last-Event-ID, a sequence or a consumer says where; a consumer acknowledges
    with `PUT /alarms/{name}/consumers/{consumer}`, and is sent what it has not acknowledged. The data is JSON, as
    described by the schema AlarmEvent. Also: "replaced", when another alarm has the name now, and "problem", which ends
    the stream.
    """
    resume = _resumed(last_event_id, consumer, after)
    admit(request)
    uid, place = resume or ("", after)
    reading = AlarmReading(name, consumer, uid, place, told=resume is not None)
    await _require_events(client.get_alarm, reading, "after" if resume is None else "Last-Event-ID")
    state = request.app.state
    texts = alarm_events(client, reading, state.settings.keepalive_seconds)
    return EventStream(texts, state.health, state.figures)


@router.post(
    "/fences/between",
    response_class=Described,
    responses=events(documents.OF_PAST_FENCE, documents.FenceEvent),
)
async def fence_events_between(
    request: Request, client: Caller, fence: Annotated[schemas.PastFence, schemas.body(examples.PAST_FENCES)]
) -> Response:
    """The events that a fence with these settings would have made between two moments, each named by its type.

    No fence is created. The data is JSON, as described by the schema FenceEvent, without `fence` and `uid`; events have
    no ids, and the same request has the same answer. "complete" comes after the last event, with their number, and
    "problem", a Problem, in its place.
    """
    admit(request)
    state = request.app.state
    past = PastEvents(client.fence_events_between(**arguments_of(fence)))
    await past.begin(PATIENCE_SECONDS)
    return EventStream(past.texts(state.settings.keepalive_seconds), state.health, state.figures)


@router.get(
    "/hulls/{name}/feed", response_class=Described, responses=events(documents.OF_FEED, documents.FeedBatch) | IS_OVER
)
async def hull_feed(
    request: Request,
    client: Caller,
    name: HullPath,
    after: AfterRevision = None,
    consumer: FeedConsumer = None,
    last_event_id: LastOrEnd = None,
) -> Response:
    """Follow every batch of a hull with its rows: events "batch", each once and in order, with ids UID:REVISION.

    It begins with the next batch unless Last-Event-ID, a revision or a consumer says where; a consumer acknowledges
    with `PUT /hulls/{name}/feed/consumers/{consumer}`, and is sent what it has not acknowledged. It needs the right to
    read the past of the hull. The data is JSON, as described by the schema FeedBatch. Also: "lost", with the `first`
    and the `last` revision of batches that are kept no more and were not sent; "replaced", when another hull has the
    name now, whose batches follow; and "problem", which ends the stream. One that does not pass, as where the past is
    damaged, has an id after which a browser that connects again is answered with 204, and connects no more.
    """
    if is_over(last_event_id):
        return Response(status_code=204)
    uid, place = _resumed(last_event_id, consumer, after) or ("", after)
    return await _feed(request, client, FeedReading(name, None, uid, place, consumer))


@router.get("/feed", response_class=Described, responses=events(documents.OF_FEED, documents.FeedBatch) | IS_OVER)
async def feed_of_many(
    request: Request,
    client: Caller,
    prefix: Prefix = "",
    begin: FromTheBeginning = False,
    consumer: FeedConsumer = None,
    last_event_id: LastOfManyOrEnd = None,
) -> Response:
    """Follow every batch of all hulls of a prefix, those to come, too: events "batch", each once, by their commits.

    It begins with the next batch unless Last-Event-ID, `begin` or a consumer says where; a consumer acknowledges with
    `PUT /feed/consumers/{consumer}`, and is sent what it has not acknowledged. It needs the right to read the past of
    the prefix. Events without an id belong together with those up to the next id. The data is JSON, as described by the
    schema FeedBatch. Also: "lost", with the `first` and the `last` revision of batches that are kept no more and were
    not sent; "deleted", with a `hull` that was deleted; "hulls" after Last-Event-ID, with the uids of the `hulls` that
    there are, by name: what a reader has of others is no more; and "problem", which ends the stream, as for a hull.
    """
    if consumer is not None and begin:
        raise ValueError("give either consumer, which knows its place, or begin")
    if is_over(last_event_id):
        return Response(status_code=204)
    position = None if consumer is not None else position_of(last_event_id)
    with _in_header(last_event_id):
        return await _feed(request, client, FeedReading(None, prefix, "", position or (0 if begin else None), consumer))


async def _feed(request: Request, client: AsyncHullClient, reading: FeedReading) -> EventStream:
    admit(request)
    await look(client, reading)
    state = request.app.state
    texts = batches(client, reading, state.settings.keepalive_seconds)
    return EventStream(texts, state.health, state.figures)


def _resumed(ident: str | None, consumer: str | None, after: int | None) -> tuple[str, int] | None:
    """The uid and the number that a reader goes on after; None for one without an id, and for a consumer."""
    if consumer is None:
        return resumed(ident)
    if after is not None:
        raise ValueError("give either consumer, which knows its place, or after")
    return None


@contextmanager
def _in_header(ident: str | None) -> Iterator[None]:
    """Name the header where the server refuses the position in it."""
    try:
        yield
    except InvalidRequestError as error:
        if ident is None or error.field != "position":
            raise
        detail = f"Last-Event-ID: {error.problem}"
        raise ProblemError(400, detail, "INVALID_FIELD", field="Last-Event-ID", value=cut(ident)) from None


async def _require_keys(client: AsyncHullClient, name: str) -> None:
    """Refuse a hull without keys: an EventSource would come again and again after an event "problem"."""
    async for info in client.list_hulls(name):
        if info.name == name and info.keyed is None:
            detail = f"keys: the hull {name!r} has points without keys"
            raise ProblemError(409, detail, "HULL_UNSUITABLE", field="keys", value=name)
        return


async def _require_events(
    get: Callable[[str], Awaitable[Fence | Alarm]], reading: Reading | AlarmReading, field: str
) -> None:
    """Learn where the stream begins, and refuse what is not there, or has no such event yet.

    While the server is away the stream waits for it.
    """
    with suppress(UnavailableError):
        there = await get(reading.name)
        if reading.uid not in ("", there.uid):
            reading.after = 0  # "replaced" follows, whatever the sequence
        elif reading.after is not None and reading.after > there.last_sequence:
            detail = f"{field}: {reading.after} is after the last event, {there.last_sequence}"
            raise ProblemError(409, detail, "SEQUENCE_AHEAD", field=field, value=str(reading.after))
        elif reading.consumer is None:
            begin_at(reading, there)


def admit(request: Request) -> None:
    """Refuse a stream that the gateway has no place for, or no time."""
    state = request.app.state
    if state.health.draining.is_set():
        raise ProblemError(503, "the gateway stops", "DRAINING")
    if state.figures.open_streams >= state.settings.max_streams:
        state.figures.refused_streams.labels("max_streams").inc()
        raise ProblemError(503, "too many streams of events", "STREAM_LIMIT", value=str(state.settings.max_streams))


def _admit_many(request: Request, caller: str) -> None:
    state = request.app.state
    most = state.settings.max_many_streams_per_caller
    if state.figures.many_streams[caller] >= most:
        state.figures.refused_streams.labels("max_many_streams_per_caller").inc()
        detail = f"the limit max_many_streams_per_caller is {most}: end streams of many hulls that this caller has"
        raise ProblemError(429, detail, "STREAM_LIMIT", value=str(most))
