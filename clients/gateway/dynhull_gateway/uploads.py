"""Bodies of rows: read as they arrive, applied in batches."""

from collections.abc import AsyncIterator
from http import HTTPStatus
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request

from dynhull_client import DynhullError

from . import rows, schemas
from .bodies import JsonRoute, require_type
from .callers import Caller
from .points import numbered
from .problems import ProblemError, problem
from .refusals import of_refused_rows
from .rows import Reader, RowError
from .schemas import HullPath, IdempotencyKey, MaySkip
from .texts import LINE, RECORD, texts
from .upload import Upload, numbering

router = APIRouter(tags=["changes"], route_class=JsonRoute)

TYPES: dict[str, bytes | None] = {
    "application/x-ndjson": LINE,
    "application/ndjson": LINE,
    "application/jsonl": LINE,
    "text/csv": LINE,
    "application/geo+json": None,
    "application/geo+json-seq": RECORD,
}
FEATURE = (
    '{"type": "Feature", "id": "LH400", "geometry": {"type": "Point", "coordinates": [1, 2]}, '
    '"properties": {"time": "2026-01-31T12:00:00Z"}}'
)
EXAMPLES = {
    "application/x-ndjson": '{"key": "LH400", "x": 1, "y": 2}\n{"key": "BA117", "x": 4, "y": 1}\n',
    "text/csv": "key,x,y\nLH400,1,2\nBA117,4,1\n",
    "application/geo+json": FEATURE,
    "application/geo+json-seq": f"\x1e{FEATURE}\n",
}
BODY = {
    "requestBody": {
        "required": True,
        "content": {kind: {"schema": {"type": "string"}, "example": example} for kind, example in EXAMPLES.items()},
    }
}
Delete = Annotated[bool, Query(description="Delete the points, or remove the keys, rather than insert or put them.")]
KeyKind = Annotated[
    Literal["auto", "none", "str", "int"],
    Query(description="Kind of the keys; auto for the kind that they have in the body, none to leave them out."),
]
Coalesce = Annotated[
    bool, Query(description="Whether only the last of several positions of a key in a batch of 8192 rows is applied.")
]


@router.post("/hulls/{name}/rows", response_model=schemas.Uploaded, openapi_extra=BODY)
async def upload_rows(
    request: Request,
    client: Caller,
    name: HullPath,
    delete: Delete = False,
    keys: KeyKind = "auto",
    coalesce: Coalesce = False,
    idempotency_key: IdempotencyKey = None,
    may_skip: MaySkip = False,
) -> Any:
    """Insert points or put keys, one a row, from a body of any length: newline-delimited JSON, CSV or GeoJSON.

    The rows are applied in batches of up to 8192 while the body arrives. A row that cannot be read ends the call: the
    problem names it, and how many rows before it were applied. With an Idempotency-Key, the body can be sent again, or
    continued after the last number that was applied: no row is applied twice.
    """
    kind = require_type(request, TYPES)
    if delete and kind.startswith("application/geo+json") and keys != "none":
        keys = "none"
    producer, first = numbered(idempotency_key)
    numbers = await numbering(client, name, producer, first, may_skip=may_skip) if producer else None
    upload = Upload(client, name, numbers, delete=delete, keep_last=coalesce)
    try:
        return await _uploaded(request, upload, _reader(kind, delete=delete), TYPES[kind], keys)
    finally:
        request.app.state.figures.rows.inc(upload.settled)


async def _uploaded(request: Request, upload: Upload, read: Reader, mark: bytes | None, keys: str) -> Any:
    at = 0
    try:
        async for found in _found(request, mark):
            at = upload.read
            read_rows = read(found)
            if keys != "auto":
                read_rows = rows.with_keys(read_rows, None if keys == "none" else keys)
            await upload.add(read_rows)
            at = upload.read
        return await upload.finish()
    except RowError as error:
        await upload.close()
        return problem(
            HTTPStatus.BAD_REQUEST,
            f"row {at + error.row}{f', {error.field}' if error.field else ''}: {error.detail}",
            reason="INVALID_FIELD",
            field=error.field,
            row=at + error.row,
            value=error.value,
            applied=upload.settled,
        )
    except ProblemError as error:
        await upload.close()
        return problem(error.status_code, error.detail, reason=error.reason, applied=upload.settled, **error.more)
    except (DynhullError, ValueError) as error:  # a ValueError is the SDK's, about a row
        await upload.close()
        return of_refused_rows(error, upload.settled)
    finally:
        await upload.close()


async def _found(request: Request, mark: bytes | None) -> AsyncIterator[list[bytes]]:
    """The texts of the body: lines, records, or all of it."""
    if mark is None:
        yield [await request.body()]
        return
    async for found in texts(request.stream(), mark):
        yield found


def _reader(kind: str, *, delete: bool) -> Reader:
    if kind == "text/csv":
        return rows.Csv(delete=delete)
    if kind.startswith("application/geo+json"):
        return rows.geojson
    return rows.ndjson_to_delete if delete else rows.ndjson
