"""Fields of bodies, one for each described setting of hulls and of fences."""

from collections.abc import Callable, Sequence
from datetime import timedelta
from functools import partial
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, Field, StrictBool, ValidationInfo, create_model

from dynhull_surface.described import Setting, described

from .numbers import SPAN, Number, Point, Seconds

Body = TypeVar("Body", bound=BaseModel)

LONGEST_TEXT = 200


def with_settings(settings: type, *, at_creation: bool = False) -> Callable[[type[Body]], type[Body]]:
    """A body that also has a field for each described setting: those of a creation, or the others."""
    every = described(settings)
    fields: dict[str, Any] = {each.name: _field(each, every) for each in every if each.at_creation == at_creation}

    def complete(body: type[Body]) -> type[Body]:
        return create_model(body.__name__, __base__=body, __doc__=body.__doc__, __module__=body.__module__, **fields)

    return complete


def _field(setting: Setting, every: Sequence[Setting]) -> tuple[Any, Any]:
    kind = _kind(setting) if setting.usual is not None else _kind(setting) | None
    if setting.needs:
        needed = [each for each in every if each.name in setting.needs]
        kind = Annotated[kind, AfterValidator(partial(_with_others, needed))]
    meaning = f"{setting.meaning} {SPAN}." if setting.kind is timedelta else setting.meaning
    return kind, Field(setting.usual, description=meaning)


def _with_others(needed: Sequence[Setting], value: Any, info: ValidationInfo) -> Any:
    """A setting that is given; ValueError if it means nothing without another one, which comes before it."""
    if value and all(info.data.get(each.name, True) == each.usual for each in needed):
        named = (f"{each.name} {each.flag.value}" if each.flag else each.name for each in needed)
        raise ValueError(f"is given with {' or '.join(named)}")
    return value


def _kind(setting: Setting) -> Any:
    if setting.choices:
        return setting.kind
    if setting.kind is bool:
        return StrictBool
    if setting.kind is timedelta:
        return Seconds
    if setting.kind is str:
        return Annotated[str, Field(strict=True, max_length=LONGEST_TEXT)]
    if setting.kind is int:
        return Annotated[int, Field(strict=True, ge=setting.least, le=setting.greatest)]
    if setting.kind is float:
        return Annotated[Number, Field(ge=setting.least)]
    return Point
