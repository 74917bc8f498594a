"""Areas in conditions: the name of a hull, `circle(X, Y, RADIUS)` or `polygon(X Y, X Y, X Y)`."""

import math
import re
from dataclasses import dataclass

# Digits are taken at once (++): where each could also belong to the next part, a long number would take its square.
NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
HULL = re.compile(r"[A-Za-z0-9._/-]+")
CIRCLE = re.compile(rf"circle\s*\(\s*({NUMBER})\s*,\s*({NUMBER})\s*,\s*({NUMBER})\s*\)")
POLYGON = re.compile(r"polygon\s*\(([^()]*)\)")
CORNER = re.compile(rf"\s*({NUMBER})\s+({NUMBER})\s*")
AN_AREA = "an area: a hull, circle(X, Y, RADIUS) or polygon(X Y, X Y, X Y)"
LEAST_CORNERS, MOST_CORNERS = 3, 1_000
WHOLE = 2**53


class ConditionError(ValueError):
    """A text is no condition.

    Attributes:
        position: where, from 1.
        problem: what is wrong there.
    """

    def __init__(self, position: int, problem: str) -> None:
        super().__init__(f"at position {position}: {problem}")
        self.position = position
        self.problem = problem


@dataclass(frozen=True, slots=True)
class Circle:
    """A disk; on the globe its radius is in metres."""

    x: float
    y: float
    radius: float

    def __str__(self) -> str:
        """Its shortest form."""
        return f"circle({', '.join(map(number_text, (self.x, self.y, self.radius)))})"


@dataclass(frozen=True, slots=True)
class Polygon:
    """A polygon without holes, by its corners."""

    corners: tuple[tuple[float, float], ...]

    def __str__(self) -> str:
        """Its shortest form."""
        return f"polygon({', '.join(f'{number_text(x)} {number_text(y)}' for x, y in self.corners)})"


# The name of a hull, or an area that does not move.
Place = str | Circle | Polygon


def place_of(text: str, start: int) -> Place:
    """The area that a text is, or raise ConditionError; `start` is its position in the condition, from 1."""
    circle, polygon = CIRCLE.fullmatch(text), POLYGON.fullmatch(text)
    if circle is not None:
        x, y, radius = (_finite(circle[each], start + circle.start(each)) for each in (1, 2, 3))
        if radius < 0:
            raise ConditionError(start + circle.start(3), "the radius must not be negative")
        return Circle(x, y, radius)
    if polygon is not None:
        return _polygon(polygon[1], start + polygon.start(1))
    if HULL.fullmatch(text) is None:
        raise ConditionError(start, f"expected {AN_AREA}")
    return text


def _polygon(text: str, start: int) -> Polygon:
    corners = []
    for part in text.split(","):
        corner = CORNER.fullmatch(part)
        if corner is None:
            raise ConditionError(start, f"expected two numbers, got {part.strip()!r}")
        x, y = (_finite(corner[each], start + corner.start(each)) for each in (1, 2))
        corners.append((x, y))
        start += len(part) + 1
    if not LEAST_CORNERS <= len(corners) <= MOST_CORNERS:
        raise ConditionError(start - 1, f"a polygon has {LEAST_CORNERS} to {MOST_CORNERS} corners")
    return Polygon(tuple(corners))


def _finite(text: str, position: int) -> float:
    value = float(text) + 0.0  # makes a negative zero positive
    if not math.isfinite(value):
        raise ConditionError(position, "the number must be finite")
    return value


def number_text(value: float) -> str:
    """A number in its shortest form."""
    return str(int(value)) if value.is_integer() and abs(value) < WHOLE else repr(value)
