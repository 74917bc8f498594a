"""The past of a hull as events, at the pace of the reader that asks for them."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from dynhull_client import AsyncReplay, DynhullError, Event, Sketch, Snapshot

from ..callers import Caller, token_of
from ..numbers import SPAN, Moment, PastSpan
from ..problems import ProblemError
from ..schemas import HullPath
from . import documents
from .messages import COMMENT, is_over, last_problem, message, over, resumed
from .routes import OF_A_HULL, Described, FormOf, LastOrEnd, Layer, MaxVertices, WithKeys, WithMeasures, admit, events
from .stream import EventStream
from .texts import HullTexts, View

router = APIRouter(tags=["events"])

MOMENT = "A revision, all digits; or a time of RFC 3339, for the last revision committed at or before it."
From = Annotated[
    Moment | None,
    Query(alias="from", description=f"{MOMENT} The oldest by default.", examples=["2026-11-24T06:00:00Z"]),
]
To = Annotated[
    Moment | None, Query(alias="to", description=f"{MOMENT} The newest by default.", examples=["2026-11-24T18:00:00Z"])
]
Speed = Annotated[
    float, Query(ge=0, le=1e6, description="How many seconds of the past go by in one; 0: as fast as they are read.")
]
EveryEvent = Annotated[PastSpan | None, Query(description=f"The least time of the past between events. {SPAN}.")]
ReplayRate = Annotated[float, Query(ge=0, le=1000, description="The most events a second; 0 for any number.")]


@router.get(
    "/hulls/{name}/replay",
    response_class=Described,
    responses={**events(documents.OF_PAST, *OF_A_HULL), 204: {"description": "The replay is over."}},
)
async def replay(
    request: Request,
    client: Caller,
    name: HullPath,
    start: From = None,
    end: To = None,
    speed: Speed = 0.0,
    every: EveryEvent = None,
    f: FormOf = None,
    rate: ReplayRate = 0.0,
    keys: WithKeys = False,
    measures: WithMeasures = False,
    layer: Layer = 1,
    max_vertices: MaxVertices = None,
    last_event_id: LastOrEnd = None,
) -> Response:
    """Play the past of a hull: the events of `/hulls/{name}/events` from one moment to another one, and then "end".

    The first event is the hull at `from`; "changed" is when a revision was committed. With a speed, a reader that is
    slow gets fewer events, each with more changes. With speed 0 each revision is an event.

    A reader that connects again with the id of its last event begins with a snapshot of the hull at that event, and
    goes on from there; after "end" it is answered with 204, upon which a browser connects no more. The permission
    "past" is needed where tokens are used. What ends the stream before its end is an event "problem"; one that does not
    pass, as where the past is damaged, has such an id, too. Who goes on behind it says so with `from`, without an id.
    """
    admit(request)
    if is_over(last_event_id):
        return Response(status_code=204)
    place = resumed(last_event_id) if max_vertices is None else None
    view = View(token_of(request), name, f or "changes", rate, keys, measures, layer, max_vertices)
    texts = HullTexts(view)
    begin = start if place is None else place[1]
    played = client.replay(
        name,
        begin,
        end,
        speed=speed,
        every=every,
        copy=texts.copy,
        **view.options(),
    )
    try:
        first = await anext(played)
        if place is not None and isinstance(first, Snapshot | Sketch):
            _require_same(first.uid, place[0], name, last_event_id)
    except BaseException as error:
        await played.close()
        if place is not None and isinstance(error, DynhullError) and error.reason == "REVISION_FORGOTTEN":
            _require_same((await client.wait_for_hull(name)).uid, place[0], name, last_event_id)
            raise ProblemError(410, str(error), error.reason, field="Last-Event-ID", value=last_event_id) from None
        raise
    state = request.app.state
    sent = ReplayTexts(played, texts, first, state.settings.keepalive_seconds)
    return EventStream(sent, state.health, state.figures)


def _require_same(uid: str, seen: str, name: str, last_event_id: str | None) -> None:
    """Raise ProblemError if the hull is not the one whose event a reader has seen."""
    if uid != seen:
        detail = f"Last-Event-ID: the hull {name!r} was deleted and created again, or restored"
        raise ProblemError(409, detail, "HULL_REPLACED", field="Last-Event-ID", value=last_event_id)


class ReplayTexts(AsyncIterator[bytes]):
    """The events as text, and the one that says that there are no more; a comment when there is none for long.

    Args:
        played: the replay, which this closes.
        texts: makes the texts.
        first: its first event.
        keepalive: the seconds before a comment.
    """

    def __init__(self, played: AsyncReplay, texts: HullTexts, first: Event, keepalive: float) -> None:
        self._played = played
        self._texts = texts
        self._first: Event | None = first
        self._keepalive = keepalive
        self._coming: asyncio.Future[Event | None] | None = None
        self._ended = False

    async def __anext__(self) -> bytes:
        if self._first is not None:
            event, self._first = self._first, None
            return self._texts.take(event)
        if self._ended:
            raise StopAsyncIteration
        if self._coming is None:
            self._coming = asyncio.ensure_future(anext(self._played, None))
        await asyncio.wait([self._coming], timeout=self._keepalive)
        if not self._coming.done():
            return COMMENT
        coming, self._coming = self._coming, None
        try:
            following = coming.result()
        except DynhullError as error:
            self._ended = True
            return last_problem(error)
        if following is not None:
            return self._texts.take(following)
        self._ended = True
        copy = self._texts.copy
        return message("end", over(copy.uid), {"revision": copy.revision})

    async def aclose(self) -> None:
        """End the replay, which may not have been read at all."""
        if self._coming is not None:
            self._coming.cancel()
            await asyncio.gather(self._coming, return_exceptions=True)
        await self._played.close()
