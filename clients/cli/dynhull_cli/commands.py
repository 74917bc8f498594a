"""The commands: entry points in the group "dynhull.commands", each imported when it runs.

A package brings its own commands, so that no client has to import the server to offer `dynhull serve`.
"""

import inspect
from collections.abc import Callable
from difflib import get_close_matches
from functools import cache, wraps
from importlib.metadata import EntryPoint, entry_points, version
from importlib.util import find_spec
from itertools import groupby
from operator import attrgetter
from textwrap import dedent
from types import CodeType
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from dynhull_surface.reasons import Exit

from .groups import Group

GROUP = "dynhull.commands"
PANELS = {
    "Hulls and their points": (
        "list",
        "create",
        "recenter",
        "reshard",
        "delete",
        "insert",
        "put",
        "remove",
        "load",
        "import",
        "ingest",
        "quarantine",
        "history",
    ),
    "Questions": (
        "query",
        "watch",
        "feed",
        "replay",
        "track",
        "top",
        "measure",
        "separate",
        "phases",
        "frontier",
        "verify",
    ),
    "Fences and alarms": ("fences", "alarms", "relay"),
    "Server": ("serve", "cluster", "config", "token", "gateway", "dashboard", "bench"),
    "Data folders": ("backup", "restore", "check", "export", "move"),
    "Getting to know dynhull": ("demo", "explain"),
}
OTHERS = "More"
PACKAGES: dict[str | None, str | None] = {"google": "protobuf", "grpc": "grpcio"}  # of modules with other names
EXTRAS = {"aiokafka": "kafka", "pyogrio": "gis"}  # of modules that a command needs for a part of what it does


class Flags:
    """Shows flags in the help without a type: they take no value."""

    def get_params(self, ctx: Any) -> Any:
        """The parameters, those of flags with an empty type."""
        params = super().get_params(ctx)  # type: ignore[misc]  # of the class that this one is mixed into
        for param in params:
            if getattr(param, "is_flag", False):
                param.metavar = ""
        return params


