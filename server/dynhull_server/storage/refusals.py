"""What the refusals of a store mean at the start of a server: the form of the tables, of which each store has one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

Code = int | str | None  # None where a refusal has no code


class Meaning(IntEnum):
    """Whether what was refused may succeed later, the most hopeful first.

    Attributes:
        PASSES: it may, as with a database that starts or has too many connections: it is waited for.
        DOUBTFUL: it may, or a name or an address is wrong: it is waited for, but not for ever.
        FINAL: it will not, before somebody changes something.
    """

    PASSES = 0
    DOUBTFUL = 1
    FINAL = 2


@dataclass(frozen=True)
class Refusals:
    """What the refusals of a store mean.

    Attributes:
        rows: for each meaning codes of the store, or of a class of its codes, with what they say.
        otherwise: the meaning of all other codes.
    """

    rows: Mapping[Meaning, Mapping[Code, str]]
    otherwise: Meaning
    _meanings: dict[Code, Meaning] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._meanings.update((code, meaning) for meaning, codes in self.rows.items() for code in codes)

    def meaning(self, *codes: Code) -> Meaning:
        """The meaning of the first of the codes that is in the table, from the code itself to its class."""
        return next((self._meanings[each] for each in codes if each in self._meanings), self.otherwise)
