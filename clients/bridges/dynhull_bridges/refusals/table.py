"""The form of the tables."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

Code = int | str | type[Exception] | None  # None where the client has no code for it


class Meaning(Enum):
    """Whether what was refused may succeed later.

    Attributes:
        PASSES: it may, as with a broker that starts, elects a leader, is full or has too many connections.
        FINAL: it never will, as without rights or where it is malformed.
        DOUBTFUL: a broker that is still recovering says so, too; final only if it says so for some seconds.
    """

    PASSES = "passes"
    FINAL = "final"
    DOUBTFUL = "doubtful"


@dataclass(frozen=True)
class Refusals:
    """What the refusals of a broker mean.

    Attributes:
        rows: for each meaning the codes of the broker, with what they say.
        otherwise: the meaning of all other codes.
    """

    rows: Mapping[Meaning, Mapping[Code, str]]
    otherwise: Meaning
    _meanings: dict[Code, Meaning] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._meanings.update((code, meaning) for meaning, codes in self.rows.items() for code in codes)

    def meaning(self, code: Code) -> Meaning:
        """The meaning of a code."""
        return self._meanings.get(code, self.otherwise)
