"""The fields of requests, as the command line calls them."""

import re
from typing import TYPE_CHECKING

from dynhull_surface.names import find

if TYPE_CHECKING:
    from dynhull_client import InvalidRequestError

# In the reasons and the values.
WORDS = {
    "subject_hull": "--subjects",
    "subject_prefix": "--subject-prefix",
    "other_hull": "--other-hull",
    "hull_area": "--area",
    "without_self": "--without-self",
    "FENCE_BOUNDARY_OPEN": "open",
}
ROW = re.compile(r"\b(?:puts\.keys|removes|releases|drops) row (\d+)")


def in_options(error: "InvalidRequestError") -> str:
    """The message of an error, with options in place of the fields of the request that it names."""
    return _named(error, _words(error.field or "", error.row))


def of_row(error: "InvalidRequestError") -> str:
    """The message of an error about one row of a batch, without the row."""
    found = find(error.field or "")
    return _named(error, (found and found.name.row) or error.field or "row")


def _named(error: "InvalidRequestError", words: str) -> str:
    message = str(error)
    if error.problem == message:
        return message
    quoted = f" is {error.value!r}: " in message
    shown = repr(error.value) if quoted else error.value or ""
    problem = ROW.sub(lambda row: f"key {int(row[1]) + 1}", error.problem)
    problem = re.sub("|".join(WORDS), lambda word: WORDS[word[0]], problem)
    return f"{words} is {WORDS.get(shown, shown)}: {problem}"


def _words(field: str, row: int | None) -> str:
    found = find(field)
    if found is None:
        return field if row is None else f"{field}[{row}]"
    if row is not None and found.name.row and not found.below:
        return f"{found.name.row} {row + 1} of the batch"
    # A field of a message that is the value of one option is named after that option.
    rest = field.removeprefix(found.path).lstrip(".")
    words = " ".join(filter(None, [found.option, rest]))
    return words if row is None else f"{words}[{row}]"
