"""Parameters that would be left out in silence are refused: misspelled ones, and a number that is given twice."""

from difflib import get_close_matches
from http import HTTPStatus

from fastapi import Request
from fastapi.dependencies.models import Dependant
from pydantic import BaseModel

from .problems import ProblemError, cut

IDEMPOTENCY_KEY = "Idempotency-Key"


async def require_one_number(request: Request) -> None:
    """Raise ProblemError if a request has two numbers: whichever is taken, the other one would seem to be applied."""
    keys = request.headers.getlist(IDEMPOTENCY_KEY)
    if len(keys) > 1:
        detail = f"{IDEMPOTENCY_KEY}: the header is given {len(keys)} times: give it once"
        more = {"field": IDEMPOTENCY_KEY, "value": cut(", ".join(keys))}
        raise ProblemError(HTTPStatus.BAD_REQUEST, detail, "INVALID_FIELD", **more)


async def require_known(request: Request) -> None:
    """Raise ProblemError for the first parameter that a request's route does not take."""
    if not request.query_params:
        return
    known = taken(request.scope["route"].dependant)
    for name in request.query_params:
        if name not in known:
            near = get_close_matches(name, known, 1)
            what = f"did you mean {near[0]}?" if near else f"here are {', '.join(known) or 'none'}"
            detail = f"there is no parameter {cut(name)}: {what}"
            raise ProblemError(HTTPStatus.BAD_REQUEST, detail, "INVALID_FIELD", field=cut(name))


def taken(dependant: Dependant) -> list[str]:
    """The names of the query parameters of a route, or of what it depends on, as its description has them.

    Not from the description: to make it takes half a second, in which nobody else is answered.
    """
    names: list[str] = []
    for field in dependant.query_params:
        kind = field.field_info.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            names += [each.alias or name for name, each in kind.model_fields.items()]
        else:
            names.append(field.alias)
    for each in dependant.dependencies:
        names += taken(each)
    return names
