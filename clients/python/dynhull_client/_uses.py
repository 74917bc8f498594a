"""Calls that put a hull to use, made as those in `_calls`, and their answers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dynhull._value import Value
from dynhull.arrays import as_coordinate
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Call, encode_layer, encoded
from ._messages import Measures, Points, decode_measures, decode_points

if TYPE_CHECKING:
    from collections.abc import Iterable

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Measured(Measures):
    """All measures of a hull at one revision, as in `dynhull.DynamicHull`. Without points: lengths 0, coordinates NaN.

    `min_box` and `min_perimeter_box` are (4, 2) corners, counter-clockwise; `min_circle` is a centre and a radius;
    `label_point` is inside, for a label. A geographic hull has lengths in metres and areas in square metres, but no
    centroid, width, boxes and circle: NaN, and no corners. From a server of an earlier version, `label_point` is NaN.
    """

    diameter: float
    width: float
    min_box: Points
    min_perimeter_box: Points
    min_circle: tuple[tuple[float, float], float]
    revision: int
    label_point: tuple[float, float] = (nan, nan)
    geographic: bool = False


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Separation(Value):
    """The distance or overlap of two hulls, each at one revision. Lengths are within 1e-12 of the hulls' size.

    Of two geographic hulls, `distance` is the least one of a vertex of one hull to the other hull, in metres; depth,
    normal and offset are NaN, and there are no closest points.

    Attributes:
        revision: the revision of the first hull.
        other_revision: the revision of the other hull.
        intersect: whether they have a common point; touching counts. Exact.
        distance: 0.0 if they intersect; otherwise also the maximum margin between the two sets of points.
        depth: the length of the shortest move that separates them; 0.0 if they do not overlap.
        normal: unit vector from the first hull to the other. If they overlap, moving the other hull along it by `depth`
            separates them. If they only touch, it is zero or the direction in which they separate.
        offset: the line normal @ x = offset is halfway between them; the value is less on the first hull's side.
        closest: (2, 2) the closest point of each hull; if they overlap, the deepest point of each.
    """

    revision: int
    other_revision: int
    intersect: bool
    distance: float
    depth: float
    normal: tuple[float, float]
    offset: float
    closest: Points


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Phases(Value):
    """A hull as a binary phase diagram, and its answers for k entries, as in `dynhull.envelope.PhaseDiagram`.

    Attributes:
        revision: the hull's revision.
        stable: (h, 2) stable entries, left to right.
        energies_above_hull: (k,) height of each entry above the lower hull; negative for an entry that would become
            stable.
        phases: (k, 2, 2) the two stable entries that each entry decomposes into; at a stable composition that entry
            twice.
        shares: (k, 2) the share of each of the two; their sum is 1. NaN, as all answers, beyond the outermost stable
            entries.
    """

    revision: int
    stable: Points
    energies_above_hull: Doubles
    phases: Doubles
    shares: Doubles


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Efficient(Value):
    """A hull as an efficient frontier, and its answers for k points and r rates, as in `dynhull.envelope.Frontier`.

    Attributes:
        revision: the hull's revision.
        efficient: (h, 2) corners of the frontier, from least risk to most return.
        turning_rates: (h - 1,) ascending risk-free rates: at turning_rates[i] the tangency moves from efficient[i] to
            efficient[i + 1].
        dominated: (k,) whether the frontier offers something better than each point.
        tangencies: (r, 2) the point with the highest excess return per risk, for each rate.
        sharpe_ratios: (r,) the excess return per risk of that point.
    """

    revision: int
    efficient: Points
    turning_rates: Doubles
    dominated: npt.NDArray[np.bool_]
    tangencies: Points
    sharpe_ratios: Doubles


def get_measures(name: str, *, layer: int = 1, min_revision: int = 0, timeout: float | None = None) -> Call[Measured]:
    """All measures: those of `get_hull`, and the diameter, width, smallest boxes and smallest circle.

    `layer` as for `locate`.
    """
    request = pb.GetMeasuresRequest(name=name, min_revision=min_revision, layer=encode_layer(layer))

    def decode(response: pb.GetMeasuresResponse) -> Measured:
        return Measured(
            **asdict(decode_measures(response.measures)) | {"diameter": response.diameter, "width": response.width},
            min_box=decode_points(response.min_box),
            min_perimeter_box=decode_points(response.min_perimeter_box),
            min_circle=((response.min_circle_x, response.min_circle_y), response.min_circle_radius),
            revision=response.revision,
            label_point=(response.label_x, response.label_y) if response.HasField("label_x") else (nan, nan),
            geographic=response.geographic,
        )

    return Call("GetMeasures", request, decode, timeout)


def separate(
    name: str, other: str, *, min_revision: int = 0, other_min_revision: int = 0, timeout: float | None = None
) -> Call[Separation]:
    """Whether two hulls intersect, their distance and the line between them, or the depth of their overlap.

    A hull overlaps itself by its width. HullEmptyError if one of them has no points. Two geographic hulls may have
    different centres; HullUnsuitableError if only one of the hulls is geographic.

    Args:
        name: the first hull.
        other: the other hull.
        min_revision: a revision of the first hull to wait for.
        other_min_revision: a revision of the other hull to wait for.
        timeout: seconds, instead of the client's.
    """
    request = pb.SeparateRequest(
        name=name, min_revision=min_revision, other_name=other, other_min_revision=other_min_revision
    )

    def decode(response: pb.SeparateResponse) -> Separation:
        return Separation(
            revision=response.revision,
            other_revision=response.other_revision,
            intersect=response.intersect,
            distance=response.distance,
            depth=response.depth,
            normal=(response.normal_x, response.normal_y),
            offset=response.offset,
            closest=decode_points(response.closest),
        )

    return Call("Separate", request, decode, timeout)


def phase_diagram(
    name: str, entries: npt.ArrayLike = (), *, min_revision: int = 0, timeout: float | None = None
) -> Call[Phases]:
    """The hull as a binary phase diagram: the stable entries, and the decomposition of (k, 2) entries. Exact.

    An entry, like each point of the hull, is a composition, which is the share of the second element from 0 to 1, and
    an energy. HullUnsuitableError if the hull has a point with another composition.
    """
    request = pb.PhaseDiagramRequest(name=name, min_revision=min_revision, entries=encoded(entries, "entries"))

    def decode(response: pb.PhaseDiagramResponse) -> Phases:
        return Phases(
            revision=response.revision,
            stable=decode_points(response.stable),
            energies_above_hull=np.array(response.energies_above_hull, np.float64),
            phases=np.stack((decode_points(response.left), decode_points(response.right)), axis=1),
            shares=np.column_stack((response.left_shares, response.right_shares)),
        )

    return Call("PhaseDiagram", request, decode, timeout)


def frontier(
    name: str,
    points: npt.ArrayLike = (),
    rates: Iterable[float] = (),
    *,
    min_revision: int = 0,
    timeout: float | None = None,
) -> Call[Efficient]:
    """The hull, whose points are risk and return, as an efficient frontier. Exact.

    HullUnsuitableError if the hull has a point without positive risk; HullEmptyError for rates if it has no points.

    Args:
        name: the hull.
        points: (k, 2) risks and returns to compare with the frontier.
        rates: (r,) risk-free rates whose tangencies to return.
        min_revision: a revision to wait for.
        timeout: seconds, instead of the client's.
    """
    request = pb.FrontierRequest(
        name=name,
        min_revision=min_revision,
        points=encoded(points, "points"),
        rates=[as_coordinate(rate, f"rates row {row}") for row, rate in enumerate(rates)],
    )

    def decode(response: pb.FrontierResponse) -> Efficient:
        return Efficient(
            revision=response.revision,
            efficient=decode_points(response.efficient),
            turning_rates=np.array(response.turning_rates, np.float64),
            dominated=np.array(response.dominated, np.bool_),
            tangencies=decode_points(response.tangencies),
            sharpe_ratios=np.array(response.sharpe_ratios, np.float64),
        )

    return Call("Frontier", request, decode, timeout)
