"""Command-line flags, one per setting."""

import inspect
import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_origin

import typer

from .settings import PREFIX, RENAMED, Settings


def with_settings(command: Callable[[Settings, dict[str, str]], None]) -> Callable[..., None]:
    """A typer command with one flag per setting; `command` gets the settings and the origin of each."""

    def run(config: Path | None, **given: Any) -> None:
        from .failure import fail
        from .setting_sources import SettingsError, load, old_names, origins

        flags = {name: value for name, value in given.items() if value not in (None, [])}
        try:
            settings, where = load(flags, config), origins(flags, config)
            for line in old_names(flags, config):
                typer.echo(f"warning: {line}", err=True)
        except SettingsError as error:
            fail(str(error))
        command(settings, where)

    file_help = "TOML file of settings; the names are those of the flags, with _ for -."
    parameters = [_parameter("config", Path, typer.Option(help=file_help, envvar=f"{PREFIX}CONFIG", dir_okay=False))]
    for name, field in Settings.model_fields.items():
        default = False if field.default in (None, ()) or field.annotation is bool else str(field.default)
        option = typer.Option(help=field.description, show_default=default)
        several = get_origin(field.annotation) is tuple
        parameters.append(_parameter(name, list[str] if several else field.annotation, option))
    for old, name in RENAMED.items():
        parameters.append(_parameter(old, Settings.model_fields[name].annotation, typer.Option(hidden=True)))
    run.__doc__ = command.__doc__
    run.__name__ = command.__name__
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def as_toml(value: Any) -> str:
    """A value as written in a settings file."""
    return json.dumps(str(value) if isinstance(value, Path) else value)


def _parameter(name: str, kind: Any, option: Any) -> inspect.Parameter:
    # None means that the flag is not given.
    annotation = Annotated[kind | None, option]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
