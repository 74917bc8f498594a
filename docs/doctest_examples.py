"""An extension of mkdocstrings: shows doctests in docstrings as examples; Markdown would take them for quotations."""

import re
from textwrap import indent
from typing import Any

import griffe

# From a prompt at the start of a line to the next paragraph without one.
DOCTESTS = re.compile(r"^>>>.*?(?=\n\n(?!>>>)|\Z)", re.MULTILINE | re.DOTALL)


class DoctestExamples(griffe.Extension):
    """Puts the doctests of each docstring into a section of examples, before the docstring is parsed."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        mark(obj)

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        mark(pkg)


def mark(documented: griffe.Object) -> None:
    docstring = documented.docstring
    if docstring is not None:
        docstring.value = DOCTESTS.sub(lambda found: f"Examples:\n{indent(found[0], '    ')}", docstring.value)
