"""Parameters that would be left out in silence are refused: misspelled ones, and what is given twice."""

from collections import Counter
from collections.abc import Sequence
from difflib import get_close_matches
from http import HTTPStatus
from typing import Any, get_args, get_origin

from fastapi import Request
from fastapi.dependencies.models import Dependant
from pydantic import BaseModel

from .problems import ProblemError, cut

ONCE = "Idempotency-Key", "Last-Event-ID"


async def require_once(request: Request) -> None:
    """Raise ProblemError if a header is given twice: whichever is taken, the other one would seem to be applied."""
    for name in ONCE:
        given = request.headers.getlist(name)
        if len(given) > 1:
            detail = f"{name}: the header is given {len(given)} times: give it once"
            raise ProblemError(HTTPStatus.BAD_REQUEST, detail, "INVALID_FIELD", field=name, value=cut(", ".join(given)))


async def require_known(request: Request) -> None:
    """Raise ProblemError for the first parameter that a request's route does not take, or takes once and has twice."""
    if not request.query_params:
        return
    known = taken(request.scope["route"].dependant)
    for name, times in Counter(name for name, _ in request.query_params.multi_items()).items():
        if name not in known:
            near = get_close_matches(name, known, 1)
            what = f"did you mean {near[0]}?" if near else f"here are {', '.join(known) or 'none'}"
            detail = f"there is no parameter {cut(name)}: {what}"
            raise ProblemError(HTTPStatus.BAD_REQUEST, detail, "INVALID_FIELD", field=cut(name))
        if times > 1 and not known[name]:
            detail = f"{name}: the parameter is given {times} times: give it once"
            value = cut(", ".join(request.query_params.getlist(name)))
            raise ProblemError(HTTPStatus.BAD_REQUEST, detail, "INVALID_FIELD", field=name, value=value)


def taken(dependant: Dependant) -> dict[str, bool]:
    """The query parameters of a route, or of what it depends on, by their names: whether each may be given repeatedly.

    Not from the description: to make it takes half a second, in which nobody else is answered.
    """
    found: dict[str, bool] = {}
    for field in dependant.query_params:
        kind = field.field_info.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            found |= {each.alias or name: _is_list(each.annotation) for name, each in kind.model_fields.items()}
        else:
            found[field.alias] = _is_list(kind)
    for each in dependant.dependencies:
        found |= taken(each)
    return found


def _is_list(kind: Any) -> bool:
    origins = (get_origin(each) for each in (kind, *get_args(kind)))
    return any(isinstance(each, type) and issubclass(each, Sequence) for each in origins)
