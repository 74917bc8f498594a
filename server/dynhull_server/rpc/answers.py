"""What hulls are for, worked out from their vertices: long work for large hulls."""

import asyncio
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from dynhull import DynamicHull, measure
from dynhull.arrays import Points
from dynhull.envelope import Frontier, PhaseDiagram
from dynhull.margin import max_margin
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2

from ..state.hull_state import Counts
from .encode import encode_measures, encode_points

Answer = TypeVar("Answer")
Encoding = points_pb2.PointEncoding

# With so few the trip to another thread would be a good part of the time.
FEW_ROWS = 16


async def aside(answer: Callable[[], Answer], rows: int) -> Answer:
    """What a function that looks at so many rows returns: called in another thread unless they are few."""
    return answer() if rows <= FEW_ROWS else await asyncio.to_thread(answer)


def measures(counts: Counts, vertices: Points, encoding: Encoding) -> pb.GetMeasuresResponse:
    """All measures of a hull."""
    (x, y), radius = measure.min_circle(vertices)
    return pb.GetMeasuresResponse(
        revision=counts.revision,
        measures=encode_measures(vertices),
        diameter=measure.diameter(vertices),
        width=measure.width(vertices),
        min_box=encode_points(measure.min_box(vertices), encoding),
        min_perimeter_box=encode_points(measure.min_perimeter_box(vertices), encoding),
        min_circle_x=x,
        min_circle_y=y,
        min_circle_radius=radius,
    )


def separation(
    counts: Counts, vertices: Points, other_counts: Counts, other_vertices: Points, encoding: Encoding
) -> pb.SeparateResponse:
    """How two hulls, neither of them empty, lie to each other."""
    # A DynamicHull finds an extreme vertex without looking at all of them.
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


def phase_diagram(counts: Counts, vertices: Points, entries: Points, encoding: Encoding) -> pb.PhaseDiagramResponse:
    """The phase diagram of entries that are compositions and energies, and what it says of others."""
    diagram = PhaseDiagram(vertices)
    found = diagram.decompose(entries[:, 0])
    return pb.PhaseDiagramResponse(
        revision=counts.revision,
        stable=encode_points(diagram.stable(), encoding),
        energies_above_hull=diagram.energy_above_hull(entries),
        left=encode_points(found.phases[:, 0], encoding),
        right=encode_points(found.phases[:, 1], encoding),
        left_shares=found.shares[:, 0],
        right_shares=found.shares[:, 1],
    )


def frontier(
    counts: Counts, vertices: Points, points: Points, rates: Sequence[float], encoding: Encoding
) -> pb.FrontierResponse:
    """The efficient frontier of risks and returns, and what it says of others. Without vertices, there are no rates."""
    offers = Frontier(vertices)
    efficient = offers.efficient()
    turns = Frontier(efficient).tangencies()  # those beyond the greatest return left out
    tangencies = np.array([offers.tangency(rate) for rate in rates]).reshape(-1, 2)
    return pb.FrontierResponse(
        revision=counts.revision,
        efficient=encode_points(efficient, encoding),
        turning_rates=turns.rates,
        dominated=offers.dominated(points),
        tangencies=encode_points(tangencies, encoding),
        sharpe_ratios=[offers.sharpe_ratio(rate) for rate in rates],
    )
