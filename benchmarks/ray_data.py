"""The hull of Parquet files with Ray Data, against reading them alone.

    python benchmarks/ray_data.py [--points 100000000] [--rounds 3] [--folder FOLDER]

Both run the same plan of Ray's: two columns are read, and a function sees every block. One of them counts rows, and the
other is `dynhull.ray.convex_hull`. The files stay in memory as far as the system caches them.
"""

import argparse
import os
import secrets
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

import dynhull

POINTS_A_FILE = 5_000_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=100_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=Path, default=None, help="where the files are, or are written and stay")
    arguments = parser.parse_args()
    os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        write(folder, arguments.points)
        measure(folder, arguments.points, arguments.rounds)


def write(folder: Path, points: int) -> None:
    """Gaussian points in files that are not there yet, without compression: random numbers have none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    for number, begun in enumerate(range(0, points, POINTS_A_FILE)):
        name = folder / f"{points}-{number:04}.parquet"
        if name.exists():
            continue
        x, y = np.random.default_rng(number).normal(size=(2, min(POINTS_A_FILE, points - begun)))
        pq.write_table(pa.table({"x": x, "y": y}), name, compression="none", use_dictionary=False)


def measure(folder: Path, points: int, rounds: int) -> None:
    import ray
    from ray.data import DataContext, read_parquet

    ray.init(include_dashboard=False, log_to_driver=False)
    DataContext.get_current().enable_progress_bars = False

    def read_alone() -> int:
        dataset = read_parquet(str(folder)).select_columns(["x", "y"])
        counts = dataset.map_batches(rows, batch_size=None, batch_format="pyarrow", zero_copy_batch=True)
        return sum(row["rows"] for row in counts.iter_rows())

    def hull() -> int:
        return len(dynhull.ray.convex_hull(read_parquet(str(folder))))

    times: dict[str, list[float]] = {"reading alone": [], "hull": []}
    results = {"reading alone": points, "hull": hull()}  # the first one starts Ray's workers
    for _ in range(rounds):
        for name, run in (("reading alone", read_alone), ("hull", hull)):
            begun = time.perf_counter()
            result = run()
            times[name].append(time.perf_counter() - begun)
            if result != results[name]:
                raise SystemExit(f"{name}: {result}, not {results[name]}")
    ray.shutdown()
    alone = statistics.median(times["reading alone"])
    print(f"{points:,} points, {results['hull']} vertices, {os.cpu_count()} cores, medians of {rounds}")
    for name, each in times.items():
        median = statistics.median(each)
        print(f"{name:14} {median:6.2f} s ({min(each):.2f} to {max(each):.2f}) {median / alone:5.2f} of reading alone")


def rows(block: object) -> object:
    import pyarrow as pa

    return pa.table({"rows": [len(block)]})


if __name__ == "__main__":
    main()
