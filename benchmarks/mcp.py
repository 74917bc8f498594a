"""`mcp` beside the R package adehabitatHR, whose rule it has: the same polygons? And how long does each take?

    python benchmarks/mcp.py [--record tests/data/mcp.json]

Needs Rscript, with adehabitatHR installed. With --record its polygons are written to a file, with which
tests/robust/test_adehabitat.py compares on machines without R.
"""

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from dynhull import DynamicHull

PERCENTS = [50.0, 80.0, 95.0, 99.0, 100.0]
MANY = 10**5


def sets() -> dict[str, np.ndarray]:
    """Positions of animals of several habits, with a few wrong ones."""
    random = np.random.default_rng(2006)
    camps = random.normal([[0.0, 0.0], [30.0, 5.0], [12.0, 40.0]], 3.0, (100, 3, 2)).reshape(-1, 2)
    walk = np.cumsum(random.normal(size=(400, 2)), axis=0)
    return {
        "one range": random.normal([700_000.0, 3_160_000.0], 250.0, (500, 2)),
        "three camps": camps,
        "a walk": walk,
        "wrong positions": np.vstack([random.normal(size=(60, 2)), [[200.0, 1.0], [-3.0, 150.0], [90.0, -90.0]]]),
        "on a grid, with equal distances": np.vstack([np.indices((17, 17)).reshape(2, -1).T, [[40, 8]]]).astype(float),
    }


def by_r(points: np.ndarray, percents: list[float]) -> tuple[list[np.ndarray], list[float], str]:
    """The polygons, the seconds of each, and the versions."""
    with tempfile.TemporaryDirectory() as folder:
        points.tofile(Path(folder, "points"))
        np.array(percents).tofile(Path(folder, "percents"))
        command = ["Rscript", str(Path(__file__).with_name("mcp.R")), folder]
        *seconds, versions = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
        numbers = np.fromfile(Path(folder, "polygons"))
    polygons = []
    while len(numbers):
        end = 1 + 2 * int(numbers[0])
        polygons.append(numbers[1:end].reshape(-1, 2))
        numbers = numbers[end:]
    return polygons, list(map(float, seconds)), versions.strip()


def same(polygon: np.ndarray, vertices: np.ndarray) -> bool:
    """Whether the corners are the same; R's go clockwise, and some of them lie on sides."""
    return DynamicHull(polygon).vertices().tolist() == vertices.tolist()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path)
    record = parser.parse_args().record
    found = []
    for name, points in sets().items():
        polygons, _, versions = by_r(points, PERCENTS)
        hull = DynamicHull(points)
        for percent, polygon in zip(PERCENTS, polygons, strict=True):
            verdict = "the same" if same(polygon, hull.mcp(percent)) else "other corners"
            print(f"{name}, {len(points)} points, {percent:g} %: {verdict}")
        found.append({"name": name, "points": points.tolist(), "polygons": [each.tolist() for each in polygons]})
    if record:
        record.write_text(json.dumps({"by": versions, "percents": PERCENTS, "sets": found}) + "\n")
    many = np.random.default_rng(95).normal(size=(MANY, 2))
    polygons, (theirs,), _ = by_r(many, [95.0])
    hull = DynamicHull(many)
    start = time.perf_counter()
    ours = hull.mcp(95)
    seconds = time.perf_counter() - start
    verdict = "the same" if same(polygons[0], ours) else "other corners"
    print(f"{MANY:,} points, 95 %: {1e3 * seconds:.1f} ms; adehabitatHR {1e3 * theirs:,.0f} ms; {verdict}")
    print(versions)


if __name__ == "__main__":
    main()
