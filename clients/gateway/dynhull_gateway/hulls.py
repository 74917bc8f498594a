"""Hulls: create, list, read, delete."""

import re
from functools import partial
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response, status

from dynhull_client import HeldPosition, Hull, Quarantine

from . import examples, schemas
from .as_of import At, as_of
from .bodies import GEOJSON, JSON, JsonRoute
from .callers import Caller
from .pages import page
from .problems import ProblemError
from .schemas import After, DividedPath, GlobePath, HullPath, Limit, MinRevision, Prefix, ProducerPath

router = APIRouter(tags=["hulls"], route_class=JsonRoute)
WEIGHT = re.compile(r"[01](\.\d{0,3})?")
Format = Annotated[
    Literal["json", "geojson"] | None,
    Query(description="json, or a GeoJSON Feature. Without it the header Accept decides; json is usual."),
]


@router.get("/hulls")
async def list_hulls(client: Caller, prefix: Prefix = "", after: After = "", limit: Limit = 100) -> schemas.HullPage:
    """List hulls by name, in pages. A caller with a token gets those it may read."""
    hulls, more = await page(client.list_hulls(prefix), limit, lambda each: each.name <= after)
    return schemas.HullPage(
        hulls=[schemas.HullInfo.model_validate(each) for each in hulls], next=hulls[-1].name if more else None
    )


@router.post("/hulls", status_code=status.HTTP_201_CREATED)
async def create_hull(
    client: Caller, hull: Annotated[schemas.NewHull, schemas.body(examples.HULLS)]
) -> schemas.HullInfo:
    """Create an empty hull."""
    return schemas.HullInfo.model_validate(await client.create_hull(**hull.arguments()))


AS_FEATURE: dict[int | str, dict[str, Any]] = {
    200: {"content": {GEOJSON: {"schema": {"$ref": "#/components/schemas/Feature"}}}}
}


@router.get("/hulls/{name}", response_model=schemas.Hull, responses=AS_FEATURE)
async def get_hull(
    request: Request,
    client: Caller,
    name: HullPath,
    response: Response,
    min_revision: MinRevision = 0,
    at: At = None,
    f: Format = None,
) -> Any:
    """The vertices with their keys, the size and the measures of a hull."""
    hull = await (await as_of(client, name, at)).get_hull(min_revision=min_revision)
    vary = {"Vary": "Accept"}
    if f == "geojson" or (f is None and prefers_geojson(request)):
        shown = schemas.Feature.model_validate(feature(hull)).model_dump_json()
        return Response(shown, headers=vary, media_type=GEOJSON)
    response.headers.update(vary)
    return schemas.Hull.model_validate(hull)


def prefers_geojson(request: Request) -> bool:
    """Whether the header Accept names GeoJSON, and JSON not before it (RFC 9110, 12.5.1)."""
    weights = {}
    for each in request.headers.get("accept", "").lower().split(","):
        kind, *parameters = (part.strip() for part in each.split(";"))
        weight = next((part.removeprefix("q=") for part in parameters if part.startswith("q=")), "1")
        weights[kind] = float(weight) if WEIGHT.fullmatch(weight) else 0.0
    return weights.get(GEOJSON, 0.0) > weights.get(JSON, 0.0)


@router.delete("/hulls/{name}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_hull(client: Caller, name: HullPath) -> None:
    """Delete a hull and its points. Its events end."""
    await client.delete_hull(name)


@router.post("/hulls/{name}/recenter")
async def recenter(
    client: Caller, name: GlobePath, to: Annotated[schemas.Recenter, schemas.body(examples.CENTER)]
) -> schemas.HullInfo:
    """Move the centre of a geographic hull."""
    return schemas.HullInfo.model_validate(
        await client.recenter(name, None if to.center is None else (to.center[0], to.center[1]))
    )


@router.post("/hulls/{name}/reshard")
async def reshard(
    client: Caller, name: DividedPath, to: Annotated[schemas.Reshard, schemas.body(examples.SHARDS)]
) -> schemas.HullInfo:
    """Divide the points of a hull over shards among another number of shards. Batches wait until that is done."""
    return schemas.HullInfo.model_validate(await client.reshard(name, to.shards))


@router.get("/hulls/{name}/history")
async def history(client: Caller, name: HullPath) -> schemas.History:
    """What is there of the past of a hull."""
    return schemas.History.model_validate(await client.history(name))


@router.put("/hulls/{name}/history")
async def set_history(client: Caller, name: HullPath, kept: schemas.KeptHistory) -> schemas.HullInfo:
    """Change how much of its past a hull keeps. What is to be kept no longer is gone within a minute."""
    return schemas.HullInfo.model_validate(await client.set_history(name, kept.history, kept.history_bytes))


@router.post("/hulls/{name}/history/erase")
async def erase_history(client: Caller, name: HullPath, erased: schemas.ErasedKeys) -> schemas.Erasure | None:
    """Erase keys from the past of a hull, which then is as if they had never been in it.

    Keys that the hull has now are refused. The token needs to be allowed to write the hull, and to read its past. Null
    if no segment had any of the keys.
    """
    found = await client.erase_history(name, erased.keys)
    return None if found is None else schemas.Erasure.model_validate(found)


@router.put("/hulls/{name}/quarantine")
async def set_quarantine(client: Caller, name: HullPath, rules: schemas.QuarantineRules) -> schemas.HullInfo:
    """Replace the rules that hold bad positions out of a keyed hull. What is held stays so."""
    return schemas.HullInfo.model_validate(await client.set_quarantine(name, Quarantine(**rules.arguments())))


@router.get("/hulls/{name}/held")
async def list_held(
    client: Caller,
    name: HullPath,
    after: Annotated[
        str, Query(max_length=255, description="Only keys after this one: the last of the page before.")
    ] = "",
    limit: Limit = 100,
) -> schemas.HeldPage:
    """List the positions in quarantine by key, in pages. Batches `release` and `drop` them."""
    held, more = await page(client.list_held(name), limit, partial(_passed, after))
    following = str(held[-1].key) if more else None
    return schemas.HeldPage(held=[schemas.HeldPosition.model_validate(each) for each in held], next=following)


def _passed(after: str, held: HeldPosition) -> bool:
    """Whether a position is of a page that ends with the key `after`; empty for none."""
    if not after or isinstance(held.key, str):
        return str(held.key) <= after
    if not (after.isascii() and after.isdecimal()):
        raise ProblemError(
            400, f"after is {after!r}: the keys of the hull are integers", "INVALID_FIELD", field="after"
        )
    return held.key <= int(after)


@router.get("/hulls/{name}/producers/{producer}")
async def last_sequence(client: Caller, name: HullPath, producer: ProducerPath) -> schemas.LastSequence:
    """The last number of a producer that was applied: continue with the next one."""
    return schemas.LastSequence(last_sequence=await client.last_sequence(name, producer))


def feature(hull: Hull) -> dict[str, Any]:
    """A hull as a GeoJSON Feature, also before its first point."""
    return {**hull.__geo_interface__, "geometry": geometry(hull)}


def geometry(hull: Hull) -> dict[str, Any] | None:
    """The polygon of a hull, or what is left of it; None without points."""
    return hull.__geo_interface__["geometry"] if len(hull.vertices) else None
