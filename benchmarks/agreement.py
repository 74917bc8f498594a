"""GJK against python-fcl on many random pairs of convex bodies in space.

    python benchmarks/agreement.py [--pairs 100000] [--seed 0]

Bodies of twelve points, so near that about half of the pairs overlap. Where the two disagree, fcl is asked again with
the bodies in the other order. Where they still disagree, a distance must prove itself: its points belong to the bodies,
so it is not too small, and the slab between the bodies is as wide, so it is not too large. Otherwise both answers are
printed and the program fails.
"""

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from dynhull.convex import Cloud
from dynhull.gjk import Contact, contact

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from judges import fcl_body, fcl_distance

BODIES = 1000
TOLERANCE = 1e-6
TINY = 1e-12


def agrees(found: Contact, expected: float) -> bool:
    if found.intersect:
        return expected < 0
    return abs(found.distance - expected) <= TOLERANCE * found.distance


def proves_itself(found: Contact, one: np.ndarray, other: np.ndarray) -> bool:
    if found.intersect:
        return False
    heights = one @ found.normal, other @ found.normal
    slab = max(heights[1].min() - heights[0].max(), heights[0].min() - heights[1].max())
    strangers = max(outside(one, found.points[0]), outside(other, found.points[1]))
    length = np.linalg.norm(found.points[0] - found.points[1])
    return abs(slab - found.distance) < TINY and abs(length - found.distance) < TINY and strangers < TINY


def outside(cloud: np.ndarray, point: np.ndarray) -> float:
    """How far a point is from being a mean of the cloud's points, with weights that add up to 1."""
    return nnls(np.vstack((cloud.T, np.ones(len(cloud)))), np.append(point, 1.0))[1]


def main() -> None:
    parser = argparse.ArgumentParser(description="GJK against python-fcl.")
    parser.add_argument("--pairs", type=int, default=100_000, help="how many (default 100000)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    clouds = [random.normal(size=(12, 3)) + 1.2 * random.normal(size=3) for _ in range(BODIES)]
    shapes, judged = [Cloud(cloud) for cloud in clouds], [fcl_body(cloud) for cloud in clouds]
    iterations: Counter[int] = Counter()
    overlaps = at_odds = refuted = disagreements = 0
    worst = 0.0
    for i, j in random.integers(0, BODIES, (options.pairs, 2)).tolist():
        found, expected = contact(shapes[i], shapes[j]), fcl_distance(judged[i], judged[j])
        overlaps += found.intersect
        if not agrees(found, expected):
            turned = fcl_distance(judged[j], judged[i])
            if agrees(found, turned):
                at_odds += 1
                expected = turned
            elif proves_itself(found, clouds[i], clouds[j]):
                refuted += 1
                expected = found.distance
            else:
                disagreements += 1
                print(f"bodies {i} and {j}: {found}, fcl: {expected}")
        if not found.intersect:
            worst = max(worst, abs(found.distance - expected) / found.distance)
            iterations[found.iterations] += 1
    print(f"{options.pairs:,} pairs, {overlaps:,} overlapping: {disagreements} disagreements")
    print(f"answers of fcl that change when the two bodies change places, one of them as here: {at_odds}")
    print(f"distances of fcl more than {TOLERANCE} off, relatively: {refuted}")
    print(f"the other distances: at most {worst:.1e} off, relatively")
    print("iterations of those apart:", dict(sorted(iterations.items())))
    print(f"mean {sum(n * count for n, count in iterations.items()) / iterations.total():.2f}")
    sys.exit(disagreements > 0)


if __name__ == "__main__":
    main()
