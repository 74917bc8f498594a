"""A static algorithm's steps as pictures."""

from collections.abc import Sequence

from dynhull.static.trace import Collinear

from .scene import (
    BLACK,
    BLUE,
    GREY,
    PALE,
    VERMILION,
    VIOLET,
    YELLOW,
    Mark,
    Picture,
    Places,
    Point,
    Story,
    Style,
    names_of,
    places,
    plural,
)
from .steps import Step, explained

MOST_POINTS = 2000  # the time grows with the square: of ten thousand points it is minutes
MOST_NUMBERS = 30  # with more points in the order, their numbers would cover them
EDGE = 1.15  # leaves room for the numbers around [-1, 1]
TURNED = {1: "left turn", 0: "straight on", -1: "right turn"}

STYLES = {
    "group": Style("area", YELLOW, 1, opacity=0.25),
    "hull": Style("area", BLUE, 2, opacity=0.12),
    "hull vertex": Style("dots", BLUE, 7),
    "point": Style("dots", GREY, 4),
    "discarded": Style("crosses", PALE, 6),
    "finished": Style("line", GREY, 1.5),
    "chain": Style("line", BLACK, 1.8),
    "chain vertex": Style("dots", BLACK, 6),
    "tangent": Style("line", YELLOW, 1.3, dashed=True),
    "left turn": Style("line", BLUE, 2.6),
    "straight on": Style("line", VIOLET, 2.6),
    "right turn": Style("line", VERMILION, 2.6),
    "left turn vertex": Style("dots", BLUE, 7.5),
    "straight on vertex": Style("dots", VIOLET, 7.5),
    "right turn vertex": Style("dots", VERMILION, 7.5),
    "number": Style("number", GREY, 8),
}
LEGEND = {
    "chain": "chain",
    "left turn": "left turn, hull",
    "right turn": "right turn",
    "straight on": "straight on",
    "discarded": "discarded",
    "group": "groups and tangents",
}


def static_story(algorithm: str, name: str, points: Sequence[Point], collinear: Collinear) -> Story:
    """An algorithm of `dynhull.static` on points from a source of that name.

    Raises:
        ValueError: there are more points than a picture has room for.
    """
    if len(points) > MOST_POINTS:
        raise ValueError(
            f"{name} has {len(points):,} points: a picture of a static algorithm has room for {MOST_POINTS:,}; "
            "draw a part of the file"
        )
    steps = explained(algorithm, points, collinear)
    where = places(list(dict.fromkeys(points)))
    return Story(
        title=f"{algorithm}: {name}",
        styles=STYLES,
        legend=LEGEND,
        names=names_of(where),
        backdrop=[Mark("point", tuple(where.values()))],
        pictures=[Picture(step.caption, tuple(_marks(step, where))) for step in steps],
        low=(-EDGE, -EDGE),
        high=(EDGE, EDGE),
        result=plural(len(steps[-1].hull), "vertex", "vertices"),
    )


def _marks(step: Step, where: Places) -> list[Mark]:
    turn = TURNED[step.sign]
    drawn: list[tuple[str, Sequence[Point]]] = [("group", group) for group in step.groups]
    drawn += [("hull", step.hull), ("hull vertex", step.hull), ("discarded", step.discarded)]
    drawn += [("finished", chain) for chain in step.finished]
    drawn += [("chain", step.chain), ("chain vertex", step.chain)]
    drawn += [("tangent", (step.triple[0], tangent)) for tangent in step.tangents]
    drawn += [(turn, step.triple), (f"{turn} vertex", step.triple)]
    marks = [Mark(style, tuple(where[p] for p in points)) for style, points in drawn if points]
    if len(step.order) <= MOST_NUMBERS:
        marks += [Mark("number", (where[p],), str(place)) for place, p in enumerate(step.order, start=1)]
    return marks
