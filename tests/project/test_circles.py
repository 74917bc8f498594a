"""Modules that import each other, if only for their types: they cannot be read or changed one at a time.

Imports within functions and under TYPE_CHECKING count.
"""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
# The circles that there are, each by the package that they are in. `docs/architecture.md` explains them.
EXCEPTIONS = ["dynhull", "dynhull_cli.load", "dynhull_server.state.fences"]

Graph = dict[str, set[str]]


def modules() -> dict[str, Path]:
    """The modules of the distribution by name; a package by that of its folder."""
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["root_packages"]
    folders = [ROOT, *(ROOT / each for each in ("proto", "server", "clients/python", "clients/cli"))]
    folders += [ROOT / "clients" / each for each in ("dashboard", "bridges", "gateway")]
    return {
        ".".join(path.relative_to(folder).with_suffix("").parts).removesuffix(".__init__"): path
        for folder in folders
        for package in packages
        if package != "dynhull_proto"  # generated
        for path in (folder / package).rglob("*.py")
    }


def statements(block: ast.AST) -> Iterator[ast.AST]:
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        for each in getattr(block, field, ()):
            yield each
            yield from statements(each)


def imported(name: str, path: Path) -> Iterator[str]:
    """What a module imports: names of modules, and of what is in them."""
    package = name.split(".")[: None if path.name == "__init__.py" else -1]
    for node in statements(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{module}.{each.name}" for each in node.names)


def graph() -> Graph:
    known = modules()
    found: Graph = {}
    for name, path in known.items():
        targets = {each if each in known else each.rpartition(".")[0] for each in imported(name, path)}
        found[name] = (targets & known.keys()) - {name}
    return found


def reached(start: str, edges: Graph) -> set[str]:
    found: set[str] = set()
    left = [start]
    while left:
        new = edges[left.pop()] - found
        found |= new
        left += new
    return found


def circles(edges: Graph) -> set[frozenset[str]]:
    """The largest sets of modules of which each leads to all others."""
    ahead = {name: reached(name, edges) for name in edges}
    in_circles = {name for name in edges if name in ahead[name]}
    return {frozenset(other for other in ahead[name] if name in ahead[other]) for name in in_circles}


def package_of(circle: frozenset[str]) -> str:
    first, last = min(circle).split("."), max(circle).split(".")
    common = [part for part, other in zip(first, last, strict=False) if part == other]
    return ".".join(common)


def test_modules_do_not_import_each_other_but_in_the_circles_that_are_known() -> None:
    found = circles(graph())
    assert sorted(map(package_of, found)) == EXCEPTIONS, [sorted(circle) for circle in found]


def test_a_circle_is_found() -> None:
    edges: Graph = {"a": {"b"}, "b": {"a", "c"}, "c": set(), "d": {"a"}}
    assert circles(edges) == {frozenset("ab")}
