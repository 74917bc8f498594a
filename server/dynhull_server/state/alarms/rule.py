"""What raises an alarm, and what clears it."""

from dataclasses import dataclass
from functools import cached_property

from .conditions import SILENT, Condition, condition_of

# What a batch that leaves the outline as it is cannot change.
OF_OUTLINES = frozenset({"area", "perimeter", "diameter", "width", "vertices"})
# Alarms and fences have names of their own: no name of a fence has a colon.
MARK = "alarm:"
MICROSECONDS = 10**6


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
    def of_points(self) -> bool:
        """Whether it compares the number of points, which may change with the vertices as they are."""
        return self.raises.measure == "count"

    @cached_property
    def of_outline(self) -> bool:
        """Whether nothing but a change of the outline means anything for it."""
        return self.raises.measure in OF_OUTLINES

    def suits(self, *, geographic: bool) -> bool:
        """Whether hulls in the plane, or on the globe, have its measure."""
        return self.raises.measure != "width" if geographic else not (self.raises.unit or self.clears.unit)


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
