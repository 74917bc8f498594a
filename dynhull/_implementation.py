"""Chooses the implementation: the C++ kernel if it is built, otherwise the reference in Python.

Environment variables, read at import: DYNHULL_KERNEL forces one of them, "python" or "cpp"; DYNHULL_THREADS is the
number of threads that one call of the kernel may use, by default one for each processor available to the process.
"""

import os
from operator import index
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from . import _kernel
    from .arrays import Points

MOST_THREADS = 64


class _Kernel(Protocol):
    """What the package uses of the module `dynhull._kernel`. mypy compares it with the module's stub."""

    HullTree: "type[_kernel.HullTree]"
    Entities: "type[_kernel.Entities]"
    Fences: "type[_kernel.Fences]"
    WindowTree: "type[_kernel.WindowTree]"
    LastVertices: "type[_kernel.LastVertices]"
    GlobeTree: "type[_kernel.GlobeTree]"
    GlobeEntities: "type[_kernel.GlobeEntities]"
    GlobeWindowTree: "type[_kernel.GlobeWindowTree]"

    def plain_points(self, xy: object) -> "Points | None": ...
    def packed_points(self, packed: bytes) -> "Points | None": ...
    def gnomonic(self, lonlat: "Points", parameters: Any) -> "tuple[Points, npt.NDArray[np.bool_]]": ...
    def convex_hull(self, xy: "Points") -> "Points | None": ...
    def chan(self, xy: "Points") -> "tuple[Points, list[tuple[int, int, int, bool]]]": ...
    def orientations(self, a: "Points", b: "Points", c: "Points") -> "npt.NDArray[np.int8]": ...
    def turnings_if_valid(self, rings: "list[Points]") -> list[int]: ...
    def sign_of_measure(self, vertices: "Points", measure: str, bound: float) -> int | None: ...
    def set_threads(self, threads: int, beside: bool) -> None: ...


def _load() -> _Kernel | None:
    wanted = os.environ.get("DYNHULL_KERNEL") or "any"
    if wanted not in ("any", "cpp", "python"):
        raise ValueError(f'DYNHULL_KERNEL must be "cpp" or "python", got {wanted!r}')
    threads = _threads()
    if wanted == "python":
        return None
    try:
        import dynhull._kernel as built
    except ModuleNotFoundError:
        if wanted == "cpp":
            raise
        _warn_of_the_reference()
        return None
    built.set_threads(threads, False)
    return built


def _warn_of_the_reference() -> None:
    """Nobody shall find out by waiting that the reference in Python answers."""
    from pathlib import Path  # most programs have the kernel, and need neither
    from warnings import warn

    folder = Path(__file__).parents[1]
    if (folder / "pyproject.toml").is_file():
        why = f"it was imported from its source folder, {folder}: begin Python in another folder"
    else:
        why = "no C++ compiler was found when it was installed: install one, and dynhull again"
    message = f"dynhull has no C++ kernel here, so that all takes many times longer: {why}"
    warn(f"{message}. If this is meant, set DYNHULL_KERNEL=python", RuntimeWarning, stacklevel=1)


def _threads() -> int:
    """The number set by DYNHULL_THREADS; 0 if it is not set."""
    given = os.environ.get("DYNHULL_THREADS")
    if not given:
        return 0
    if given not in map(str, range(1, MOST_THREADS + 1)):
        raise ValueError(f"DYNHULL_THREADS must be a number from 1 to {MOST_THREADS}, got {given!r}")
    return int(given)


kernel = _load()
KERNEL: Literal["cpp", "python"] = "python" if kernel is None else "cpp"


def set_threads(threads: int | None, *, beside: bool = False) -> None:
    """Set how many threads one call may use, from 1 to 64.

    Batches of 1,024 rows and more, builds of 32,768 points and more and `locate` of 16,384 points and more use several
    threads of the kernel, with the results of one. At most one call of a process has them at a time; the others work
    alone. None: as many as processors are available to the process, or for some time one, if others use these. That is
    the default, unless the environment variable DYNHULL_THREADS has another number at import. ValueError for other
    numbers. Without the kernel there is no effect.

    With `beside`, and one thread, what a put of 1,024 keys and more crosses is found in another thread meanwhile, for
    the next `take`; for some time not so, if others use the processors.
    """
    if threads is not None and not 1 <= index(threads) <= MOST_THREADS:
        raise ValueError(f"threads must be from 1 to {MOST_THREADS}, got {threads}")
    if kernel is not None:
        kernel.set_threads(index(threads or 0), beside)
