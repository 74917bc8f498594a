"""What the points of a hull can be read as, beside places in a plane."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from ..state.errors import HullUnsuitableError


@dataclass(frozen=True, slots=True)
class Reading:
    """A meaning of points.

    Attributes:
        rule: what they must be, to have it.
        misfits: which rows of an (n, 2) array are not so.
    """

    rule: str
    misfits: Callable[[Points], npt.NDArray[np.bool_]]

    def require(self, name: str, vertices: Points) -> None:
        """Raise HullUnsuitableError where the hull with these vertices cannot be read so."""
        misfits = vertices[self.misfits(vertices)]
        if len(misfits):
            x, y = misfits[0].tolist()
            raise HullUnsuitableError(name, (x, y), self.rule)


ENTRIES = Reading("a composition is from 0 to 1", lambda xy: (xy[:, 0] < 0) | (xy[:, 0] > 1))
RISKS = Reading("a risk is positive", lambda xy: xy[:, 0] <= 0)
