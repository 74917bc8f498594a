"""Which implementation runs: the C++ kernel where it is built, or the reference in Python.

The environment variable DYNHULL_KERNEL, read at import, forces one: "python" or "cpp".
"""

import os
from importlib import import_module
from types import ModuleType
from typing import Literal


def _load() -> ModuleType | None:
    wanted = os.environ.get("DYNHULL_KERNEL") or "any"
    if wanted not in ("any", "cpp", "python"):
        raise ValueError(f'DYNHULL_KERNEL must be "cpp" or "python", got {wanted!r}')
    if wanted == "python":
        return None
    try:
        return import_module("dynhull._kernel")
    except ModuleNotFoundError:
        if wanted == "cpp":
            raise
        return None


kernel = _load()
KERNEL: Literal["cpp", "python"] = "python" if kernel is None else "cpp"