class Command(Flags, TyperCommand):
    """A command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The arguments that are left; an error about a value shows the value, which typer's does not."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            errors: Any = getattr(error.__cause__, "errors", None)  # of pydantic, which typer asks
            if errors is not None:
                message, value = error.message.removeprefix("Value error, "), repr(errors()[0]["input"])
                error.message = message if value in message else f"{value}. {message}"
            raise


class CommandGroup(Flags, TyperGroup):
    """A command that only groups others."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """The names of the commands, in the order of their definition."""
        return list(self.commands)


class InstalledCommands(Flags, TyperGroup):
    """A group whose commands are the installed entry points."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """The names of the commands, in the order of the help."""
        known = [name for names in PANELS.values() for name in names if name in _installed()]
        return known + sorted(_installed().keys() - set(known))

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The list of commands in plain text: rich, which frames the help of a command, takes half of the time."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        self.format_options(ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """A section for each panel, with what is said first about each of its commands."""
        commands = [Deferred(_installed()[name]) for name in self.list_commands(ctx)]
        for panel, members in groupby(commands, attrgetter("rich_help_panel")):
            with formatter.section(panel):
                formatter.write_dl([(each.name, (each.help or "").partition("\n\n")[0]) for each in members])

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """The command of that name, or None."""
        return Deferred(_installed()[cmd_name]) if cmd_name in _installed() else None

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The arguments that are left; an option of a command that is before its name is told where it belongs."""
        if not args and not ctx.resilient_parsing:  # as no_args_is_help does, which shows nothing of a plain list
            typer.echo(ctx.get_help())
            ctx.exit(Exit.UNUSABLE)
        named = next((each for each in args if each in _installed()), "COMMAND")
        try:
            return super().parse_args(ctx, args)
        except typer.TyperException as error:
            option = getattr(error, "option_name", None)  # of NoSuchOption, which typer does not export
            if option is not None:
                error.message += f". Options of a command come after its name: dynhull {named} {option} ..."
            raise

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments name. Where there is none, the error names those that are written like it."""
        near = [] if args[0] in _installed() else get_close_matches(args[0], self.list_commands(ctx))
        if near and not ctx.resilient_parsing:
            ctx.fail(f"No such command {args[0]!r}. Did you mean {' or '.join(map(repr, near))}?")
        return super().resolve_command(ctx, args)


class Deferred(TyperCommand):
    """A command that is imported when it runs or shows its own help.

    The list of commands and shell completion need only its name and its docstring, which is read from the compiled
    module: importing every command takes seconds.
    """

    def __init__(self, entry: EntryPoint) -> None:
        panel = next((panel for panel, names in PANELS.items() if entry.name in names), OTHERS)
        super().__init__(entry.name, help=_described(entry, _docstring(entry)), rich_help_panel=panel)
        self._entry = entry

    def make_context(self, info_name: Any, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """The context of the imported command, or of the one beside it that the first argument names."""
        command, words = _imported(self._entry, args)
        return command.make_context(" ".join([info_name, *words]), args[len(words) :], parent, **extra)


@cache
def _installed() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def _docstring(entry: EntryPoint) -> str | None:
    spec = find_spec(entry.module)
    if spec is None:
        return None
    loader: Any = spec.loader
    functions = [each for each in loader.get_code(entry.module).co_consts if isinstance(each, CodeType)]
    texts = [each.co_consts[0] for each in functions if each.co_name == entry.attr]
    return inspect.cleandoc(texts[0]) if texts and isinstance(texts[0], str) else None


def _described(entry: EntryPoint, text: str | None) -> str | None:
    """The help of a command; of a second name for it, with the first."""
    first = _installed().get(entry.attr)
    if first is None or first.name == entry.name or first.value != entry.value:
        return text
    return f"Another name for `dynhull {first.name}`. {text}"


def _imported(entry: EntryPoint, args: list[str]) -> tuple[Any, list[str]]:
    """The command, and the arguments that chose it."""
    try:
        function = entry.load()
    except ModuleNotFoundError as error:
        anything = {"allow_extra_args": True, "ignore_unknown_options": True}
        command = _typer()
        command.command(entry.name, context_settings=anything)(_not_installed(entry, error))
        return typer.main.get_command(command), []
    words = args[:1] if args and args[0] in getattr(function, "beside", {}) else []
    return _command(entry, *words), words


@cache
def _command(entry: EntryPoint, beside: str = "") -> Any:
    """The command, or one beside it; kept, because typer takes 4 ms to make one of a function with many options."""
    function = entry.load()
    made = _made(entry, beside, function.beside[beside]) if beside else _made(entry, entry.name, function)
    return typer.main.get_command(made)


def _made(entry: EntryPoint, name: str, function: Callable[..., None] | Group) -> typer.Typer:
    """The command of a function; of a group, the group with its commands."""
    if isinstance(function, Group):
        group = _typer(name=name, cls=CommandGroup, no_args_is_help=True, help=_with_examples(function.text))
        group.callback()(lambda: None)  # without one, typer makes a group of one command that command
        for each, part in function.commands.items():
            if isinstance(part, Group):
                group.add_typer(_made(entry, each, part))
            else:
                _add(group, entry, each, part, inspect.getdoc(part))
        return group
    command = _typer()
    _add(command, entry, name, function, _described(entry, inspect.getdoc(function)))
    return command


def _add(app: typer.Typer, entry: EntryPoint, name: str, function: Callable[..., None], text: str | None) -> None:
    settings = getattr(function, "context_settings", None)
    app.command(name, cls=Command, help=_with_examples(text), context_settings=settings)(_explaining(entry, function))


def _with_examples(text: str | None) -> str:
    """The help with its indented paragraphs between fences: typer takes the indent of the first one for a slip."""
    paragraphs = inspect.cleandoc(text or "").split("\n\n")
    return "\n\n".join(
        f"```text\n{dedent(paragraph)}\n```" if paragraph.startswith("    ") else paragraph for paragraph in paragraphs
    )


def _typer(**more: Any) -> typer.Typer:
    return typer.Typer(add_completion=False, rich_markup_mode="markdown", **more)


def _explaining(entry: EntryPoint, function: Callable[..., None]) -> Callable[..., None]:
    """The command; if a module that it imports late is missing, it prints what to install."""

    @wraps(function)
    def run(*arguments: Any, **options: Any) -> None:
        try:
            function(*arguments, **options)
        except ModuleNotFoundError as error:
            _not_installed(entry, error)()

    return run


def _not_installed(entry: EntryPoint, error: ModuleNotFoundError) -> Callable[[], None]:
    """A command that only prints what to install."""
    extras = ",".join([*entry.extras, *filter(None, [EXTRAS.get(error.name or "")])])

    def explain() -> None:
        typer.echo(
            f"error: dynhull {entry.name} needs {PACKAGES.get(error.name, error.name)}, which is not installed. "
            f"Install it with: pip install 'dynhull[{extras}]'",
            err=True,
        )
        raise typer.Exit(Exit.UNUSABLE)

    explain.__doc__ = f'Not installed: needs the extra "{extras}".'
    return explain


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"dynhull {version('dynhull')}")
        raise typer.Exit


app = typer.Typer(cls=InstalledCommands, pretty_exceptions_enable=False, rich_markup_mode="markdown")


HELP = f"""Exact convex hulls of points that are inserted, moved and deleted.

Commands that talk to a server take its address from --address or DYNHULL_ADDRESS, and a token from --token or
DYNHULL_TOKEN. `dynhull COMMAND --help` describes a command.

Exit codes: {", ".join(f"{code.value} {code.meaning}" for code in Exit)}. `serve`, `gateway`, `dashboard`, `ingest` and
`relay` end with 0 when they are interrupted, because that is how they are ended.
"""


@app.callback(help=HELP, context_settings={"help_option_names": ["-h", "--help"]})
def options(
    _: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    """What all commands have in common."""
