"""What a verification of fences finds wrong."""

from typing import NamedTuple

from ...alarms.rule import called
from ..model.records import Key


class FenceFault(NamedTuple):
    """One thing about a fence that is not as it must be.

    Attributes:
        fence: the name of the fence.
        hull: the name of the subject's hull; empty where there is no subject.
        key: the key of the subject, or None.
        sequence: that of the event that is wrong; 0 for a state.
        expected: what must be.
        found: what is.
    """

    fence: str
    hull: str
    key: Key | None
    sequence: int
    expected: str
    found: str

    def __str__(self) -> str:
        hull = f"hull {self.hull!r}" if self.hull else ""
        subject = hull if self.key is None else f"key {self.key!r} of {hull}"
        event = f"event {self.sequence}" if self.sequence else ""
        where = ", ".join(filter(None, (called(self.fence), subject, event)))
        return f"{where}: expected {self.expected}, found {self.found}"
