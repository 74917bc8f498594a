"""The ways of keys through the past."""

import re
from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from dynhull_cli.tracks import feature_collection, shown_times
from dynhull_client import AsyncHullClient, Track

from . import schemas
from .bodies import GEOJSON, JsonRoute
from .callers import Caller
from .events.replays import From, To
from .hulls import Format, prefers_geojson
from .numbers import SPAN, PastSpan
from .problems import ProblemError
from .schemas import HullPath

router = APIRouter(tags=["questions"], route_class=JsonRoute)

WHOLE = re.compile("0*[0-9]{1,20}")

TrackedKeys = Annotated[
    Sequence[str],
    Query(min_length=1, max_length=10_000, alias="key", description="A key; repeatable.", examples=[["LH400"]]),
]
EveryPlace = Annotated[
    PastSpan | None, Query(description=f"{SPAN}: of each key the last place in each span of this length alone.")
]
AS_FEATURES: dict[int | str, dict[str, Any]] = {
    200: {"content": {GEOJSON: {"schema": {"$ref": "#/components/schemas/FeatureCollection"}}}}
}


@router.get("/hulls/{name}/tracks", response_model=schemas.Tracks, responses=AS_FEATURES)
async def tracks(
    request: Request,
    client: Caller,
    name: HullPath,
    response: Response,
    keys: TrackedKeys,
    start: From = None,
    end: To = None,
    every: EveryPlace = None,
    f: Format = None,
) -> Any:
    """Where keys were: at `from`, and then each place up to `to`.

    A place of null says that the key left the hull. As GeoJSON, a line for each key, with a time for each of its
    places; a MultiLineString where the key was gone in between. What is held in quarantine is no part of it. The
    permission "past" is needed where tokens are used.
    """
    found = await client.track(
        name,
        await _as_the_hull_has_them(client, name, keys),
        start,
        end,
        every=every,
    )
    vary = {"Vary": "Accept"}
    if f == "geojson" or (f is None and prefers_geojson(request)):
        return Response(feature_collection(found), headers=vary, media_type=GEOJSON)
    response.headers.update(vary)
    return {"tracks": [_shown(key, track) for key, track in found.items()]}


async def _as_the_hull_has_them(client: AsyncHullClient, name: str, keys: Sequence[str]) -> Sequence[str] | list[int]:
    """The keys as integers, if those of the hull are."""
    async for info in client.list_hulls(name):
        if info.name == name and info.keyed == "int":
            if wrong := [key for key in keys if not WHOLE.fullmatch(key)]:
                shown = wrong[0][:60]
                detail = f"key: {shown!r} is not a key of {name!r}, which are integers"
                raise ProblemError(400, detail, "INVALID_FIELD", field="key", value=shown)
            return list(map(int, keys))
        break
    return keys


def _shown(key: str | int, track: Track) -> dict[str, Any]:
    sent = None if track.event_times is None else shown_times(track.event_times)
    return {
        "key": key,
        "times": shown_times(track.times),
        "points": track.points,
        "revisions": track.revisions.tolist(),
        "event_times": sent,
        "accuracies": track.accuracies,
    }
