"""Another copy of the server's package in place of the installed one: to be called before anything imports it."""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

NAME = "dynhull_server"


class _Finder(MetaPathFinder):
    def __init__(self, folder: str) -> None:
        self._folder = folder

    def find_spec(self, name: str, path: Sequence[str] | None = None, _: ModuleType | None = None) -> ModuleSpec | None:
        if name == NAME:
            return PathFinder.find_spec(name, [self._folder])
        return PathFinder.find_spec(name, path) if name.startswith(NAME + ".") else None


def use_package(folder: str) -> None:
    """Import the package from a folder: an editable installation would come before the search path."""
    sys.meta_path.insert(0, _Finder(folder))
