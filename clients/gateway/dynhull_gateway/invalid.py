"""Values that do not match their declarations, as problem details."""

import re
from collections.abc import Iterable, Mapping, Sequence
from http import HTTPStatus
from typing import Any

from starlette.responses import Response

from .problems import Cause, cut, named, pointer, problem, said, shown
from .schemas import PATTERNS

SHOWN_ERRORS = 10
BODY = "body"
PARAMETERS = ("path", "query", "header")
# pydantic's words for those who read JSON.
WORDS = {
    "missing": "is required",
    "extra_forbidden": "there is no such field",
    "model_attributes_type": "must be an object",
    "model_type": "must be an object",
    "dict_type": "must be an object",
    "list_type": "must be an array",
}
SHOULD = re.compile(r"^\w+ should ")


def of_validation(errors: Iterable[Any], body: Any = None, **more: Any) -> Response:
    """The response for values that do not match their declarations.

    Args:
        errors: as pydantic reports them; the first part of each place is "body", "path", "query" or "header".
        body: the body as it was sent, to tell its fields from the alternatives of a declaration.
        more: further fields of the problem.
    """
    causes: dict[tuple[str | None, str | None], Cause] = {}
    paths = []
    for each in errors:
        path, cause = _cause(each, body)
        paths.append(path)
        known = causes.setdefault((cause.pointer, cause.parameter), cause)
        if cause.detail not in known.detail:  # one alternative of several
            known.detail = f"{known.detail}, or {cause.detail}"
    listed = list(causes.values())[:SHOWN_ERRORS]
    fields = {**named(listed[0], paths[0]), "errors": listed, **more}
    return problem(HTTPStatus.BAD_REQUEST, said(listed[0]), reason="INVALID_FIELD", **fields)


def detail(error: Mapping[str, Any]) -> str:
    """What is wrong, without the place."""
    if error["type"] == "json_invalid":
        return f"not JSON: {error.get('ctx', {}).get('error', '')}"
    if error["type"] == "literal_error":
        return f"must be {error['ctx']['expected']}".replace("'", '"')
    if error["type"] == "string_pattern_mismatch":
        return PATTERNS[error["ctx"]["pattern"]]
    text = str(error["msg"]).removeprefix("Value error, ").replace(" after validation", "")
    return WORDS.get(error["type"]) or SHOULD.sub("must ", text)


def path_in(body: Any, place: Sequence[str | int], *, absent: bool) -> list[str | int]:
    """The parts of a place that lead through a body; others name alternatives of a declaration.

    `absent`: the last part is a field that the body lacks.
    """
    path = []
    for number, part in enumerate(place):
        if isinstance(body, dict) and isinstance(part, str):
            if part not in body and not (absent and number == len(place) - 1):
                continue
            body = body.get(part)
        elif isinstance(body, list) and isinstance(part, int):
            body = body[part] if part < len(body) else None
        else:
            continue
        path.append(part)
    return path


def _cause(error: Mapping[str, Any], body: Any) -> tuple[list[str | int], Cause]:
    """The way to a value in the body, if it is there, and what is wrong with it."""
    place, *loc = error["loc"]
    shows_value = error["type"] not in ("missing", "json_invalid")
    if place in PARAMETERS:
        value = cut(str(error["input"])) if shows_value else None
        return [], Cause(detail=detail(error), parameter=str(loc[0]) if loc else None, value=value)
    path = [] if error["type"] == "json_invalid" else path_in(body, loc, absent=error["type"] == "missing")
    value = shown(error["input"]) if shows_value else None
    return path, Cause(detail=detail(error), pointer=pointer(path), value=value)
