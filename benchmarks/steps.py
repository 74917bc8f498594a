"""Counted work: orientations evaluated by one insert or one delete, on inputs that are hard in different ways.

    python benchmarks/steps.py [--largest 1000000] [--updates 2000]

Counts do not depend on the machine. A sign that floating point cannot tell is counted once, like any other; so is the
`crossing` of two edges' lines. The last column puts the most expensive update against log2(n) squared.
"""

import argparse
import math
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from update_steps import WORKLOADS, count_steps


def main() -> None:
    parser = argparse.ArgumentParser(description="Orientations evaluated an update, on hard inputs.")
    parser.add_argument("--largest", type=int, default=10**6, help="largest n (default 1,000,000)")
    parser.add_argument(
        "--updates", type=int, default=2000, help="deletes and inserts counted at each n (default 2000)"
    )
    options = parser.parse_args()
    print(f"{'input':25}{'n':>10}{'insert mean':>13}{'max':>6}{'delete mean':>13}{'max':>6}{'max/log2(n)^2':>15}")
    for name in WORKLOADS:
        n = 1000
        while n <= options.largest:
            steps = count_steps(name, n, options.updates)
            insert, delete = np.array(steps.inserts), np.array(steps.deletes)
            ratio = steps.worst / math.log2(n) ** 2
            print(
                f"{name:25}{n:>10,}{insert.mean():>13.1f}{insert.max():>6}{delete.mean():>13.1f}{delete.max():>6}"
                f"{ratio:>15.2f}",
                flush=True,
            )
            n *= 10


if __name__ == "__main__":
    main()
