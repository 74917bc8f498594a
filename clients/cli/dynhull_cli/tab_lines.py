"""Lines of numbers between tabs, for people and pipes."""

from collections.abc import Iterator
from typing import Any


def tab_line(*values: Any) -> str:
    """The values, with nested arrays and tuples flattened, between tabs."""
    return "\t".join(map(str, _flat(values)))


def _flat(value: Any) -> Iterator[Any]:
    if hasattr(value, "tolist"):  # of numpy, which a command may not have imported
        value = value.tolist()
    if isinstance(value, list | tuple):
        for each in value:
            yield from _flat(each)
    else:
        yield value
