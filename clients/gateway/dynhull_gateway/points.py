"""Changes of points and keys."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from pydantic import TypeAdapter

from dynhull_client import Batch as ClientBatch

from . import examples, schemas
from .bodies import JSON, JsonRoute, keep, require_type
from .callers import Caller, client_of, described, token_of
from .changes import apply, check, encoded
from .schemas import AnyHullPath, Batch, IdempotencyKey, MaySkip, Points, Transfer
from .texts import BYTE_ORDER_MARK

router = APIRouter(tags=["changes"], route_class=JsonRoute)
POINTS = TypeAdapter(Points)
NO_CHANGE = Batch.model_construct()
FIRST_OF_LIST = b"["

BODY = {
    "requestBody": {
        "required": True,
        "content": {
            JSON: {
                "schema": {"anyOf": [{"$ref": "#/components/schemas/Batch"}, POINTS.json_schema()]},
                "examples": examples.POINTS,
            }
        },
    }
}


@router.post("/hulls/{name}/points", response_model=schemas.Applied, openapi_extra=BODY)
async def change_points(
    request: Request,
    name: AnyHullPath,
    _: Annotated[object, Depends(described)],
    idempotency_key: IdempotencyKey = None,
    may_skip: MaySkip = False,
) -> Response:
    """Apply changes: a batch or a list of points to insert as JSON, all or nothing.

    Small batches of many requests without an Idempotency-Key may be applied together.
    """
    require_type(request, (JSON,))
    body = await request.body()
    keep(request, body)
    batch = read_batch(body)
    client = client_of(request)
    if idempotency_key is None:
        return Response(await request.app.state.gatherer.apply(client, token_of(request), name, batch), media_type=JSON)
    producer, sequence = numbered(idempotency_key)
    applied = await apply(client, name, batch, producer=producer, sequence=sequence, may_skip=may_skip)
    return Response(encoded(applied), media_type=JSON)


@router.post("/transfers")
async def transfer(
    client: Caller,
    batches: Annotated[Transfer, schemas.body(examples.TRANSFERS)],
    idempotency_key: IdempotencyKey = None,
    may_skip: MaySkip = False,
) -> schemas.Transferred:
    """Apply a batch to each of several hulls: all of them or none."""
    producer, sequence = numbered(idempotency_key)
    for name, batch in batches.batches.items():
        check(batch, "batches", name)
    made = {name: ClientBatch(**_arguments(batch)) for name, batch in batches.batches.items()}
    results = await client.transfer(made, producer=producer, sequence=sequence, may_skip=may_skip)
    return schemas.Transferred(results={name: schemas.Applied.model_validate(each) for name, each in results.items()})


def _arguments(batch: Batch) -> dict[str, Any]:
    given = batch.arguments()
    if batch.move is not None:
        given["move"] = batch.move.origins, batch.move.destinations
    return given


def read_batch(body: bytes) -> Batch:
    """The batch in a body of JSON; pydantic's ValidationError or FieldError names the value at fault."""
    body = body.removeprefix(BYTE_ORDER_MARK)
    if body.lstrip()[:1] == FIRST_OF_LIST:
        return NO_CHANGE.model_copy(update={"insert": POINTS.validate_json(body)})
    batch = Batch.model_validate_json(body)
    check(batch)
    return batch


def numbered(key: str | None) -> tuple[str, int]:
    """The producer and the sequence in an Idempotency-Key; an empty name and 0 without."""
    if key is None:
        return "", 0
    producer, _, sequence = key.strip('"').rpartition(":")
    return producer, int(sequence)
