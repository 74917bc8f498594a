"""Chooses the implementation: the C++ kernel if it is built, otherwise the reference in Python.

The environment variable DYNHULL_KERNEL, read at import, forces one of them: "python" or "cpp".
"""

import os
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from . import _kernel
    from .arrays import Points


class _Kernel(Protocol):
    """What the package uses of the module `dynhull._kernel`. mypy compares it with the module's stub."""

    HullTree: "type[_kernel.HullTree]"
    Entities: "type[_kernel.Entities]"
    Fences: "type[_kernel.Fences]"
    WindowTree: "type[_kernel.WindowTree]"
    GlobeTree: "type[_kernel.GlobeTree]"
    GlobeEntities: "type[_kernel.GlobeEntities]"
    GlobeWindowTree: "type[_kernel.GlobeWindowTree]"

    def plain_points(self, xy: object) -> "Points | None": ...
    def packed_points(self, packed: bytes) -> "Points | None": ...
    def gnomonic(self, lonlat: "Points", parameters: Any) -> "tuple[Points, npt.NDArray[np.bool_]]": ...
    def convex_hull(self, xy: "Points") -> "Points | None": ...
    def chan(self, xy: "Points") -> "tuple[Points, list[tuple[int, int, int, bool]]]": ...
    def orientations(self, a: "Points", b: "Points", c: "Points") -> "npt.NDArray[np.int8]": ...
    def turning_if_simple(self, ring: "Points") -> int: ...


def _load() -> _Kernel | None:
    wanted = os.environ.get("DYNHULL_KERNEL") or "any"
    if wanted not in ("any", "cpp", "python"):
        raise ValueError(f'DYNHULL_KERNEL must be "cpp" or "python", got {wanted!r}')
    if wanted == "python":
        return None
    try:
        import dynhull._kernel as built
    except ModuleNotFoundError:
        if wanted == "cpp":
            raise
        return None
    return built


kernel = _load()
KERNEL: Literal["cpp", "python"] = "python" if kernel is None else "cpp"
