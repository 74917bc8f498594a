"""Reads rows of numbers from the arguments of a command or from standard input."""

import math
import sys
from collections.abc import Iterable, Iterator

import numpy as np

from .load.chunks import CHUNK_ROWS, Points, cut
from .reading.text import standard_input

STANDARD_INPUT = ["-"]
SHAPES = {2: "X,Y", 4: "X,Y,X,Y"}


def given_or_read(arguments: list[str] | None) -> list[str]:
    """The arguments, or "-" for standard input if there are none. ValueError if standard input is a terminal."""
    if not arguments and sys.stdin.isatty():
        raise ValueError("no points: give X,Y for each of them, or - to type them in")
    return arguments or STANDARD_INPUT


def number_rows(arguments: list[str], columns: int = 2) -> Iterator[Points]:
    """Arrays of rows from the arguments, each "X,Y" or, with four columns, "X,Y,X,Y".

    A single argument "-" stands for the lines of standard input. Blank lines are skipped. ValueError names the first
    row that is not numbers, or says that there are none.
    """
    read = arguments == STANDARD_INPUT
    texts: Iterable[str] = standard_input() if read else arguments
    placed = ((f"{'line' if read else 'argument'} {i}", text) for i, text in enumerate(texts, 1) if text.strip())
    empty = True
    for piece in cut(placed, CHUNK_ROWS):
        empty = False
        yield np.array([_numbers(place, text, columns) for place, text in piece])
    if empty:
        what = f"give {SHAPES[columns]} for each of them, as arguments or as lines of standard input"
        raise ValueError(f"no points: {what}")


def _numbers(place: str, text: str, columns: int) -> list[float]:
    try:
        # Python reads 1_000 as a number; nothing else does.
        numbers = [] if "_" in text else [float(each) for each in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) != columns or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{place}: {text.strip()!r} is not {SHAPES[columns]} with finite numbers")
    return numbers
