"""An extension of mkdocstrings, for two things that it would show wrong or not at all."""

import re
from textwrap import indent
from typing import Any

import griffe

# From a prompt at the start of a line to the next paragraph without one.
DOCTESTS = re.compile(r"^>>>.*?(?=\n\n(?!>>>)|\Z)", re.MULTILINE | re.DOTALL)


class Docstrings(griffe.Extension):
    """Prepares a package that has been read."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        mark_examples(pkg)
        expose_namesakes(pkg)


def mark_examples(documented: griffe.Object) -> None:
    """Put doctests into a section of examples; Markdown would take them for quotations."""
    docstring = documented.docstring
    if docstring is not None:
        docstring.value = DOCTESTS.sub(lambda found: f"Examples:\n{indent(found[0], '    ')}", docstring.value)
    for member in documented.members.values():
        if isinstance(member, griffe.Object):
            mark_examples(member)


def expose_namesakes(package: griffe.Module) -> set[str]:
    """Where a package imports `chan` from `chan.py`, let `chan` be the function. Returns the paths changed so."""
    exposed: set[str] = set()
    members = list(package.members.items())
    for name, member in members:
        if isinstance(member, griffe.Module):
            exposed |= expose_namesakes(member)
            if package.imports.get(name) == f"{member.path}.{name}":
                package.members[name] = griffe.Alias(name, member.members[name], parent=package)
                exposed.add(member.path)
    for name, member in members:
        if isinstance(member, griffe.Alias) and member.target_path in exposed:
            package.members[name] = griffe.Alias(name, member.target_path, parent=package)
    return exposed
