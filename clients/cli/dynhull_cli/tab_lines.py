"""Lines of numbers and names between tabs, for people and pipes."""

from collections.abc import Iterator
from typing import Any


def tab_line(*values: Any) -> str:
    """The values, with nested arrays and tuples flattened, between tabs."""
    return "\t".join(printable(str(value)) for value in flat(values))


def printable(text: str) -> str:
    """The text with escapes for what is not printed: a key may have tabs and ends of lines, or command the terminal."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def flat(value: Any) -> Iterator[Any]:
    """The values in nested arrays and tuples."""
    if hasattr(value, "tolist"):  # of numpy, which a command may not have imported
        value = value.tolist()
    if isinstance(value, list | tuple):
        for each in value:
            yield from flat(each)
    else:
        yield value
