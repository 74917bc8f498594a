"""Units of the coordinates."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Units:
    """The units of x and y, such as "km"; empty where unknown."""

    x: str = ""
    y: str = ""

    @property
    def same(self) -> bool:
        """Whether a distance in x compares with one in y, so that both axes should have one scale."""
        return self.x == self.y

    @property
    def known(self) -> bool:
        """Whether there are any."""
        return bool(self.x or self.y)

    @property
    def area(self) -> str:
        """The unit of areas."""
        if self.same:
            return f"{self.x}²" if self.x else "square units"
        return f"{self.x or 'x'} by {self.y or 'y'}"


NO_UNITS = Units()
