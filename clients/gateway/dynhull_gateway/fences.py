"""Fences: create, list, read, replace, delete, and their durable consumers."""

from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, status

from dynhull_client import Circle, Fence, Polygon, Prefix

from . import examples, schemas
from .bodies import JsonRoute
from .callers import Caller
from .pages import page
from .schemas import After, ConsumerPath, FencePath, Limit

router = APIRouter(tags=["fences"], route_class=JsonRoute)
NamePrefix = Annotated[str, Query(max_length=200, description="Only names that begin with this.")]


@router.get("/fences")
async def list_fences(
    client: Caller, prefix: NamePrefix = "", after: After = "", limit: Limit = 100
) -> schemas.FencePage:
    """List fences by name, in pages."""
    fences, more = await page(client.list_fences(prefix), limit, lambda each: each.name <= after)
    return schemas.FencePage(fences=[_shown(each) for each in fences], next=fences[-1].name if more else None)


@router.post("/fences", status_code=status.HTTP_201_CREATED)
async def create_fence(
    client: Caller, fence: Annotated[schemas.NewFence, schemas.body(examples.FENCES)]
) -> schemas.Fence:
    """Create a fence: it compares subjects with an area, and makes an event when one enters or leaves."""
    return _shown(await client.create_fence(**arguments_of(fence)))


@router.get("/fences/{name}")
async def get_fence(client: Caller, name: FencePath) -> schemas.Fence:
    """A fence with its settings, its counts and its consumers."""
    return _shown(await client.get_fence(name))


@router.put("/fences/{name}")
async def replace_fence(
    client: Caller, name: FencePath, settings: Annotated[schemas.FenceSettings, schemas.body(examples.REPLACED)]
) -> schemas.Fence:
    """Replace the area and the settings of a fence; the subjects must stay the same."""
    return _shown(await client.replace_fence(name, **arguments_of(settings)))


@router.delete("/fences/{name}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_fence(client: Caller, name: FencePath) -> None:
    """Delete a fence and its events."""
    await client.delete_fence(name)


@router.get("/fences/{name}/inside")
async def fence_inside(client: Caller, name: FencePath) -> schemas.Inside:
    """The subjects that are inside, all at one moment."""
    return schemas.Inside.model_validate(await client.fence_inside(name))


@router.put("/fences/{name}/consumers/{consumer}")
async def ack_fence(
    client: Caller, name: FencePath, consumer: ConsumerPath, processed: schemas.Acknowledgement
) -> schemas.Consumer:
    """Acknowledge the events up to a sequence. A new consumer is created."""
    acknowledged = await client.ack_fence(name, consumer, processed.sequence, uid=processed.uid)
    return schemas.Consumer.model_validate(acknowledged)


@router.delete("/fences/{name}/consumers/{consumer}", status_code=status.HTTP_204_NO_CONTENT)
async def delete_consumer(client: Caller, name: FencePath, consumer: ConsumerPath) -> None:
    """Delete a durable consumer."""
    await client.delete_consumer(name, consumer)


def arguments_of(fence: schemas.FenceSettings) -> dict[str, Any]:
    """The settings as arguments of the SDK."""
    given = fence.arguments()
    prefix = given.pop("subject_prefix")
    if prefix is not None:
        if fence.subjects is not None:
            raise ValueError("give one of subjects, subject_prefix and other_hull")
        given["subjects"] = Prefix(prefix)
    given["area"] = _area(fence.area)
    return given


def _area(area: Any) -> Any:
    match area:
        case schemas.HullArea():
            return area.hull
        case schemas.CircleArea():
            x, y = area.center
            return Circle(x, y, area.radius)
        case schemas.GeometryArea():
            return area.model_dump()
        case schemas.PolygonArea():
            return Polygon(np.array(area.exterior), tuple(map(np.array, area.holes)))
        case [*parts]:
            return [_area(each) for each in parts]
        case _:
            raise TypeError(f"not an area: {area!r}")


def _shown(fence: Fence) -> schemas.Fence:
    subjects = fence.subjects
    of_prefix = isinstance(subjects, Prefix)
    shown = {name: getattr(fence, name, None) for name in schemas.Fence.model_fields}
    shown["subjects"] = None if of_prefix else subjects
    shown["subject_prefix"] = subjects.text if isinstance(subjects, Prefix) else None
    shown["area"] = _shown_area(fence.area)
    return schemas.Fence.model_validate(shown)


def _shown_area(area: Any) -> Any:
    match area:
        case str():
            return {"hull": area}
        case Circle():
            return {"center": [area.x, area.y], "radius": area.r}
        case Polygon():
            return {"exterior": area.exterior.tolist(), "holes": [hole.tolist() for hole in area.holes]}
        case [*parts]:
            return [_shown_area(each) for each in parts]
        case _:
            raise TypeError(f"not an area: {area!r}")
