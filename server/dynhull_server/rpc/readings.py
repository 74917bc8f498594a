"""Interpretations of points other than positions in a plane."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from ..state.errors import HullUnsuitableError


@dataclass(frozen=True, slots=True)
class Reading:
    """An interpretation of points.

    Attributes:
        rule: the condition on the points, for error messages.
        misfits: the rows of an (n, 2) array that violate it, as a mask.
    """

    rule: str
    misfits: Callable[[Points], npt.NDArray[np.bool_]]

    def require(self, name: str, vertices: Points) -> None:
        """Raise HullUnsuitableError if one of the vertices violates the rule."""
        misfits = vertices[self.misfits(vertices)]
        if len(misfits):
            x, y = misfits[0].tolist()
            raise HullUnsuitableError(name, f"has the point {(x, y)}: {self.rule}", (x, y))


ENTRIES = Reading("a composition is from 0 to 1", lambda xy: (xy[:, 0] < 0) | (xy[:, 0] > 1))
RISKS = Reading("a risk is positive", lambda xy: xy[:, 0] <= 0)
