"""Hulls of Ray Datasets, in a process of its own: prints what it found as JSON. Ray ends with the process.

python tests/ray/session.py FOLDER
"""

import json
import os
import secrets
import sys
from pathlib import Path

import numpy as np

import dynhull


def main(folder: Path) -> None:
    # Ray counts its users unless asked not to, and without a token puts one into the home folder.
    os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}
    import pyarrow as pa
    import pyarrow.parquet as pq
    import ray
    from ray.data import DataContext, from_arrow, from_items, read_parquet

    ray.init(num_cpus=1, include_dashboard=False, _temp_dir=str(folder / "ray"), object_store_memory=2**27)
    DataContext.get_current().enable_progress_bars = False
    random = np.random.default_rng(1)
    found: dict[str, object] = {}

    # Several blocks, one of which has points on a circle, and one all points in one place.
    angles = random.uniform(0, 2 * np.pi, 2000)
    clouds = [random.normal(size=(3000, 2)), 30 * np.column_stack([np.cos(angles), np.sin(angles)]), np.zeros((7, 2))]
    tables = [pa.table({"lat": cloud[:, 1], "name": ["somebody"] * len(cloud), "lon": cloud[:, 0]}) for cloud in clouds]
    expected = dynhull.convex_hull(np.concatenate(clouds))
    found["vertices"] = len(expected)
    found["equal"] = np.array_equal(dynhull.ray.convex_hull(from_arrow(tables)), expected)
    bad = clouds[1].copy()
    bad[1234] = np.inf, 0
    wrong = pa.table({"lon": bad[:, 0], "lat": bad[:, 1]})
    # As Ray reads a file of this name, for which it starts more processes.
    found["block"] = refused(from_arrow(wrong.append_column("path", [["bad.parquet"] * len(bad)])))
    files = folder / "points"
    files.mkdir()
    for number, table in enumerate(tables):
        pq.write_table(table, files / f"{number}.parquet", row_group_size=500)
    points = read_parquet(str(files))
    found["files"] = np.array_equal(dynhull.ray.convex_hull(points), expected)
    pq.write_table(wrong, folder / "bad.parquet")
    found["file"] = refused(read_parquet(str(folder / "bad.parquet"), include_paths=True))
    swapped = dynhull.convex_hull(np.concatenate(clouds)[:, ::-1])
    found["turned"] = np.array_equal(dynhull.ray.convex_hull(points, ("lat", "lon")), swapped)
    found["integers"] = dynhull.ray.convex_hull(from_items([{"x": x, "y": x % 3} for x in range(10)])).tolist()
    found["unnamed"] = refused(from_items([{"a": 1, "b": 2, "c": 3}]))
    found["absent"] = refused(points, ("lon", "height"))
    found["array"] = refused(np.zeros((3, 2)))
    rows = [{"x": 1.0, "y": 2.0}, {"x": 3.0, "y": float("nan")}]
    found["not finite"] = refused(from_items(rows, override_num_blocks=1))
    found["missing"] = refused(from_items([{"x": 2**60, "y": 1}, {"x": 1, "y": None}], override_num_blocks=1))
    found["inexact"] = refused(from_items([{"x": 2**60 + 1, "y": 1}], override_num_blocks=1))
    found["words"] = refused(from_items([{"x": "one", "y": 1}], override_num_blocks=1))
    json.dump(found, sys.stdout)
    ray.shutdown()


def refused(dataset: object, columns: object = None) -> list[str]:
    try:
        dynhull.ray.convex_hull(dataset, columns)
    except (TypeError, ValueError) as error:
        return [type(error).__name__, str(error)]
    return ["nothing"]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
