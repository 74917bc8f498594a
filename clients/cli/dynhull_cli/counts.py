"""What became of rows, summed over batches."""

from dynhull_client import Applied
from dynhull_surface.counts import COUNTS, text_of


class Counts(dict[str, int]):
    """The counts of batches, by name, all of them."""

    def __init__(self) -> None:
        super().__init__(dict.fromkeys(COUNTS, 0))

    def add(self, applied: Applied) -> None:
        """Add those of a batch."""
        for name in COUNTS:
            self[name] += getattr(applied, name)

    @property
    def taken(self) -> int:
        """The number of rows that are in the hull."""
        return self["inserted"] + self["moved"]

    def __str__(self) -> str:
        """The counts that are not 0: "2 new, 1 late"; empty if all rows are new."""
        others = {name: count for name, count in self.items() if name != "inserted"}
        return text_of({"new": self["inserted"], **others})[2:] if any(others.values()) else ""
