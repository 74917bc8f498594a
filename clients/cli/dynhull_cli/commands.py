"""Commands come from the entry points in the group "dynhull.commands", each loaded when it is wanted."""

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
    try:
        function = entry.load()
    except ModuleNotFoundError as error:
        function = _not_installed(entry, error)
    command = typer.Typer(add_completion=False)
    command.command(entry.name)(function)
    return typer.main.get_command(command)


def _not_installed(entry: EntryPoint, error: ModuleNotFoundError) -> Any:
    """A command that says what to install; `--help` of the group lists it like the others."""
    extras = ",".join(entry.extras)

    def explain() -> None:
        typer.echo(
            f"dynhull {entry.name} needs {error.name}, which is not installed. "
            f"Install it with: pip install 'dynhull[{extras}]'",
            err=True,
        )
        raise typer.Exit(1)

    explain.__doc__ = f"(not installed: pip install 'dynhull[{extras}]')"
    return explain


app = typer.Typer(cls=InstalledCommands, no_args_is_help=True, pretty_exceptions_enable=False)


@app.callback()
def options() -> None:
    """Exact convex hulls of points that come and go."""
