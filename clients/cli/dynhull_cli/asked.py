"""What a command is asked about: rows of numbers, from arguments or from standard input."""

import math
import sys
from collections.abc import Iterator

import numpy as np

from dynhull_client import Points

from .load.chunks import CHUNK_ROWS, cut

STANDARD_INPUT = ["-"]


def asked_rows(arguments: list[str], columns: int = 2) -> Iterator[Points]:
    """Arrays with so many columns, of rows "X,Y"; of the lines of standard input where "-" is the only argument.

    ValueError shows a row that is none.
    """
    texts = _lines() if arguments == STANDARD_INPUT else arguments
    for piece in cut(texts, CHUNK_ROWS):
        yield np.array([_numbers(text, columns) for text in piece])


def _lines() -> Iterator[str]:
    return (line for line in sys.stdin if not line.isspace())


def _numbers(text: str, columns: int) -> list[float]:
    try:
        numbers = [float(each) for each in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) != columns or not all(map(math.isfinite, numbers)):
        raise ValueError(f"{text.strip()!r} is not {'X,Y' if columns == 2 else 'X,Y,X,Y'}")
    return numbers
