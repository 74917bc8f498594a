"""Commands come from the entry points in the group "dynhull.commands", each loaded when it is wanted."""

from collections.abc import Callable
from functools import wraps
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer
from typer.core import TyperGroup

GROUP = "dynhull.commands"


class InstalledCommands(TyperGroup):
    """A group whose commands are the installed entry points."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """The commands' names, sorted."""
        return sorted(entry_points(group=GROUP).names)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """The command of that name; None where there is none."""
        return next((_command(entry) for entry in entry_points(group=GROUP, name=cmd_name)), None)


def _command(entry: EntryPoint) -> Any:
    command = typer.Typer(add_completion=False, rich_markup_mode="markdown")
    try:
        function = entry.load()
        settings = getattr(function, "context_settings", None)
        command.command(entry.name, context_settings=settings)(_explaining(entry, function))
    except ModuleNotFoundError as error:
        anything = {"allow_extra_args": True, "ignore_unknown_options": True}
        command.command(entry.name, context_settings=anything)(_not_installed(entry, error))
    return typer.main.get_command(command)


def _explaining(entry: EntryPoint, function: Callable[..., None]) -> Callable[..., None]:
    """The command, which says what to install where something that it loads late is missing."""

    @wraps(function)
    def run(*arguments: Any, **options: Any) -> None:
        try:
            function(*arguments, **options)
        except ModuleNotFoundError as error:
            _not_installed(entry, error)()

    return run


def _not_installed(entry: EntryPoint, error: ModuleNotFoundError) -> Callable[[], None]:
    """A command that says what to install; `--help` of the group lists it like the others."""
    extras = ",".join(entry.extras)

    def explain() -> None:
        typer.echo(
            f"dynhull {entry.name} needs {error.name}, which is not installed. "
            f"Install it with: pip install 'dynhull[{extras}]'",
            err=True,
        )
        raise typer.Exit(1)

    explain.__doc__ = f'Not installed: needs the extra "{extras}".'
    return explain


app = typer.Typer(
    cls=InstalledCommands, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode="markdown"
)


@app.callback()
def options() -> None:
    """Exact convex hulls of points that come and go.

    Commands that talk to a server take its address from --address or DYNHULL_ADDRESS, a token from --token or
    DYNHULL_TOKEN.

    Exit codes: 0 all is well, 1 something is not (a hull differs, a request was refused), 2 the command or its input
    cannot be used, 3 the server does not answer, 4 it wants another token, 130 interrupted.
    """
