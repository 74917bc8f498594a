"""Where streams of events are joined to one, and what it follows is changed while it runs."""

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response, status

from .. import examples, schemas
from ..bodies import JsonRoute
from ..callers import Caller, token_of
from ..problems import FieldError, ProblemError, cut
from ..schemas import LABEL, LABELS, Subscription
from . import documents
from .joined import JoinedStream
from .routes import Described, admit, events
from .stream import EventStream

router = APIRouter(tags=["events"], route_class=JsonRoute)

StreamPath = Annotated[
    str, Path(alias="stream", max_length=100, description="The stream: what its first event says.", examples=["none"])
]
SubscriptionPath = Annotated[
    str, Path(alias="subscription", pattern=LABEL, description=f"Its name: {LABELS}.", examples=["yard"])
]


@router.post("/streams", response_class=Described, responses=events(documents.OF_JOINED, *documents.EVENTS))
async def open_stream(
    request: Request, _: Caller, given: Annotated[schemas.Subscriptions, schemas.body(examples.STREAMS)]
) -> Response:
    """Follow any number of hulls, prefixes, fences, alarms, feeds and replays in one stream.

    A subscription is the path of one of their streams, with its parameters. Its events come with the id NAME ID in
    place of their own ID, or with NAME alone if they have none. What ends it is "over", after its last event, or
    "problem", a Problem; the others go on. "unavailable" and "available" are about all of them.

    The first event is "stream", with the name under which subscriptions are added and taken away. A stream is lost with
    its connection, and with the gateway that has it: open another one with all subscriptions, each with the last ID
    that came for it, and nothing is missed.
    """
    admit(request)
    state = request.app.state
    _require_room(request, len(given.subscriptions))
    for name, each in given.subscriptions.items():
        _require_stream(request, each, ("subscriptions", name))
    joined = JoinedStream(request.app, request.scope, token_of(request))
    return EventStream(
        joined.texts(state.joined, given.subscriptions, state.settings.keepalive_seconds), state.health, state.figures
    )


@router.put("/streams/{stream}/subscriptions/{subscription}", status_code=status.HTTP_204_NO_CONTENT)
async def subscribe(
    request: Request, _: Caller, stream: StreamPath, subscription: SubscriptionPath, given: Subscription
) -> None:
    """Follow something more in a stream. The same again changes nothing.

    What refuses it, such as a hull that is not there, is its event "problem". A name is used once in a stream. 404 says
    that the stream is lost, or another gateway has it, or it was opened with another token: open another one then.
    """
    joined = _stream(request, stream)
    _require_stream(request, given, ())
    there = joined.get(subscription)
    if there is None:
        _require_room(request, len(joined) + 1)
        joined.add(subscription, given)
    elif there != given:
        detail = f"the stream has a subscription {subscription} to {cut(there.path)}"
        raise ProblemError(HTTPStatus.CONFLICT, detail, "SUBSCRIPTION_EXISTS", field="subscription", value=subscription)


@router.delete("/streams/{stream}/subscriptions/{subscription}", status_code=status.HTTP_204_NO_CONTENT)
async def unsubscribe(request: Request, _: Caller, stream: StreamPath, subscription: SubscriptionPath) -> None:
    """End a subscription, if it is not over. Events of it that are on their way may still come."""
    await _stream(request, stream).remove(subscription)


def _stream(request: Request, name: str) -> JoinedStream:
    """A stream of this caller."""
    found: JoinedStream | None = request.app.state.joined.get(name)
    if found is None or found.token != token_of(request):
        detail = f"this gateway has no stream {cut(name)}: open another one with all its subscriptions"
        raise ProblemError(HTTPStatus.NOT_FOUND, detail, "STREAM_NOT_FOUND", field="stream", value=cut(name))
    return found


def _require_room(request: Request, count: int) -> None:
    state = request.app.state
    most = state.settings.max_subscriptions
    if count > most:
        state.figures.refused_streams.labels("max_subscriptions").inc()
        detail = f"the limit max_subscriptions is {most}: end subscriptions, or open another stream"
        raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, detail, "STREAM_LIMIT", value=str(most))


def _require_stream(request: Request, given: Subscription, at: tuple[str, ...]) -> None:
    """Refuse a path that is not of a stream of events."""
    routes: list[Any] = [
        each for each in request.app.state.routes if getattr(each, "response_class", None) is Described
    ]
    path = given.path.partition("?")[0]
    if not any("GET" in each.methods and each.path_regex.fullmatch(path) for each in routes):
        there = ", ".join(each.path for each in routes if "GET" in each.methods)
        raise FieldError((*at, "path"), f"must be the path of a stream of events: {there}", given.path)
