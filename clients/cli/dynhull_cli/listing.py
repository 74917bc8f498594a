"""What has names: lists, which may be empty, creations and deletions."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from dynhull_surface.reasons import Exit

from .connected import fail
from .json_lines import json_line

if TYPE_CHECKING:
    from rich.table import Table

Row = TypeVar("Row")


def listed(rows: Iterable[Row], nothing: str) -> Iterator[Row]:
    """The rows. If there are none, standard error says `nothing`, lest an empty output be taken for a failure."""
    empty = True
    for row in rows:
        empty = False
        yield row
    if empty:
        typer.echo(nothing, err=True)


def below(noun: str, prefix: str) -> str:
    """The words for a list without rows: "no hulls", or "no hulls with names that begin with 'fleet/'"."""
    return f"no {noun} with names that begin with {prefix!r}" if prefix else f"no {noun}"


def print_list(
    rows: Iterator[Row],
    as_json: bool,
    members: Callable[[Row], Mapping[str, Any]],
    line: Callable[[Row], str],
    table: Callable[[list[Row]], "Table"],
) -> None:
    """A table on a terminal, elsewhere a line for each row; or with `as_json` an object for each."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if console.is_terminal and not as_json:
        if found := list(rows):
            console.print(table(found))
        return
    for row in rows:
        typer.echo(json_line(**members(row)) if as_json else line(row))


def made(make: Callable[..., Row], exists: type[Exception], *, exist_ok: bool, **settings: Any) -> tuple[Row, bool]:
    """What is made with these settings, or with `exist_ok` is there with the same ones; and whether it is new."""
    try:
        return make(**settings), True
    except exists:
        if not exist_ok:
            raise
        return make(**settings, exist_ok=True), False  # refuses other settings


def existing(names: Iterable[str], get: Callable[[str], Row], missing: type[Exception] | None) -> list[Row]:
    """What has these names, each once; a name that nothing has is skipped if its error is `missing`."""
    found = []
    for name in dict.fromkeys(names):
        try:
            found.append(get(name))
        except Exception as error:
            if missing is None or not isinstance(error, missing):
                raise
    return found


def confirm_deletion(found: list[str]) -> None:
    """Ask on the terminal; the command ends where there is none, and if the answer is no."""
    if not found:
        return
    what = ", ".join(found)
    if not sys.stdin.isatty():
        fail(Exit.UNUSABLE, f"nothing was deleted: without a terminal to ask on, add --yes to delete {what}")
    if not typer.confirm(f"Delete {what}?", err=True):
        fail(Exit.FAILED, "nothing was deleted")
