"""Parameters that would be left out in silence are refused: misspelled ones, and a number that is given twice."""

from difflib import get_close_matches
from http import HTTPStatus

from fastapi import Request

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
    """Raise ProblemError for the first parameter that the description of a request's route does not have."""
    if not request.query_params:
        return
    operation = request.app.openapi()["paths"][request.scope["route"].path_format][request.method.lower()]
    known = [each["name"] for each in operation.get("parameters", ()) if each["in"] == "query"]
    for name in request.query_params:
        if name not in known:
            near = get_close_matches(name, known, 1)
            what = f"did you mean {near[0]}?" if near else f"here are {', '.join(known) or 'none'}"
            detail = f"there is no parameter {cut(name)}: {what}"
            raise ProblemError(HTTPStatus.BAD_REQUEST, detail, "INVALID_FIELD", field=cut(name))
