"""The conditions of alarms, as people write them: `area > 500 km2`, or `silent 5m`."""

import math
import re
from dataclasses import dataclass
from typing import Literal

Measure = Literal["area", "perimeter", "diameter", "width", "count", "vertices", "silent"]
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
}
OPPOSITE: dict[Op, Op] = {">": "<=", ">=": "<", "<": ">=", "<=": ">"}
SILENT: Literal["silent"] = "silent"
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
TOKEN = re.compile(rf"(?P<word>[A-Za-z_]\w*)|(?P<op>[<>]=?)|(?P<number>{NUMBER})|(?P<other>\S)")
A_MEASURE = f"{', '.join(UNITS)} or {SILENT}"
WHOLE = 2**53
# Units of time, in seconds.
SECONDS = {"d": 86_400.0, "h": 3_600.0, "m": 60.0, "s": 1.0, "ms": 1e-3}
LEAST_SILENCE, LONGEST_SILENCE = 1e-3, 100 * 366 * 86_400.0

Token = tuple[str, str, int]  # its kind, its text, and its position from 1


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
class Condition:
    """A measure of a hull compared with a bound.

    Attributes:
        measure: the measure; of "silent", the seconds since the hull has changed.
        op: how it is compared.
        bound: the bound, in its unit.
        unit: the unit; empty for none.
    """

    measure: Measure
    op: Op
    bound: float
    unit: str = ""

    def __str__(self) -> str:
        """The shortest form."""
        if self.measure == SILENT:
            return f"{SILENT} {_span(self.bound)}"
        return f"{self.measure} {self.op} {_number(self.bound)} {self.unit}".rstrip()

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
        return Condition(self.measure, OPPOSITE[self.op], self.bound, self.unit)

    def holds(self, sign: int) -> bool:
        """Whether it holds, given the sign of the measure less the bound."""
        return (
            sign > 0 if self.op == ">" else sign >= 0 if self.op == ">=" else sign < 0 if self.op == "<" else sign <= 0
        )

    def meets(self, other: "Condition") -> bool:
        """Whether both can hold at once, given another one of the same measure and the other direction."""
        if self.limit == other.limit:
            return "=" in self.op and "=" in other.op
        return (self.limit < other.limit) == self.over


def condition_of(text: str) -> Condition:
    """The condition that a text is, or raise ConditionError."""
    tokens = [(each.lastgroup or "", each[0], each.start() + 1) for each in TOKEN.finditer(text)]
    end = len(text) + 1
    kind, word, position = tokens[0] if tokens else ("", "", 1)
    if word == SILENT:
        return _silent(tokens, end)
    measure = next((each for each in UNITS if each == word), None)
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


def _number(value: float) -> str:
    return str(int(value)) if value.is_integer() and value < WHOLE else repr(value)


def _span(seconds: float) -> str:
    for unit, each in SECONDS.items():
        if (seconds / each).is_integer():
            return f"{int(seconds / each)}{unit}"
    return f"{_number(seconds)}s"
