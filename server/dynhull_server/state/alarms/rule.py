"""What raises an alarm, and what clears it."""

from dataclasses import dataclass
from functools import cached_property
from typing import cast

from dynhull.measure import Compared

from ..records import HullSettings
from .conditions import SILENT, Condition, condition_of

# What a batch that leaves the outline as it is cannot change.
OF_OUTLINES = frozenset({"area", "perimeter", "diameter", "width", "vertices", "near", "vertex in"})
# Alarms and fences have names of their own: no name of a fence has a colon.
MARK = "alarm:"
MICROSECONDS = 10**6
# Keys that are integers are below it.
KEYS = 2**64


@dataclass(frozen=True)
class AlarmRule:
    """The rule of an alarm.

    Attributes:
        when: the text of the condition that raises it.
        clear: that of the condition that clears it.
        hold: for how many microseconds the first must hold before the alarm is raised, 0 for none.
    """

    when: str
    clear: str
    hold: int = 0

    @cached_property
    def raises(self) -> Condition:
        """The condition that raises it."""
        return condition_of(self.when)

    @cached_property
    def clears(self) -> Condition:
        """The condition that clears it; for silence the opposite."""
        return self.raises.opposite if self.silence else condition_of(self.clear)

    @cached_property
    def silence(self) -> int:
        """For how many microseconds a hull that raises it is silent; 0 for other conditions."""
        return round(self.raises.bound * MICROSECONDS) if self.raises.measure == SILENT else 0

    @cached_property
    def counts(self) -> bool:
        """Whether what it compares is a number that is looked up: of points, or of vertices in an area."""
        return self.raises.measure == "count" or self.raises.of_vertices

    @cached_property
    def of_outline(self) -> bool:
        """Whether nothing but a change of the outline means anything for it."""
        return self.raises.measure in OF_OUTLINES

    @cached_property
    def steady(self) -> tuple[tuple[Compared, float, int, int], ...]:
        """The measure, a bound, and the least and the greatest sign of it less the bound with which all stays as it is.

        Of a hull for which nothing is raised, for which the condition holds and waits, and for which it is raised.
        """
        raises, clears, measure = self.raises, self.clears, cast("Compared", self.raises.measure)
        return (
            (measure, raises.bound, *raises.signs(holding=False)),
            (measure, raises.bound, *raises.signs(holding=True)),
            (measure, clears.bound, *clears.signs(holding=False)),
        )

    @property
    def other(self) -> str | None:
        """The name of the other hull that it compares hulls with, None for none."""
        return self.raises.other

    def suits(self, settings: HullSettings, other: HullSettings | None = None) -> bool:
        """Whether hulls with these settings have its measure; `other` are those of the other hull that it names."""
        raises, geographic = self.raises, settings.geographic
        if other is not None and other.geographic != geographic:
            return False
        if raises.measure == "vertex" and not is_key(str(raises.subject), settings.identity):
            return False
        return raises.measure != "width" if geographic else not (raises.unit or self.clears.unit)


def is_key(text: str, identity: str) -> bool:
    """Whether a text is a key of hulls whose points are identified so."""
    if identity == "int":
        return text.isascii() and text.isdecimal() and str(int(text)) == text and int(text) < KEYS
    return identity == "str"


def marked(name: str) -> str:
    """The name of an alarm among those of fences."""
    return MARK + name


def is_alarm(name: str) -> bool:
    """Whether a name among those of fences is that of an alarm."""
    return name.startswith(MARK)


def called(name: str) -> str:
    """A fence or an alarm, given its name among those of fences, in the words of messages."""
    return f"alarm {unmarked(name)!r}" if is_alarm(name) else f"fence {name!r}"


def unmarked(name: str) -> str:
    """The name of a fence or an alarm, as its callers know it."""
    return name.removeprefix(MARK)
