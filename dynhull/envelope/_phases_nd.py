"""Energies above the hull in systems of three and more elements, computed once with Qhull."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import as_array, as_rows
from ..static import hull_nd

SUM_ERROR = 1e-9


def energy_above_hull_nd(compositions: npt.ArrayLike, energies: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """(n,) energies of the entries above the lower hull at their compositions; 0.0 for stable ones, up to rounding.

    The lower hull at a composition is the highest of the planes of its faces, which Qhull finds. The error is about
    1e-12 of the energies' range. `PhaseDiagram` is exact and dynamic for two elements. O(n log n) for three elements,
    O(n^floor(d/2)) for d, and O(n f) for f faces.

    Args:
        compositions: (n, d) shares of d elements, not negative, with sum 1 (up to 1e-9). Each pure element needs an
            entry.
        energies: (n,) energies per atom.

    Raises:
        ValueError, TypeError: a bad row, which the message names; or a pure element has no entry.
        ModuleNotFoundError: scipy is not installed (`pip install 'dynhull[nd]'`).

    >>> from dynhull.envelope import energy_above_hull_nd
    >>> elements = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> energy_above_hull_nd([*elements, [0.5, 0.5, 0], [0.5, 0.25, 0.25]], [0, 0, 0, -2, -0.5]).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.5]
    """
    shares, heights = as_rows(compositions, "compositions"), as_array(energies, "energies")
    if heights.shape != (len(shares),):
        raise ValueError(f"energies must have shape ({len(shares)},) like the compositions, got {heights.shape}")
    rows = as_rows(np.column_stack([shares[:, 1:], heights]), "entries")
    bad = np.flatnonzero((shares < 0).any(axis=1) | (np.abs(shares.sum(axis=1) - 1) > SUM_ERROR))
    if bad.size:
        raise ValueError(f"compositions row {bad[0]} is {tuple(shares[bad[0]].tolist())}: not shares that make up 1")
    for element in range(shares.shape[1]):
        if not (shares[:, element] == 1).any():
            raise ValueError(f"element {element} has no entry of its own: the energies have no reference")
    # A point above all entries: it changes nothing below, and the diagram is never flat.
    corners = np.eye(shares.shape[1])[:, 1:]
    height = float(np.ptp(rows[:, -1])) + 1.0
    lid = np.column_stack([corners, np.full(len(corners), rows[:, -1].max() + height)])
    hull = hull_nd(np.concatenate([rows, lid]))
    down = hull.normals[:, -1] < 0
    normals, on_face = hull.normals[down], hull.vertices[np.array(hull.faces)[down, 0]]
    # normal @ (x, y) = normal @ on_face, solved for y.
    offsets = (normals * on_face).sum(axis=1)
    steep = normals[:, -1] < -1e-9 / height
    floors = (offsets[steep] - rows[:, :-1] @ normals[steep, :-1].T) / normals[steep, -1]
    above: npt.NDArray[np.float64] = np.maximum(rows[:, -1] - floors.max(axis=1), 0.0)
    return above
