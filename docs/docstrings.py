"""Extensions of mkdocstrings, for two things that it would show wrong or not at all."""

import re
from textwrap import indent
from typing import Any

import griffe

# From a prompt at the start of a line to the next paragraph without one.
DOCTESTS = re.compile(r"^>>>.*?(?=\n\n(?!>>>)|\Z)", re.MULTILINE | re.DOTALL)


class DoctestExamples(griffe.Extension):
    """Puts the doctests of each docstring into a section of examples; Markdown would take them for quotations."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        mark(obj)

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        mark(pkg)


def mark(documented: griffe.Object) -> None:
    docstring = documented.docstring
    if docstring is not None:
        docstring.value = DOCTESTS.sub(lambda found: f"Examples:\n{indent(found[0], '    ')}", docstring.value)


class NamesakesOfModules(griffe.Extension):
    """Shows what a package imports from a module of the same name, such as `chan` from `chan.py`, not the module."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        expose(pkg)


def expose(package: griffe.Module) -> set[str]:
    """The paths that name something else than a module now."""
    exposed: set[str] = set()
    members = list(package.members.items())
    for name, member in members:
        if isinstance(member, griffe.Module):
            exposed |= expose(member)
            if package.imports.get(name) == f"{member.path}.{name}":
                mark(member.members[name])
                package.members[name] = griffe.Alias(name, member.members[name], parent=package)
                exposed.add(member.path)
    for name, member in members:
        if isinstance(member, griffe.Alias) and member.target_path in exposed:
            package.members[name] = griffe.Alias(name, member.target_path, parent=package)
    return exposed
