"""Questions about a hull."""

from typing import Annotated, Any

from fastapi import APIRouter, Query

from . import examples, schemas
from .as_of import At, as_of
from .bodies import JsonRoute
from .callers import Caller
from .numbers import SPAN, DaySpan
from .schemas import AlloyPath, AssetsPath, HullPath, MinRevision, Name

router = APIRouter(prefix="/hulls/{name}", tags=["questions"], route_class=JsonRoute)
Other = Annotated[Name, Query(description="The other hull.", examples=["alloy"])]
Layer = Annotated[
    int,
    Query(ge=1, le=1000, description="The convex layer to ask; 1 is the hull, and a layer without points is empty."),
]
LayerCount = Annotated[int, Query(ge=1, le=1000, description="The number of layers, from the outermost.")]
SampleSize = Annotated[int, Query(ge=1, le=100_000, description="The most points.")]
WithKeys = Annotated[bool, Query(description="Whether to name the points, in a keyed hull.")]
AboutPointsOrKeys = Annotated[schemas.AboutPointsOrKeys, schemas.body(examples.ABOUT)]
Last = Annotated[
    DaySpan | None,
    Query(description=f"{SPAN}: rows since then, and the one before them. All that are kept by default."),
]
OtherRevision = Annotated[int, Query(ge=0, le=schemas.LARGEST, description="A revision of the other hull to wait for.")]


def _about(question: schemas.AboutPointsOrKeys) -> dict[str, Any]:
    about = question.arguments()
    return {"xy": about.pop("points"), **about, "keys_of": question.keys_of or ""}


