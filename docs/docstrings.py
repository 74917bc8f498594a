"""An extension of mkdocstrings, for three things that it would show wrong or not at all."""

import inspect
import pkgutil
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
        if pkg.analysis == "dynamic":
            annotate(pkg)


def mark_examples(documented: griffe.Object) -> None:
    """Put doctests into a section of examples; Markdown would take them for quotations."""
    docstring = documented.docstring
    if docstring is not None:
        docstring.value = DOCTESTS.sub(lambda found: f"Examples:\n{indent(found[0], '    ')}", docstring.value)
    for member in documented.members.values():
        if isinstance(member, griffe.Object):
            mark_examples(member)


def annotate(documented: griffe.Object) -> None:
    """Give the attributes of classes that were inspected their types, which the tables of attributes show."""
    for member in documented.members.values():
        if isinstance(member, griffe.Module):
            annotate(member)
        elif isinstance(member, griffe.Class):
            for name, kind in kinds(pkgutil.resolve_name(member.path)).items():
                known = member.members.setdefault(name, griffe.Attribute(name, parent=member))
                if isinstance(known, griffe.Attribute):
                    known.annotation = inspect.formatannotation(kind).replace("typing.", "")


def kinds(described: type) -> dict[str, Any]:
    """The types of the attributes of a class, those of its bases among them."""
    return {name: kind for each in reversed(described.__mro__) for name, kind in inspect.get_annotations(each).items()}


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
