"""Responses that are answers of the SDK: their fields, types and meanings are those of its dataclasses."""

import dataclasses
import inspect
import re
from collections.abc import Callable, Collection
from datetime import timedelta
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, BeforeValidator, Field, create_model

Answer = TypeVar("Answer", bound=BaseModel)
ATTRIBUTE = re.compile(r"^    (\w+): (.*(?:\n     .*)*)", re.MULTILINE)


def rows(value: Any) -> Any:
    """An array as lists; None for what is not finite."""
    if not isinstance(value, np.ndarray):
        return value
    return value.tolist() if np.isfinite(value).all() else np.where(np.isfinite(value), value, np.array(None)).tolist()


def finite(value: Any) -> Any:
    """A number; None for one that JSON does not have."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def seconds(value: Any) -> Any:
    """A time span as seconds."""
    return value.total_seconds() if isinstance(value, timedelta) else value


def listed(value: Any) -> Any:
    """A tuple as a list."""
    return list(value) if isinstance(value, tuple) else value


Finite = Annotated[float | None, BeforeValidator(finite)]
Place = Annotated[list[Finite], Field(min_length=2, max_length=2), BeforeValidator(listed)]
Rows = Annotated[list[Place], BeforeValidator(rows)]
Span = Annotated[float | None, BeforeValidator(seconds)]
TYPES: dict[Any, Any] = {
    float: Finite,
    timedelta: Span,
    tuple[float, float]: Place,
    tuple[float, float, float, float]: Annotated[
        list[Finite], Field(min_length=4, max_length=4), BeforeValidator(listed)
    ],
    npt.NDArray[np.float64]: Rows,
    npt.NDArray[np.int8]: Annotated[list[int], BeforeValidator(rows)],
}
# Responses that have been made, by their answers: parts of others.
MADE: dict[type, Any] = {}


def answering(
    answer: type, fields: Collection[str] | None = None, *, partial: bool = False, finite: bool = False
) -> Callable[[type[Answer]], type[Answer]]:
    """A response with the fields of an answer of the SDK; those that it declares itself have another form there.

    Args:
        answer: the dataclass.
        fields: the names of its fields that are answered; None for all.
        partial: whether fields with their usual value are left out.
        finite: whether its numbers are finite, so that none of them is null.
    """
    meanings = dict(ATTRIBUTE.findall(inspect.getdoc(answer) or ""))
    types = get_type_hints(answer)

    def complete(response: type[Answer]) -> type[Answer]:
        own: dict[str, Any] = {name: (each.annotation, each) for name, each in response.model_fields.items()}
        found: dict[str, Any] = {}
        for each in dataclasses.fields(answer):
            if fields is not None and each.name not in fields:
                continue
            kind = types[each.name]
            usual = each.default if partial and each.default is not dataclasses.MISSING else ...
            about = Field(usual, description=_meaning(meanings.get(each.name), kind))
            found[each.name] = own.get(each.name) or (kind if finite and kind is float else _type(kind), about)
        made = create_model(
            response.__name__, __base__=response.__base__, __doc__=response.__doc__, __module__=__name__, **found | own
        )
        if fields is None:
            MADE[answer] = made
        return cast("type[Answer]", made)

    return complete


def _type(kind: Any) -> Any:
    """The type of a field, given that of an attribute."""
    if get_origin(kind) in (Union, UnionType):
        return Union[tuple(_type(each) for each in get_args(kind))]  # noqa: UP007  # of types that are only known here
    if get_origin(kind) is frozenset:
        return Annotated[list[get_args(kind)[0]], BeforeValidator(list)]  # type: ignore[misc]  # known here only
    if get_origin(kind) is tuple and get_args(kind)[-1] is ...:
        return Annotated[list[_type(get_args(kind)[0])], BeforeValidator(listed)]  # type: ignore[misc]  # known here only
    return TYPES.get(kind) or MADE.get(kind, kind)


def _meaning(text: str | None, kind: Any) -> str | None:
    """The documentation of an attribute for those who read JSON."""
    if text is None:
        return None
    for word, in_json in (("None", "null"), ("True", "true"), ("False", "false")):
        text = text.replace(word, in_json)
    text = " ".join(text.split())
    in_seconds = " In seconds." if timedelta in (kind, *get_args(kind)) else ""
    return f"{text[0].upper()}{text[1:]}{in_seconds}"
