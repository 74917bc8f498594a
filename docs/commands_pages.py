"""Makes the pages of the commands when mkdocs builds the site: one for each panel of `dynhull --help`."""

import os
from collections.abc import Iterator
from importlib.metadata import entry_points
from typing import Any

import mkdocs_gen_files

os.environ.update(COLUMNS="100", TERM="dumb", NO_COLOR="1")  # columns that a page has room for
from typer.testing import CliRunner

from dynhull_cli.commands import GROUP, PANELS, app

LOADED = {each.name: each.load() for each in entry_points(group=GROUP)}


def index() -> Iterator[str]:
    yield f"# Commands\n\n{described('')}"
    yield "| commands | |\n| --- | --- |"
    for panel, names in PANELS.items():
        page = page_of(panel)
        links = ", ".join(f"[{name}](commands/{page}.md#dynhull-{name})" for name in names)
        yield f"| [{panel}](commands/{page}.md) | {links} |"
    yield ""


def page(panel: str, names: tuple[str, ...]) -> Iterator[str]:
    yield f"# {panel}\n"
    for name in names:
        for each in named(name, LOADED[name]):
            yield f"## dynhull {each}\n\n{described(each)}"


def page_of(panel: str) -> str:
    return panel.lower().replace(" ", "-")


def described(name: str) -> str:
    help_text = CliRunner().invoke(app, [*name.split(), "--help"], prog_name="dynhull").output
    return f"```text\n{help_text.strip()}\n```\n"


def named(name: str, command: Any) -> Iterator[str]:
    """The name of a command, then those of the commands of a group, and of the commands beside it."""
    yield name
    for parts in (getattr(command, "commands", {}), getattr(command, "beside", {})):
        for part, inner in parts.items():
            yield from named(f"{name} {part}", inner)


with mkdocs_gen_files.open("reference/commands.md", "w") as file:
    file.write("\n".join(index()))
for panel, names in PANELS.items():
    with mkdocs_gen_files.open(f"reference/commands/{page_of(panel)}.md", "w") as file:
        file.write("\n".join(page(panel, names)))
