"""Hulls of data sets that no machine holds in memory, with Ray Data (extra `cluster`)."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ._sources import coordinate_columns
from .arrays import Points, as_points
from .static import convex_hull as static_hull

if TYPE_CHECKING:
    from pyarrow import Table
    from ray.data import Dataset

__all__ = ["convex_hull"]

PATH = "path"  # the column that Ray adds with `include_paths=True`
VERTICES, PROBLEM = "vertices", "problem"
# Rows whose coordinates are joined at a time: fewer than a cache holds, and than a hull takes two threads for.
PIECE = 2**16
# Vertices that are gathered before the next hull of hulls. It waits for as many as the hull has, where these are more,
# so that all of them together take no longer than a few times the last one.
GATHERED = 2**20


def convex_hull(dataset: "Dataset", columns: tuple[str, str] | None = None) -> Points:
    """The vertices of the convex hull of a Ray Dataset, exactly those of `dynhull.convex_hull`.

    Ray's tasks replace each block of rows by the vertices of its hull, where the block is; the hull of these vertices
    is that of all points. Only the two columns are read, and the program that asks holds vertices alone. Takes as long
    as reading the data, and O(v log v) for v vertices of blocks: few, except where most points lie on a circle.

    Args:
        dataset: a `ray.data.Dataset`, of files or otherwise.
        columns: the names of the two columns with the coordinates, x first; by default those with names such as x and
            y, or lon and lat.

    Returns:
        The (h, 2) vertices, counter-clockwise from the lexicographically smallest; no rows where there are no points.

    Raises:
        TypeError: it is not a Dataset, or a coordinate is not a number.
        ValueError: there are no such columns, or a coordinate is missing, not finite, or has no double of its value.
            The message names the row of its block, with all values; the file, too, where it was read with
            `include_paths=True`.
    """
    _refuse_others(dataset)
    found = dataset.columns()
    if found is None:  # no rows, and no schema either
        return np.empty((0, 2))
    chosen = _chosen(found, columns)
    read = [*chosen, PATH] if PATH in found and PATH not in chosen else [*chosen]
    hulls = dataset.select_columns(read).map_batches(
        partial(_block_hull, columns=chosen), batch_size=None, batch_format="pyarrow", zero_copy_batch=True
    )
    hull, gathered, size = np.empty((0, 2)), [], 0
    for row in hulls.iter_rows():
        if row[PROBLEM] is not None:
            kind, words = row[PROBLEM].split(" ", 1)
            raise (TypeError if kind == TypeError.__name__ else ValueError)(words)
        vertices = np.frombuffer(row[VERTICES], np.float64).reshape(-1, 2)
        gathered.append(vertices)
        size += len(vertices)
        if size > max(GATHERED, len(hull)):
            hull, gathered, size = static_hull(np.concatenate([hull, *gathered])), [], 0
    return static_hull(np.concatenate([hull, *gathered]))


def _refuse_others(dataset: object) -> None:
    try:
        from ray.data import Dataset
    except ImportError as error:
        raise ImportError("dynhull.ray needs Ray Data: pip install 'dynhull[cluster]'") from error
    if not isinstance(dataset, Dataset):
        raise TypeError(f"dataset must be a ray.data.Dataset, got {type(dataset).__name__}: see dynhull.convex_hull")


def _chosen(found: list[str], columns: tuple[str, str] | None) -> tuple[str, str]:
    listed = ", ".join(found)
    if columns is None:
        by_name = coordinate_columns(found)
        if by_name is None:
            raise ValueError(f"dataset has the columns {listed}: name two, x first, as in columns=('x', 'y')")
        return by_name
    if isinstance(columns, str) or len(columns) != 2 or columns[0] == columns[1]:
        raise ValueError(f"columns must be two different names, x first, got {columns!r}")
    for name in columns:
        if name not in found:
            raise ValueError(f"columns has {name!r}, but dataset has the columns {listed}")
    return columns


def _block_hull(block: "Table", columns: tuple[str, str]) -> "Table":
    """One row: the vertices of a block, or what is wrong with it. Runs in Ray's tasks.

    An error that a task raises reaches its caller below pages of Ray's own traceback; this one becomes the caller's.
    """
    import pyarrow as pa

    try:
        hulls = [_hull(part, columns, path) for path, part in _files(block)]
        vertices, problem = static_hull(np.concatenate(hulls)), None
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError
        vertices, problem = np.empty((0, 2)), f"{kind.__name__} {error}"
    return pa.table(
        {VERTICES: pa.array([vertices.tobytes()], pa.large_binary()), PROBLEM: pa.array([problem], pa.string())}
    )


def _files(block: "Table") -> Iterator[tuple[str | None, "Table"]]:
    """The parts of a block, each of one file; the whole where a column of that name is something else."""
    import pyarrow as pa

    kind = block.schema.field(PATH).type if PATH in block.column_names else None
    if kind is None or not (pa.types.is_string(kind) or pa.types.is_large_string(kind)) or not len(block):
        yield None, block
        return
    paths = block[PATH].to_numpy()
    starts = [0, *(np.flatnonzero(paths[1:] != paths[:-1]) + 1).tolist(), len(block)]
    for start, end in pairwise(starts):
        yield str(paths[start]), block.slice(start, end - start)


def _hull(block: "Table", columns: tuple[str, str], path: str | None) -> Points:
    name = f"columns {columns[0]} and {columns[1]}, block of {len(block)} rows" + (f" of {path}" if path else "")
    for column in columns:
        if block[column].null_count:
            row = int(np.flatnonzero(block[column].is_null().to_numpy())[0])
            raise ValueError(f"{name}, row {row}: {column} is missing")
    points = block.select(columns).rename_columns(["x", "y"])
    try:
        hulls = [static_hull(piece) for piece in points.to_batches(max_chunksize=PIECE)]
    except (TypeError, ValueError):
        as_points(points, f"{name},")  # raises it again, and says where
        raise
    return static_hull(np.concatenate(hulls)) if hulls else np.empty((0, 2))
