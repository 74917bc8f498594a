"""The conditions of alarms, as people write them: `area > 500 km2`, `silent 5m`, `near fleet/south 3 km`."""

import json
import math
import re
from dataclasses import dataclass
from typing import Literal

from .places import HULL, NUMBER, ConditionError, Place, number_text, place_of

Measure = Literal[
    "area", "perimeter", "diameter", "width", "count", "vertices", "silent", "near", "vertex in", "vertex"
]
Op = Literal[">", ">=", "<", "<="]

LENGTHS = {"m": 1.0, "km": 1e3}
AREAS = {"m2": 1.0, "km2": 1e6}
# The units of each measure, with what they are in metres or square metres.
UNITS: dict[Measure, dict[str, float]] = {
    "area": AREAS,
    "perimeter": LENGTHS,
    "diameter": LENGTHS,
    "width": {},  # no such measure on the globe, where units are
    "count": {},
    "vertices": {},
    "near": LENGTHS,
}
COMPARED: tuple[Measure, ...] = ("area", "perimeter", "diameter", "width", "count", "vertices")
OPPOSITE: dict[Op, Op] = {">": "<=", ">=": "<", "<": ">=", "<=": ">"}
SILENT: Literal["silent"] = "silent"
TOKEN = re.compile(rf"(?P<word>[A-Za-z_]\w*)|(?P<op>[<>]=?)|(?P<number>{NUMBER})|(?P<other>\S)")
RELATION = re.compile(r"\s*(?P<no>not\s+)?(?P<word>near|vertex)(?!\w)\s*")
OF_AREA = re.compile(r"in\s+(?=\S)")
# A key that needs no quotes. In quotes it is a string of JSON.
PLAIN_KEY = re.compile(r"[^\s\"]+")
MOST_KEY_BYTES = 255
A_MEASURE = f"{', '.join(COMPARED)}, {SILENT}, near or vertex"
# Units of time, in seconds.
SECONDS = {"d": 86_400.0, "h": 3_600.0, "m": 60.0, "s": 1.0, "ms": 1e-3}
LEAST_SILENCE, LONGEST_SILENCE = 1e-3, 100 * 366 * 86_400.0

Token = tuple[str, str, int]  # its kind, its text, and its position from 1


@dataclass(frozen=True, slots=True)
class Condition:
    """A measure of a hull compared with a bound.

    Attributes:
        measure: the measure; of "silent", the seconds since the hull has changed; of "near", the distance from another
            hull; of "vertex in", the number of vertices in an area; of "vertex", 1 if a key is a vertex, else 0.
        op: how it is compared.
        bound: the bound, in its unit.
        unit: the unit; empty for none.
        subject: the other hull, the area, or the key; empty for other measures.
    """

    measure: Measure
    op: Op
    bound: float
    unit: str = ""
    subject: Place = ""

    def __str__(self) -> str:
        """The shortest form."""
        if self.measure == SILENT:
            return f"{SILENT} {_span(self.bound)}"
        if self.measure == "near":
            far = f" {number_text(self.bound)} {self.unit}".rstrip() if self.bound else ""
            return f"{'not ' * self.over}near {self.subject}{far}"
        if self.of_vertices:
            subject = _key_text(self.subject) if self.measure == "vertex" else self.subject
            return f"{'not ' * (not self.over)}{self.measure} {subject}"
        return f"{self.measure} {self.op} {number_text(self.bound)} {self.unit}".rstrip()

    @property
    def of_vertices(self) -> bool:
        """Whether it is about a key that is a vertex, or vertices in an area."""
        return self.measure in ("vertex in", "vertex")

    @property
    def other(self) -> str | None:
        """The name of the other hull that it compares the hull with, None for none."""
        return self.subject if self.measure in ("near", "vertex in") and isinstance(self.subject, str) else None

    @property
    def limit(self) -> float:
        """The bound in metres, square metres or seconds, or without a unit as it is."""
        return self.bound * UNITS[self.measure][self.unit] if self.unit else self.bound

    @property
    def over(self) -> bool:
        """Whether it holds for greater values, rather than for lesser ones."""
        return self.op.startswith(">")

    @property
    def opposite(self) -> "Condition":
        """The condition that holds where this one does not."""
        return Condition(self.measure, OPPOSITE[self.op], self.bound, self.unit, self.subject)

    def holds(self, sign: int) -> bool:
        """Whether it holds, given the sign of the measure less the bound."""
        return (
            sign > 0 if self.op == ">" else sign >= 0 if self.op == ">=" else sign < 0 if self.op == "<" else sign <= 0
        )

    def signs(self, *, holding: bool) -> tuple[int, int]:
        """The least and the greatest sign of the measure less the bound for which it holds, or does not."""
        found = [sign for sign in (-1, 0, 1) if self.holds(sign) == holding]
        return found[0], found[-1]

    def meets(self, other: "Condition") -> bool:
        """Whether both can hold at once, given another one of the same measure and the other direction."""
        if self.limit == other.limit:
            return "=" in self.op and "=" in other.op
        return (self.limit < other.limit) == self.over


