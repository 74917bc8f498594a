"""Names that mean one thing, and functions that one can see at once.

A class has its name alone among the classes of the server, and of each other package. What two packages call alike is
the same thing at two ends of a wire: an answer of the SDK and of the gateway, an error of the server and of the SDK.
"""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# Packages that are read together: a gateway of several workers is a server, too.
TOGETHER = {"dynhull_cluster": "dynhull_server"}
PACKAGES = [
    *(ROOT / each for each in ("dynhull", "proto/dynhull_surface", "server/dynhull_server", "server/dynhull_cluster")),
    *sorted(path for path in (ROOT / "clients").glob("*/dynhull_*") if path.is_dir()),
]
# Lines of a function without its signature and its documentation.
LONGEST = 60
# Longer ones, which are to become fewer: a command that hands sixteen options on.
LONGER = {"clients/cli/dynhull_cli/load/command.py: load"}


@pytest.fixture(scope="module")
def modules() -> list[tuple[str, str, ast.Module]]:
    """The package, the path and the contents of each module."""
    return [
        (TOGETHER.get(package.name, package.name), str(path.relative_to(ROOT)), ast.parse(path.read_text()))
        for package in PACKAGES
        for path in sorted(package.rglob("*.py"))
    ]


def test_a_class_has_its_name_alone(modules: list[tuple[str, str, ast.Module]]) -> None:
    found = defaultdict(list)
    for package, path, module in modules:
        for each in module.body:
            if isinstance(each, ast.ClassDef):
                found[package, each.name].append(path)
    twice = {name: paths for (_, name), paths in found.items() if len(paths) > 1}
    assert not twice


def test_functions_are_short(modules: list[tuple[str, str, ast.Module]]) -> None:
    long = {
        f"{path}: {each.name}": lines
        for _, path, module in modules
        for each in ast.walk(module)
        if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef) and (lines := body_lines(each)) > LONGEST
    }
    assert set(long) == LONGER, long


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """The lines of a function without its signature and its documentation."""
    first = function.body[1 if ast.get_docstring(function) is not None and len(function.body) > 1 else 0]
    assert function.end_lineno is not None
    return function.end_lineno - first.lineno + 1
