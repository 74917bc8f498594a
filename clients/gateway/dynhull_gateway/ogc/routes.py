"""Where maps find hulls: the landing page, the collections and their features.

The standard demands longitudes and latitudes (CRS84), so hulls of a plane are no collections: their coordinates would
be drawn somewhere on the globe.
"""

import json
import math
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import quote, urlencode

from fastapi import APIRouter, Path, Query, Request
from pydantic import BaseModel, BeforeValidator, StringConstraints
from starlette.responses import Response

from dynhull_client import AsyncHullClient, HullInfo, HullNotFoundError

from ..bodies import GEOJSON, JsonRoute
from ..callers import Caller, token_of
from ..hulls import feature as hull_feature
from ..problems import ProblemError
from ..schemas import Feature, unquoted
from .documents import (
    CONFORMANCE,
    JSON,
    OPENAPI,
    SCHEMA,
    Collection,
    Collections,
    Conformance,
    Extent,
    FeatureCollection,
    Item,
    Landing,
    Link,
    Spatial,
    Temporal,
    schema_of_entities,
)
from .entities import Snapshots, feature
from .filters import Matching, Page

router = APIRouter(tags=["maps"], route_class=JsonRoute)

HULLS = "hulls"
ENTITIES = "entities:"
ROUND = 100
DESCRIBED_BY = "describedby", "describedBy"  # as registered, and as GDAL 3.6 looks for it

Segment = Annotated[str, StringConstraints(min_length=1, max_length=300), BeforeValidator(unquoted)]
CollectionId = Annotated[
    Segment, Path(description="hulls, or entities:NAME for the keys of a hull.", examples=["entities:ships"])
]
FeatureId = Annotated[Segment, Path(description="The name of a hull, or a key.", examples=["ferry"])]


