"""The futures of batches and reads."""

from collections.abc import Iterable
from typing import Any


def settle(settled: Iterable[tuple[Any, Any]]) -> None:
    """Give each future its result, or the exception that takes its place."""
    for outcome, result in settled:
        if outcome.done():  # cancelled by its caller
            continue
        if isinstance(result, Exception):
            outcome.set_exception(result)
        else:
            outcome.set_result(result)
