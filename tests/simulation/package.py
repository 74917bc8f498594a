"""Other copies of packages in place of those installed: to be called before anything imports them."""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

NAMES = "dynhull_server", "dynhull_cluster"


class _Finder(MetaPathFinder):
    def __init__(self, folder: str, names: Sequence[str]) -> None:
        self._folder = folder
        self._names = names

    def find_spec(self, name: str, path: Sequence[str] | None = None, _: ModuleType | None = None) -> ModuleSpec | None:
        if name in self._names:
            return PathFinder.find_spec(name, [self._folder])
        return PathFinder.find_spec(name, path) if name.partition(".")[0] in self._names else None


def use_package(folder: str, names: Sequence[str] = NAMES) -> None:
    """Import packages from a folder: an editable installation would come before the search path."""
    sys.meta_path.insert(0, _Finder(folder, names))
