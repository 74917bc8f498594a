"""Answers computed from the vertices of hulls, in steps, because they take long for large hulls."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from dynhull import DynamicHull, gjk, globe, measure
from dynhull.arrays import Points
from dynhull.envelope import Frontier, PhaseDiagram
from dynhull.margin import max_margin
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2

from ..engine.measures import HullMeasures
from ..engine.steps import BLOCK, Run, in_blocks
from ..state.batch import NO_POINTS
from ..state.frames import out_of_reach
from ..state.hull_state import Counts
from .decode import InvalidFieldError
from .encode import encode_measures, encode_points

Encoding = points_pb2.PointEncoding


async def measures(
    counts: Counts, vertices: Points, found: HullMeasures, encoding: Encoding, run: Run, *, geographic: bool
) -> pb.GetMeasuresResponse:
    """All measures of a hull, `found` among them."""
    diameter, width = found.diameter, found.width
    if diameter is None:
        diameter = await run(partial((globe if geographic else measure).diameter, vertices))
    if geographic:
        x = y = math.nan
        if counts.center is not None:
            x, y = await run(partial(globe.label_point, vertices, counts.center))
        return pb.GetMeasuresResponse(
            revision=counts.revision,
            measures=encode_measures(found),
            diameter=diameter,
            width=math.nan,
            min_circle_x=math.nan,
            min_circle_y=math.nan,
            min_circle_radius=math.nan,
            label_x=x,
            label_y=y,
            geographic=True,
        )
    (x, y), radius = await run(partial(measure.min_circle, vertices))
    label_x, label_y = await run(partial(measure.label_point, vertices))
    return pb.GetMeasuresResponse(
        revision=counts.revision,
        measures=encode_measures(found),
        diameter=diameter,
        width=await run(partial(measure.width, vertices)) if width is None else width,
        min_box=encode_points(await run(partial(measure.min_box, vertices)), encoding),
        min_perimeter_box=encode_points(await run(partial(measure.min_perimeter_box, vertices)), encoding),
        min_circle_x=x,
        min_circle_y=y,
        min_circle_radius=radius,
        label_x=label_x,
        label_y=label_y,
    )


def separation(
    counts: Counts, vertices: Points, other_counts: Counts, other_vertices: Points, encoding: Encoding
) -> pb.SeparateResponse:
    """The separation of two non-empty hulls."""
    # A DynamicHull finds an extreme vertex without reading all of them.
    found = max_margin(DynamicHull(vertices), DynamicHull(other_vertices))
    normal_x, normal_y = found.normal.tolist()
    return pb.SeparateResponse(
        revision=counts.revision,
        other_revision=other_counts.revision,
        intersect=not found.separable,
        distance=found.margin,
        depth=found.depth,
        normal_x=normal_x,
        normal_y=normal_y,
        offset=found.offset,
        closest=encode_points(found.points, encoding),
    )


def separation_on_globe(
    counts: Counts, vertices: Points, other_counts: Counts, other_vertices: Points, encoding: Encoding
) -> pb.SeparateResponse:
    """The separation of two non-empty geographic hulls, whose centres may differ.

    Raises:
        InvalidFieldError: no centre has both of them within reach.
    """
    frame = _common_frame(counts, vertices, other_counts, other_vertices)
    hulls = DynamicHull(frame.project(vertices)[0]), DynamicHull(frame.project(other_vertices)[0])
    apart = not gjk.intersect(*hulls)
    nearest = 0.0
    if apart:
        nearest = min(
            float(globe.distance(vertices, other_vertices).min()), float(globe.distance(other_vertices, vertices).min())
        )
    nan = math.nan
    return pb.SeparateResponse(
        revision=counts.revision,
        other_revision=other_counts.revision,
        intersect=not apart,
        distance=nearest,
        depth=nan,
        normal_x=nan,
        normal_y=nan,
        offset=nan,
        closest=encode_points(NO_POINTS, encoding),
    )


def _common_frame(counts: Counts, vertices: Points, other_counts: Counts, other_vertices: Points) -> globe.Gnomonic:
    """A projection of both hulls: about the centre of one of them, or the mean direction of the vertices."""
    both = np.concatenate((vertices, other_vertices))
    for center in (counts.center, other_counts.center):
        assert center is not None  # there are vertices
        frame = globe.Gnomonic(center)
        if out_of_reach(frame, both) is None:
            return frame
    frame = globe.Gnomonic.about(both)
    misplaced = out_of_reach(frame, both)
    if misplaced is not None:
        raise InvalidFieldError(
            "other_name", misplaced.place, f"the two hulls are too far apart to compare: {misplaced.problem}"
        )
    return frame


async def phase_diagram(
    counts: Counts, vertices: Points, entries: Points, encoding: Encoding, run: Run
) -> pb.PhaseDiagramResponse:
    """The phase diagram of a hull of compositions and energies, and its results for other entries."""
    diagram: PhaseDiagram = await run(partial(PhaseDiagram, vertices))
    stable = await run(diagram.stable)

    def decomposed(rows: slice) -> npt.NDArray[np.float64]:
        """(k, 2, 3) the phases to the left and right, each with its share."""
        found = diagram.decompose(entries[rows, 0])
        return np.concatenate((found.phases, found.shares[:, :, np.newaxis]), axis=2)

    parts = await in_blocks(run, decomposed, len(entries))
    energies = await in_blocks(run, lambda rows: diagram.energy_above_hull(entries[rows]), len(entries))
    response: pb.PhaseDiagramResponse = await run(
        lambda: pb.PhaseDiagramResponse(
            revision=counts.revision,
            stable=encode_points(stable, encoding),
            energies_above_hull=energies,
            left=encode_points(parts[:, 0, :2], encoding),
            right=encode_points(parts[:, 1, :2], encoding),
            left_shares=parts[:, 0, 2],
            right_shares=parts[:, 1, 2],
        )
    )
    return response


async def frontier(
    counts: Counts, vertices: Points, points: Points, rates: Sequence[float], encoding: Encoding, run: Run
) -> pb.FrontierResponse:
    """The efficient frontier of a hull of risks and returns, and its results for other points.

    Without vertices, `rates` must be empty.
    """
    offers: Frontier = await run(partial(Frontier, vertices))
    efficient: Points = await run(offers.efficient)

    def turns(rows: slice) -> npt.NDArray[np.float64]:
        """The rates at which the tangency leaves these corners; none beyond the greatest return."""
        return Frontier(efficient[rows.start : rows.stop + 1]).tangencies().rates

    def tangencies(rows: slice) -> Points:
        return np.array([offers.tangency(rate) for rate in rates[rows]]).reshape(-1, 2)

    def ratios(rows: slice) -> npt.NDArray[np.float64]:
        return np.array([offers.sharpe_ratio(rate) for rate in rates[rows]])

    turning_rates = await in_blocks(run, turns, max(len(efficient) - 1, 0))
    block = max(BLOCK, len(efficient))  # each block reads the whole frontier
    dominated = await in_blocks(run, lambda rows: offers.dominated(points[rows]), len(points), block)
    touched, sharpe_ratios = [await in_blocks(run, each, len(rates)) for each in (tangencies, ratios)]
    response: pb.FrontierResponse = await run(
        lambda: pb.FrontierResponse(
            revision=counts.revision,
            efficient=encode_points(efficient, encoding),
            turning_rates=turning_rates,
            dominated=dominated,
            tangencies=encode_points(touched, encoding),
            sharpe_ratios=sharpe_ratios,
        )
    )
    return response
