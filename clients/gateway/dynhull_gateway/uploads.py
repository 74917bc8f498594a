"""Bodies of rows: read as they arrive, applied in batches."""

from collections.abc import AsyncIterator
from http import HTTPStatus
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request

from dynhull_cli.reading.labels import LabelReader
from dynhull_cli.reading.time_forms import AMBIGUOUS, FORMAT, ZONE, Ambiguous, TimeForm, TimeUnit, time_form
from dynhull_cli.reading.values import BadValueError
from dynhull_client import DynhullError

from . import rows, schemas
from .bodies import JsonRoute, require_type
from .callers import Caller
from .numbers import SPAN, Lifetime
from .points import numbered
from .problems import ProblemError, problem
from .refusals import of_refused_rows
from .rows import LABELS, Reader, RowError
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

MaxBad = Annotated[int, Query(ge=0, le=2**31 - 1, description="Bad rows that are left out; one more ends the call.")]
TimeUnits = Annotated[
    TimeUnit | None,
    Query(description="Unit of times that are numbers: s, ms, us or ns; by default by the size of the first one."),
]
TimeZone = Annotated[str | None, Query(max_length=100, description=ZONE)]
TimeFormat = Annotated[str | None, Query(min_length=1, max_length=100, description=FORMAT)]
OfAmbiguous = Annotated[Ambiguous, Query(description=AMBIGUOUS)]
OnlyKeys = Annotated[
    Literal["absent", "present"] | None, Query(description="Which keys are put: only new ones, or only known ones.")
]
TimeToLive = Annotated[
    Lifetime | None,
    Query(description=f"Time after which the keys leave. {SPAN}."),
]


@router.post("/hulls/{name}/rows", response_model=schemas.Uploaded, openapi_extra=BODY)
async def upload_rows(
    request: Request,
    client: Caller,
    name: HullPath,
    delete: Delete = False,
    keys: KeyKind = "auto",
    coalesce: Coalesce = False,
    max_bad: MaxBad = 0,
    time_unit: TimeUnits = None,
    time_zone: TimeZone = None,
    ambiguous: OfAmbiguous = Ambiguous.REFUSE,
    time_format: TimeFormat = None,
    only: OnlyKeys = None,
    ttl: TimeToLive = None,
    idempotency_key: IdempotencyKey = None,
    may_skip: MaySkip = False,
) -> Any:
    """Insert points or put keys, one a row, from a body of any length: newline-delimited JSON, CSV or GeoJSON.

    The rows are applied in batches of up to 8192 while the body arrives. A row that cannot be read, or that the server
    refuses, ends the call, unless it is one of `max_bad` that may be left out: the problem names it, and how many rows
    before it were applied. With an Idempotency-Key, the body can be sent again, or continued after the last number that
    was applied: no row is applied twice.
    """
    kind = require_type(request, TYPES)
    if delete and kind.startswith("application/geo+json") and keys != "none":
        keys = "none"
    form = _form(time_unit, time_zone, ambiguous, time_format)
    producer, first = numbered(idempotency_key)
    numbers = await numbering(client, name, producer, first, may_skip=may_skip) if producer else None
    upload = Upload(
        client,
        name,
        numbers,
        delete=delete,
        keep_last=coalesce,
        max_bad=max_bad,
        conditions={"only": only, "ttl": ttl},
    )
    labels = LabelReader(*LABELS, form=form, optional=True)
    try:
        return await _uploaded(request, upload, _reader(kind, labels, delete=delete), TYPES[kind], keys)
    finally:
        request.app.state.figures.rows.inc(upload.settled)


def _form(unit: TimeUnit | None, zone: str | None, ambiguous: Ambiguous, form: str | None) -> TimeForm:
    try:
        return time_form(str, unit, zone, ambiguous, form)
    except BadValueError as error:
        raise ProblemError(
            HTTPStatus.BAD_REQUEST, str(error), "INVALID_FIELD", field=error.name, value=error.value
        ) from None


async def _uploaded(request: Request, upload: Upload, read: Reader, mark: bytes | None, keys: Any) -> Any:
    try:
        async for some in _texts(request, mark, upload):
            found = read(some)
            await upload.add(found if keys == "auto" else rows.with_keys(found, None if keys == "none" else keys))
        return await upload.finish()
    except RowError as error:
        await upload.close()
        return problem(
            HTTPStatus.BAD_REQUEST,
            f"row {error.row}{f', {error.field}' if error.field else ''}: {error.detail}",
            reason="INVALID_FIELD",
            field=error.field,
            row=error.row,
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


async def _texts(request: Request, mark: bytes | None, upload: Upload) -> AsyncIterator[list[bytes]]:
    """The texts of the body: lines, records, or all of it."""
    if mark is None:
        yield [await request.body()]
        return
    try:
        async for found in texts(request.stream(), mark):
            yield found
    except RowError as error:  # a text is too long
        error.row += upload.read
        raise


def _reader(kind: str, labels: LabelReader, *, delete: bool) -> Reader:
    if kind == "text/csv":
        return rows.Csv(labels, delete=delete)
    if kind.startswith("application/geo+json"):
        return rows.GeoJson(labels)
    return rows.Ndjson(labels, delete=delete)
