"""Hulls: create, list, read, delete."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response, status

from dynhull_client import Hull

from . import schemas
from .bodies import GEOJSON, JsonRoute
from .callers import Caller
from .pages import page
from .schemas import After, HullPath, Limit, MinRevision, Prefix, ProducerPath

router = APIRouter(tags=["hulls"], route_class=JsonRoute)
Format = Annotated[Literal["json", "geojson"], Query(description="json, or a GeoJSON Feature.")]


@router.get("/hulls")
async def list_hulls(client: Caller, prefix: Prefix = "", after: After = "", limit: Limit = 100) -> schemas.HullPage:
    """List hulls by name, in pages. A caller with a token gets those it may read."""
    hulls, following = await page(client.list_hulls(prefix), after, limit)
    return schemas.HullPage(hulls=[schemas.HullInfo.model_validate(each) for each in hulls], next=following)


@router.post("/hulls", status_code=status.HTTP_201_CREATED)
async def create_hull(client: Caller, hull: schemas.NewHull) -> schemas.HullInfo:
    """Create an empty hull."""
    return schemas.HullInfo.model_validate(await client.create_hull(**hull.arguments()))


AS_FEATURE: dict[int | str, dict[str, Any]] = {
    200: {"content": {GEOJSON: {"schema": {"$ref": "#/components/schemas/Feature"}}}}
}


@router.get("/hulls/{name}", response_model=schemas.Hull, responses=AS_FEATURE)
async def get_hull(
    client: Caller,
    name: HullPath,
    min_revision: MinRevision = 0,
    f: Format = "json",
) -> Any:
    """The vertices with their keys, the size and the measures of a hull."""
    hull = await client.get_hull(name, min_revision=min_revision)
    if f == "geojson":
        return Response(schemas.Feature.model_validate(feature(hull)).model_dump_json(), media_type=GEOJSON)
    return schemas.Hull.model_validate(hull)


@router.delete("/hulls/{name}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_hull(client: Caller, name: HullPath) -> None:
    """Delete a hull and its points. Its events end."""
    await client.delete_hull(name)


@router.post("/hulls/{name}/recenter")
async def recenter(client: Caller, name: HullPath, to: schemas.Recenter) -> schemas.HullInfo:
    """Move the centre of a geographic hull."""
    return schemas.HullInfo.model_validate(
        await client.recenter(name, None if to.center is None else (to.center[0], to.center[1]))
    )


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