@router.post("/locate")
async def locate(
    client: Caller,
    name: HullPath,
    question: AboutPointsOrKeys,
    layer: Layer = 1,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Located:
    """The side of each point or key: inside, on the boundary or outside. Exact."""
    answer = await (await as_of(client, name, at)).locate(**_about(question), layer=layer, min_revision=min_revision)
    return schemas.Located.model_validate(answer)


@router.post("/distance")
async def distance(
    client: Caller,
    name: HullPath,
    question: AboutPointsOrKeys,
    layer: Layer = 1,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Distances:
    """The distance of each point or key to the hull; of a geographic hull in metres."""
    answer = await (await as_of(client, name, at)).distance(**_about(question), layer=layer, min_revision=min_revision)
    return schemas.Distances.model_validate(answer)


@router.post("/count")
async def count(
    client: Caller, name: HullPath, question: schemas.AboutPoints, min_revision: MinRevision = 0, at: At = None
) -> schemas.Counted:
    """How often the hull holds each point."""
    return schemas.Counted.model_validate(
        await (await as_of(client, name, at)).count(question.points, min_revision=min_revision)
    )


@router.post("/support")
async def support(
    client: Caller,
    name: HullPath,
    question: schemas.Directions,
    layer: Layer = 1,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Supported:
    """The extreme vertex in each direction. Exact."""
    answer = await (await as_of(client, name, at)).support(
        question.directions, keys=question.keys, layer=layer, min_revision=min_revision
    )
    return schemas.Supported.model_validate(answer)


@router.post("/tangents")
async def tangents(
    client: Caller,
    name: HullPath,
    question: schemas.AboutPoints,
    layer: Layer = 1,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Tangents:
    """The tangent points seen from each point. Exact."""
    return schemas.Tangents.model_validate(
        await (await as_of(client, name, at)).tangents(question.points, layer=layer, min_revision=min_revision)
    )


@router.post("/intersect-lines")
async def intersect_lines(
    client: Caller,
    name: HullPath,
    question: schemas.Lines,
    layer: Layer = 1,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Crossings:
    """Where each line enters and leaves the hull."""
    answer = await (await as_of(client, name, at)).intersect_lines(
        question.origins, question.targets, layer=layer, min_revision=min_revision
    )
    return schemas.Crossings.model_validate(answer)


@router.post("/positions")
async def positions(
    client: Caller, name: HullPath, question: schemas.AboutKeys, min_revision: MinRevision = 0, at: At = None
) -> schemas.Positions:
    """The positions of keys."""
    return schemas.Positions.model_validate(
        await (await as_of(client, name, at)).positions(question.keys, min_revision=min_revision)
    )


@router.get("/entities")
async def entities(client: Caller, name: HullPath, min_revision: MinRevision = 0, at: At = None) -> schemas.Entities:
    """All keys of a keyed hull with their positions, at one revision."""
    return schemas.Entities.model_validate(await (await as_of(client, name, at)).entities(min_revision=min_revision))


@router.get("/sample")
async def sample_points(
    client: Caller,
    name: HullPath,
    size: SampleSize = 1000,
    keys: WithKeys = False,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Sampled:
    """A sample of the points, for drawing."""
    answer = await (await as_of(client, name, at)).sample_points(size, keys=keys, min_revision=min_revision)
    return schemas.Sampled.model_validate(answer)


@router.get("/layers")
async def layers(
    client: Caller,
    name: HullPath,
    count: LayerCount = 10,
    keys: WithKeys = False,
    min_revision: MinRevision = 0,
    at: At = None,
) -> schemas.Layers:
    """The outermost convex layers: each is the hull of the points left without the vertices of those before. Exact."""
    return schemas.Layers.model_validate(
        await (await as_of(client, name, at)).layers(count, keys=keys, min_revision=min_revision)
    )


@router.get("/influence")
async def influence(
    client: Caller, name: HullPath, keys: WithKeys = False, min_revision: MinRevision = 0, at: At = None
) -> schemas.Influence:
    """The area that the hull would lose without each of its vertices."""
    return schemas.Influence.model_validate(
        await (await as_of(client, name, at)).influence(keys=keys, min_revision=min_revision)
    )


@router.get("/measures")
async def get_measures(
    client: Caller, name: HullPath, layer: Layer = 1, min_revision: MinRevision = 0, at: At = None
) -> schemas.AllMeasures:
    """All measures: also diameter, width, smallest boxes and smallest circle."""
    return schemas.AllMeasures.model_validate(
        await (await as_of(client, name, at)).get_measures(layer=layer, min_revision=min_revision)
    )


@router.get("/series")
async def series(client: Caller, name: HullPath, last: Last = None) -> schemas.Series:
    """How counts and measures were over the last hour: a row about every ten seconds in which the hull changed."""
    return schemas.Series.model_validate(await client.series(name, last))


@router.get("/verification")
async def verify(client: Caller, name: HullPath, min_revision: MinRevision = 0, at: At = None) -> schemas.Verification:
    """Compare the live hull with one that Chan's algorithm computes from the stored points."""
    return schemas.Verification.model_validate(await (await as_of(client, name, at)).verify(min_revision=min_revision))


@router.get("/separation")
async def separate(
    client: Caller, name: HullPath, other: Other, min_revision: MinRevision = 0, other_min_revision: OtherRevision = 0
) -> schemas.Separation:
    """The distance of two hulls, or the depth of their overlap."""
    answer = await client.separate(name, other, min_revision=min_revision, other_min_revision=other_min_revision)
    return schemas.Separation.model_validate(answer)


@router.post("/phase-diagram")
async def phase_diagram(
    client: Caller, name: AlloyPath, question: schemas.Entries, min_revision: MinRevision = 0
) -> schemas.Phases:
    """The hull as a binary phase diagram: its points are compositions from 0 to 1 and energies."""
    answer = await client.phase_diagram(name, question.entries, min_revision=min_revision)
    return schemas.Phases.model_validate(answer)


@router.post("/frontier")
async def frontier(
    client: Caller, name: AssetsPath, question: schemas.FrontierQuestion, min_revision: MinRevision = 0
) -> schemas.Efficient:
    """The hull as an efficient frontier: its points are risks and returns."""
    answer = await client.frontier(name, question.points, question.rates, min_revision=min_revision)
    return schemas.Efficient.model_validate(answer)
