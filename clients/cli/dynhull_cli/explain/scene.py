"""What a picture is made of: marks, each in one of the styles, at positions that all writers share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

Point = tuple[float, float]
Position = tuple[float, float]  # x to the right, y upwards
Places = dict[Point, Position]

BLACK, GREY, PALE, YELLOW = "#000000", "#707070", "#B8B8B8", "#C9B458"
BLUE, VIOLET, ORANGE, VERMILION, GREEN = "#0072B2", "#8E6BBF", "#E69F00", "#D55E00", "#009E73"


@dataclass(frozen=True, slots=True)
class Style:
    """How a mark is drawn.

    Attributes:
        kind: a path through the positions, the polygon around them, or a sign at each of them.
        colour: "#RRGGBB".
        width: of the line, or across the sign, in 1/300 of a picture's width.
        dashed: whether the line is.
        opacity: of a polygon's inside.
    """

    kind: Literal["line", "area", "dots", "crosses", "number"]
    colour: str
    width: float
    dashed: bool = False
    opacity: float = 0.0


@dataclass(frozen=True, slots=True)
class Mark:
    """One thing in a picture: the name of its style, its positions, and the text of a number."""

    style: str
    positions: tuple[Position, ...]
    text: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """One step: a caption of one or two lines, and the marks, the lowest first."""

    caption: str
    marks: tuple[Mark, ...]


@dataclass(frozen=True)
class Story:
    """Everything that a file shows.

    Attributes:
        title: of the whole.
        styles: by name.
        legend: what a style stands for, by its name.
        names: what to show for a position under the mouse.
        backdrop: marks under every picture.
        pictures: the steps.
        low: left and lower end of every picture.
        high: right and upper end.
        result: the outcome in a few words.
    """

    title: str
    styles: Mapping[str, Style]
    legend: Mapping[str, str]
    names: Mapping[Position, str]
    backdrop: Sequence[Mark]
    pictures: Sequence[Picture]
    low: Position
    high: Position
    result: str


def places(points: Sequence[Point], *, stretched: bool = False) -> Places:
    """Positions for distinct points: moved and scaled into the square [-1, 1]². O(n).

    Exact until the last step, so that neither the largest nor the smallest doubles overflow or vanish on the way.

    Args:
        points: the points.
        stretched: whether x and y are scaled apart, to fill the square.
    """
    if not points:
        return {}
    xs, ys = ([Fraction(value) for value in values] for values in zip(*points, strict=True))
    width, height = (max(xs) - min(xs)) / 2, (max(ys) - min(ys)) / 2
    if not stretched:
        width = height = max(width, height)
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return {
        p: (float((u - x) / (width or 1)), float((v - y) / (height or 1)))
        for p, u, v in zip(points, xs, ys, strict=True)
    }


def names_of(where: Places) -> dict[Position, str]:
    """The exact coordinates of each place, as text."""
    return {position: f"({x!r}, {y!r})" for (x, y), position in where.items()}


def text(point: Point) -> str:
    """A point as text, six digits a coordinate."""
    return f"({point[0]:.6g}, {point[1]:.6g})"


def plural(count: int, one: str, several: str) -> str:
    """A number and its noun."""
    return f"{count:,} {one if count == 1 else several}"


def chosen(count: int, most: int) -> list[int]:
    """Which of `count` steps to draw where there is room for `most`: evenly spread, including the first and the last.

    >>> chosen(9, 5)
    [0, 2, 4, 6, 8]
    """
    if count <= most:
        return list(range(count))
    return [i * (count - 1) // (most - 1) for i in range(most)]