def geojson(model: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """The description of a response of GeoJSON."""
    schema = {"$ref": f"#/components/schemas/{model.__name__}"}
    return {200: {"description": "GeoJSON.", "content": {GEOJSON: {"schema": schema}}}}


class GeoJsonAnswer(Response):
    """A response of GeoJSON."""

    media_type = GEOJSON


@router.get("/")
async def landing(request: Request) -> Landing:
    """The landing page: where the description and the data are."""
    links = [
        _link(request, "", "self", JSON, "This page"),
        _link(request, "openapi.json", "service-desc", OPENAPI, "The description of every call"),
        _link(request, "conformance", "conformance", JSON, "What of OGC API Features is there"),
        _link(request, "collections", "data", JSON, "Hulls and their entities"),
    ]
    return Landing(title="dynhull", description="Convex hulls of moving points, live.", links=links)


@router.get("/conformance")
async def conformance() -> Conformance:
    """The classes of OGC API Features that are met."""
    return Conformance(conforms_to=CONFORMANCE)


@router.get("/collections", response_model_exclude_none=True)
async def collections(request: Request, client: Caller) -> Collections:
    """The collections: all geographic hulls, and the keys of each that is keyed."""
    keyed = [info.name async for info in client.list_hulls() if info.geographic and info.keyed is not None]
    found = [_hulls(request), *(_entities(request, name) for name in keyed)]
    return Collections(links=[_link(request, "collections", "self", JSON, "This page")], collections=found)


@router.get("/collections/{collection}", response_model_exclude_none=True)
async def describe_collection(request: Request, client: Caller, collection: CollectionId) -> Collection:
    """A collection."""
    name = _hull_of(collection)
    if name is None:
        return _hulls(request)
    await _info(client, name, keyed=True)
    described = _entities(request, name)
    bounds = (await client.get_hull(name)).measures.bounds
    kept = await client.history(name)
    spatial, temporal = None, None
    if not any(map(math.isnan, bounds)):  # those of an empty hull
        spatial = Spatial(bbox=[list(bounds)])
    if kept.history is not None and kept.first_time is not None:
        temporal = Temporal(interval=[[kept.first_time.isoformat().replace("+00:00", "Z"), None]])
    if spatial is not None or temporal is not None:
        described.extent = Extent(spatial=spatial, temporal=temporal)
    return described


class JsonSchema(Response):
    """A response of a JSON schema."""

    media_type = SCHEMA


@router.get(
    "/collections/{collection}/schema",
    response_class=JsonSchema,
    responses={200: {"description": "A JSON schema.", "content": {SCHEMA: {"schema": {"type": "object"}}}}},
)
async def schema(request: Request, client: Caller, collection: CollectionId) -> Response:
    """The JSON schema of the features of a collection of entities."""
    name = _hull_of(collection)
    if name is None:
        raise _missing(f"the collection {HULLS!r} has no schema: its features all have the same properties", HULLS)
    info = await _info(client, name, keyed=True)
    url = _url(request, f"collections/{quote(collection, safe='')}/schema")
    return JsonSchema(json.dumps(schema_of_entities(url, name, str(info.keyed))))


@router.get("/collections/{collection}/items", response_class=GeoJsonAnswer, responses=geojson(FeatureCollection))
async def items(request: Request, client: Caller, collection: CollectionId, page: Annotated[Page, Query()]) -> Response:
    """The features of a collection, in pages: follow the links "next"."""
    name = _hull_of(collection)
    more: dict[str, Any] = {}
    if name is None:
        if page.revision is not None:
            raise ProblemError(HTTPStatus.BAD_REQUEST, "revision: is for entities", "INVALID_FIELD", field="revision")
        found = await _hull_features(client, page)
    else:
        info = await _info(client, name, keyed=True)
        snapshots: Snapshots = request.app.state.snapshots
        then = await _then(client, name, page)
        snapshot = await snapshots.of(client, token_of(request), info, page.revision, then)
        found = snapshot.page(page, standing=then is not None)
        if found.following is not None:
            snapshots.keep(token_of(request), name, snapshot)
        more = {"revision": snapshot.place}
    path = f"collections/{quote(collection, safe='')}/items"
    links = [
        _link(request, path, "self", GEOJSON, "This page", page.model_dump(exclude_unset=True)),
        _link(request, path.removesuffix("/items"), "collection", JSON, "The collection"),
    ]
    if found.following is not None:
        asked = {**page.model_dump(exclude_none=True), **more, "after": found.following}
        links.append(_link(request, path, "next", GEOJSON, "The next page", asked))
    shown = FeatureCollection(
        features=[Feature.model_validate(each) for each in found.features],
        links=links,
        time_stamp=datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        number_returned=len(found.features),
        number_matched=found.matched,
    )
    unknown = {"number_matched"} if found.matched is None else None
    return GeoJsonAnswer(shown.model_dump_json(by_alias=True, exclude=unknown))


@router.get(
    "/collections/{collection}/items/{feature_id}",
    response_class=GeoJsonAnswer,
    responses=geojson(Item),
)
async def item(request: Request, client: Caller, collection: CollectionId, feature_id: FeatureId) -> Response:
    """A feature: a hull, or a key."""
    name = _hull_of(collection)
    if name is None:
        await _info(client, feature_id)
        found = hull_feature(await client.get_hull(feature_id))
    else:
        info = await _info(client, name, keyed=True)
        found = await _entity(client, info, feature_id)
    path = f"collections/{quote(collection, safe='')}"
    links = [
        _link(request, f"{path}/items/{quote(feature_id, safe='')}", "self", GEOJSON, "This feature"),
        _link(request, path, "collection", JSON, "The collection"),
    ]
    return GeoJsonAnswer(Item.model_validate({**found, "links": links}).model_dump_json())


async def _then(client: AsyncHullClient, name: str, page: Page) -> datetime | None:
    """The end of an interval, if it is past and the hull keeps its past; None for the present."""
    end = None if page.interval is None else page.interval.end
    if end is None or end >= datetime.now(UTC) or (await client.history(name)).history is None:
        return None
    return end


def _hull_of(collection: str) -> str | None:
    """The hull whose keys are the features; None for all hulls."""
    if collection == HULLS:
        return None
    if not collection.startswith(ENTITIES):
        raise _missing(f"there is no collection {collection!r}: it is {HULLS!r} or {ENTITIES!r} and a hull", collection)
    return collection.removeprefix(ENTITIES)


async def _info(client: AsyncHullClient, name: str, *, keyed: bool = False) -> HullInfo:
    """A geographic hull, with keys if that is asked for; ProblemError if there is none of that name."""
    async for info in client.list_hulls(name) if name.isascii() else _none():
        if info.name != name:
            break
        if not info.geographic:
            detail = (
                f"the hull {name!r} is in a plane, and OGC API Features serves longitudes and latitudes: "
                f"/hulls/{quote(name, safe='')} has its coordinates"
            )
            raise _missing(detail, name, "NOT_GEOGRAPHIC")
        if keyed and info.keyed is None:
            detail = f"the hull {name!r} has points without keys, so there are no entities: see /collections/hulls"
            raise _missing(detail, name, "NOT_KEYED")
        return info
    raise _missing(f"there is no hull {name!r}", name)


async def _none() -> AsyncIterator[HullInfo]:
    return
    yield


async def _hull_features(client: AsyncHullClient, page: Page) -> Matching:
    """Polygons of geographic hulls by name."""
    every = [info.name async for info in client.list_hulls() if info.geographic]
    names = [name for name in every if name > (page.after or "")]
    matched = len(every) if page.box is None else None
    found: list[dict[str, Any]] = []
    for start in range(0, len(names), ROUND):
        async with client.pipeline() as pipeline:
            asked = [pipeline.get_hull(name) for name in names[start : start + ROUND]]
        for answer in asked:
            try:
                shown = hull_feature(await answer)
            except HullNotFoundError:  # deleted in the meantime
                continue
            if page.box is not None and not page.box.meets(shown["geometry"]):
                continue
            if len(found) == page.most:
                return Matching(found, str(found[-1]["id"]), matched)
            found.append(shown)
    return Matching(found, None, matched)


async def _entity(client: AsyncHullClient, info: HullInfo, text: str) -> dict[str, Any]:
    """The feature of a key; ProblemError if the hull does not have it."""
    key: str | int = text
    if info.keyed == "int" and text.isdecimal() and len(text) <= 20:
        key = int(text)
    if isinstance(key, int) == (info.keyed == "int"):
        answer = await client.positions(info.name, [key])
        if answer.present[0]:
            time = None if answer.times is None else answer.times[0]
            return feature(key, answer.positions[0].tolist(), time)
    raise _missing(f"the hull {info.name!r} has no key {text!r}", text, "KEY_MISSING")


def _hulls(request: Request) -> Collection:
    return _collection(request, HULLS, "Hulls", "The polygon of each geographic hull, as it is now.")


def _entities(request: Request, name: str) -> Collection:
    made = _collection(request, f"{ENTITIES}{name}", f"Entities of {name}", f"The position of each key of {name}.")
    path = f"collections/{quote(made.id, safe='')}/schema"
    for rel in DESCRIBED_BY:
        made.links.append(_link(request, path, rel, SCHEMA, f"{made.title}: types of properties"))
    return made


def _collection(request: Request, ident: str, title: str, description: str) -> Collection:
    path = f"collections/{quote(ident, safe='')}"
    links = [
        _link(request, path, "self", JSON, title),
        _link(request, f"{path}/items", "items", GEOJSON, f"{title}: features"),
    ]
    return Collection(id=ident, title=title, description=description, links=links)


def _link(request: Request, path: str, rel: str, kind: str, title: str, query: dict[str, Any] | None = None) -> Link:
    href = _url(request, path) + (f"?{urlencode(query)}" if query else "")
    return Link(href=href, rel=rel, type=kind, title=title)


def _url(request: Request, path: str) -> str:
    return f"{request.base_url}{path}"


def _missing(detail: str, value: str, reason: str = "NOT_FOUND") -> ProblemError:
    return ProblemError(HTTPStatus.NOT_FOUND, detail, reason, value=value)
