"""Static convex hulls, the reference for the dynamic one. All return the same vertices in the same order."""

from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from ._convex_hull import convex_hull

if _TYPE_CHECKING:
    from . import trace
    from ._chan import chan
    from ._graham import graham_scan
    from ._hull_nd import HullND, hull_nd
    from ._jarvis import jarvis_march
    from ._monotone_chain import monotone_chain

__all__ = ["HullND", "chan", "convex_hull", "graham_scan", "hull_nd", "jarvis_march", "monotone_chain", "trace"]

_PLACES = {
    "HullND": "_hull_nd",
    "chan": "_chan",
    "graham_scan": "_graham",
    "hull_nd": "_hull_nd",
    "jarvis_march": "_jarvis",
    "monotone_chain": "_monotone_chain",
    "trace": "trace",
}


def __getattr__(name: str) -> _Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    place = import_module(f"{__name__}.{_PLACES[name]}")  # most programs need none of them
    return place if name == "trace" else getattr(place, name)


def __dir__() -> list[str]:
    return __all__