def condition_of(text: str) -> Condition:
    """The condition that a text is, or raise ConditionError."""
    relation = RELATION.match(text)
    if relation is not None:
        return _relation(text.rstrip(), relation)
    tokens = [(each.lastgroup or "", each[0], each.start() + 1) for each in TOKEN.finditer(text)]
    end = len(text) + 1
    kind, word, position = tokens[0] if tokens else ("", "", 1)
    if word == SILENT:
        return _silent(tokens, end)
    measure = next((each for each in COMPARED if each == word), None)
    if kind != "word" or measure is None:
        raise ConditionError(position, f"expected a measure: {A_MEASURE}")
    kind, word, position = tokens[1] if len(tokens) > 1 else ("", "", end)
    op = next((each for each in OPPOSITE if each == word), None)
    if op is None:
        raise ConditionError(position, "expected >, >=, < or <=")
    kind, word, position = tokens[2] if len(tokens) > 2 else ("", "", end)
    if kind != "number":
        raise ConditionError(position, "expected a number")
    bound = float(word) + 0.0  # makes a negative zero positive
    if not 0 <= bound < math.inf:
        raise ConditionError(position, "the number must be finite and not negative")
    kind, unit, position = tokens[3] if len(tokens) > 3 else ("", "", end)
    units = UNITS[measure]
    if unit and unit not in units:
        raise ConditionError(position, f"expected {' or '.join(units) if units else 'nothing more'}")
    if len(tokens) > 4:
        raise ConditionError(tokens[4][2], "expected nothing more")
    if unit and not math.isfinite(bound * units[unit]):
        raise ConditionError(tokens[2][2], "the number is too large for its unit")
    return Condition(measure, op, bound, unit)


def _silent(tokens: list[Token], end: int) -> Condition:
    kind, number, position = tokens[1] if len(tokens) > 1 else ("", "", end)
    _, unit, of_unit = tokens[2] if len(tokens) > 2 else ("", "s", end)
    if kind != "number" or not 0 < float(number) < math.inf:
        raise ConditionError(position, f"expected a span of time, such as 90s, 30m or 2h, got {number!r}")
    if unit not in SECONDS:
        raise ConditionError(of_unit, f"expected a unit of time: {', '.join(SECONDS)}")
    if len(tokens) > 3:
        raise ConditionError(tokens[3][2], "expected nothing more")
    seconds = float(number) * SECONDS[unit]
    if not LEAST_SILENCE <= seconds <= LONGEST_SILENCE:
        raise ConditionError(position, "the span must be from 1 ms to 100 years")
    return Condition(SILENT, ">=", seconds)


def _relation(text: str, match: re.Match[str]) -> Condition:
    """`near HULL [DISTANCE [UNIT]]`, `vertex in AREA` or `vertex KEY`, each perhaps after `not`."""
    start, no = match.end(), match["no"] is not None
    if match["word"] == "near":
        return _near(text, start, ">" if no else "<=")
    op: Op = "<" if no else ">="
    area = OF_AREA.match(text, start)
    if area is not None:
        return Condition("vertex in", op, 1.0, "", place_of(text[area.end() :], area.end() + 1))
    return Condition("vertex", op, 1.0, "", _key(text[start:], start + 1))


def _near(text: str, start: int, op: Op) -> Condition:
    hull = HULL.match(text, start)
    if hull is None:
        raise ConditionError(start + 1, "expected the name of a hull")
    tokens = [(each.lastgroup or "", each[0], each.start() + 1) for each in TOKEN.finditer(text, hull.end())]
    if not tokens:
        return Condition("near", op, 0.0, "", hull[0])
    kind, number, position = tokens[0]
    if kind != "number" or not 0 <= float(number) < math.inf:
        raise ConditionError(position, "expected a distance, finite and not negative")
    _, unit, of_unit = tokens[1] if len(tokens) > 1 else ("", "", 0)
    if unit and unit not in LENGTHS:
        raise ConditionError(of_unit, f"expected {' or '.join(LENGTHS)}")
    if len(tokens) > 2:
        raise ConditionError(tokens[2][2], "expected nothing more")
    bound = float(number) + 0.0
    if unit and not math.isfinite(bound * LENGTHS[unit]):
        raise ConditionError(position, "the number is too large for its unit")
    return Condition("near", op, bound, unit, hull[0])


def _key(text: str, position: int) -> str:
    if text.startswith('"'):
        try:
            key = json.loads(text)
        except ValueError:
            raise ConditionError(position, "expected a key, or a string of JSON in quotes") from None
    elif PLAIN_KEY.fullmatch(text) is None:
        raise ConditionError(position, "expected a key, in quotes if it has spaces, or in and an area")
    else:
        key = text
    try:
        size = len(key.encode())
    except UnicodeEncodeError:
        size = 0
    if not 0 < size <= MOST_KEY_BYTES:
        raise ConditionError(position, f"a key has 1 to {MOST_KEY_BYTES} bytes in UTF-8")
    return str(key)


def _key_text(key: Place) -> str:
    text = str(key)
    return text if PLAIN_KEY.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def _span(seconds: float) -> str:
    for unit, each in SECONDS.items():
        if (seconds / each).is_integer():
            return f"{int(seconds / each)}{unit}"
    return f"{number_text(seconds)}s"
