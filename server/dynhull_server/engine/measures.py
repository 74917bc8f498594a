"""The measures of a hull: made once for all who look, until its vertices change."""

import math
from functools import partial
from typing import NamedTuple

from dynhull import globe, measure
from dynhull.arrays import Points

from .steps import Run

# The most vertices of a hull whose diameter and width are among its measures: of more they take far longer than others.
MOST_MEASURED = 256


class HullMeasures(NamedTuple):
    """The measures of a hull: of a plane in the unit of its coordinates, on the globe in metres.

    Attributes:
        area: its area.
        perimeter: the length of its boundary.
        centroid: of the area; NaN on the globe.
        bounds: the least and the greatest coordinates.
        diameter: the greatest distance of two vertices; None of more than `MOST_MEASURED`.
        width: the least distance of two parallel lines around the hull; None likewise, and on the globe.
    """

    area: float
    perimeter: float
    centroid: tuple[float, float]
    bounds: tuple[float, float, float, float]
    diameter: float | None
    width: float | None


async def measures_of(vertices: Points, run: Run, *, geographic: bool) -> HullMeasures:
    """The measures of the hull with these vertices, one step per measure; at once of few vertices."""
    if len(vertices) <= measure.FEW and not geographic:
        return HullMeasures(*measure.summary(vertices))
    module = globe if geographic else measure
    area, perimeter, bounds = [
        await run(partial(each, vertices)) for each in (module.area, module.perimeter, module.bounds)
    ]
    centroid = (math.nan, math.nan) if geographic else await run(partial(measure.centroid, vertices))
    diameter = width = None
    if len(vertices) <= MOST_MEASURED:
        diameter = await run(partial(module.diameter, vertices))
        width = None if geographic else await run(partial(measure.width, vertices))
    return HullMeasures(area, perimeter, centroid, bounds, diameter, width)
