"""A fully dynamic planar convex hull with exact answers."""

from sys import modules as _modules
from typing import Any as _Any

from . import _hull, static
from ._crossings import Crossings
from ._entities import DuplicateKeyError, MissingKeyError
from ._fence_index import FenceIndex
from ._geo import GeoHull, GeoKeyedHull, GeoWindowHull
from ._hull import DynamicHull, MissingPointError
from ._implementation import KERNEL, set_threads
from ._keyed import KeyedHull, KeyedLoader, PackedHull, Put
from ._predicates import orient2d
from ._window import WindowHull
from .static import convex_hull

__all__ = [
    "KERNEL",
    "Crossings",
    "DuplicateKeyError",
    "DynamicHull",
    "FenceIndex",
    "GeoHull",
    "GeoKeyedHull",
    "GeoWindowHull",
    "KeyedHull",
    "KeyedLoader",
    "MissingKeyError",
    "MissingPointError",
    "PackedHull",
    "Put",
    "WindowHull",
    "__version__",
    "convex_hull",
    "orient2d",
    "set_threads",
    "static",
]

_MODULES = {
    *("arrays", "convex", "decompose", "defects", "envelope", "gjk", "globe", "keys", "margin", "measure", "polygons"),
    *("crossings", "crs", "range_search", "ray", "robust", "trace"),
}

__version__: str
"""The version of the installed distribution."""


def __getattr__(name: str) -> _Any:
    if name in _MODULES:  # most programs need few
        from importlib import import_module

        return import_module(f"dynhull.{name}")
    if name == "__version__":  # read when asked for: it takes as long as a tenth of the import
        from importlib.metadata import version

        return version("dynhull")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


for _public in (
    DynamicHull,
    MissingPointError,
    KeyedHull,
    DuplicateKeyError,
    MissingKeyError,
    Put,
    FenceIndex,
    Crossings,
    WindowHull,
    GeoHull,
    GeoKeyedHull,
    GeoWindowHull,
):
    _public.__module__ = "dynhull"
_modules["dynhull.hull"] = _hull  # where pickles of version 0.1 look for the classes
