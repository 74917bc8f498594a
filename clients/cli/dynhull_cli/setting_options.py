"""Options of commands, one for each described setting of hulls and of fences."""

import inspect
import re
from collections.abc import Callable, Mapping
from datetime import timedelta
from functools import wraps
from typing import Annotated, Any

import typer

from dynhull_surface.described import Setting, described, option_of

from .durations import duration
from .lon_lat import lon_lat

SPANS = "A time span such as 500ms, 90s, 30m, 2h or 7d; a number alone is seconds."
# What the command line has as text.
READ: dict[Any, Callable[[str, str], Any]] = {
    timedelta: duration,
    tuple[float, float]: lambda text, _: lon_lat(text),
}

Make = Callable[..., Mapping[str, Any]]


def choosing(*makes: Make) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A command that also has the options of the functions, and receives all that these return as `chosen`."""

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        tables = [(make, inspect.signature(make).parameters) for make in makes]

        @wraps(command)
        def run(*arguments: Any, **given: Any) -> None:
            chosen: dict[str, Any] = {}
            for make, table in tables:
                chosen |= make(**{option: given.pop(option) for option in table})
            command(*arguments, **given, chosen=chosen)

        own = list(inspect.signature(command).parameters.values())
        at = [each.name for each in own].index("chosen")
        options = [*(option for _, table in tables for option in table.values()), *own[at + 1 :]]
        run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [*own[:at], *(each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in options)]
        )
        return run

    return with_options


def settings_options(settings: type, panel: str | None = None, *, creating: bool = True) -> Make:
    """A function with an option for each described setting; it returns them as arguments of the SDK."""
    offered = [each for each in described(settings) if creating or not each.at_creation]

    def make(**given: Any) -> dict[str, Any]:
        chosen = {each.name: _argument(each, given[each.name]) for each in offered}
        unusual = {each.name for each in offered if chosen[each.name] != each.usual}
        for each in offered:
            if each.needs and each.name in unusual and unusual.isdisjoint(each.needs):
                needed = (other.option for other in offered if other.name in each.needs)
                raise ValueError(f"{each.option} is given with {' or '.join(needed)}")
        return chosen

    make.__signature__ = inspect.Signature([_parameter(each, panel) for each in offered])  # type: ignore[attr-defined]
    return make


def _parameter(setting: Setting, panel: str | None) -> inspect.Parameter:
    kind, usual, meaning = (
        setting.kind,
        setting.usual,
        re.sub("`(.*?)`", lambda name: option_of(name[1]), setting.meaning),
    )
    limits: dict[str, Any] = {}
    if setting.flag is not None:
        kind, usual, meaning = bool, False, setting.flag.meaning
    elif setting.kind is timedelta:
        kind, meaning = str, f"{meaning} {SPANS}"
    elif setting.kind in READ:
        kind = str
    elif setting.kind is int:
        limits = {"min": setting.least, "max": setting.greatest, "metavar": "INTEGER"}
    spellings = [each for each in (setting.option, setting.also) if each]
    option = typer.Option(*spellings, help=meaning, rich_help_panel=panel, **limits)
    return inspect.Parameter(
        setting.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=usual,
        annotation=Annotated[kind if usual is not None else kind | None, option],
    )


def _argument(setting: Setting, given: Any) -> Any:
    """What an option says, as an argument of the SDK."""
    if setting.flag is not None:
        return setting.flag.value if given else setting.usual
    read = READ.get(setting.kind)
    return given if read is None or given is None else read(given, setting.option)
