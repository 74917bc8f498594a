"""Lists that may be empty."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

import typer

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
