"""What hulls are for, asked of the server: calls as those in `calls`, and their answers."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from dynhull.arrays import as_coordinate
from dynhull_proto.v1 import hull_service_pb2 as pb

from .calls import Call, encoded
from .messages import Measures, Points, decode_measures, decode_points

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Measured(Measures):
    """All measures of a hull at one revision, as of `dynhull.DynamicHull`: of one without points 0 and NaN.

    `min_box` and `min_perimeter_box` are (4, 2) corners, counter-clockwise; `min_circle` is a centre and a radius.
    """

    diameter: float
    width: float
    min_box: Points
    min_perimeter_box: Points
    min_circle: tuple[tuple[float, float], float]
    revision: int


@dataclass(frozen=True, slots=True)
class Separation:
    """How two hulls, each at one revision, lie to each other; lengths within 1e-12 of their size.

    Attributes:
        revision: the first hull's.
        other_revision: the other's.
        intersect: whether they have a point in common; touching counts. Exact.
        distance: 0.0 where they intersect. The maximum margin between the two sets of points.
        depth: how far one must move to part them; 0.0 where they do not overlap.
        normal: unit vector from the first to the other. Where they overlap, moving the other so by `depth` parts them.
            Where they merely touch, zero or the direction in which they part.
        offset: points x with normal @ x = offset are halfway; less on the side of the first.
        closest: (2, 2) the closest points, the first hull's and the other's; overlapping, the deepest ones.
    """

    revision: int
    other_revision: int
    intersect: bool
    distance: float
    depth: float
    normal: tuple[float, float]
    offset: float
    closest: Points


@dataclass(frozen=True, slots=True)
class Phases:
    """A hull as a binary phase diagram, and what it says of k entries, as of `dynhull.envelope.PhaseDiagram`.

    Attributes:
        revision: the hull's.
        stable: (h, 2) stable entries, left to right.
        energies_above_hull: (k,) how far each entry lies above the lower hull, negative for what would change it.
        phases: (k, 2, 2) what each falls into: the stable entries on both sides; at a stable composition that one,
            twice.
        shares: (k, 2) of each of them, in sum 1. NaN, as all answers, beyond the outermost stable entries.
    """

    revision: int
    stable: Points
    energies_above_hull: Doubles
    phases: Doubles
    shares: Doubles


@dataclass(frozen=True, slots=True)
class Efficient:
    """A hull as an efficient frontier, and what it says of others, as of `dynhull.envelope.Frontier`.

    Attributes:
        revision: the hull's.
        efficient: (h, 2) corners of the frontier, from least risk to most return.
        turning_rates: (h - 1,) rising risk-free rates: at turning_rates[i] the tangency moves from efficient[i] on.
        dominated: (k,) whether the frontier offers something better than each of the points asked about.
        tangencies: (r, 2) the point of most excess return per risk, for each of the rates asked about.
        sharpe_ratios: (r,) its excess return per risk.
    """

    revision: int
    efficient: Points
    turning_rates: Doubles
    dominated: npt.NDArray[np.bool_]
    tangencies: Points
    sharpe_ratios: Doubles


def get_measures(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Measured]:
    """Every measure: those of `get_hull`, diameter, width, smallest boxes and smallest circle."""
    request = pb.GetMeasuresRequest(name=name, min_revision=min_revision)

    def decode(response: pb.GetMeasuresResponse) -> Measured:
        return Measured(
            **asdict(decode_measures(response.measures)),
            diameter=response.diameter,
            width=response.width,
            min_box=decode_points(response.min_box),
            min_perimeter_box=decode_points(response.min_perimeter_box),
            min_circle=((response.min_circle_x, response.min_circle_y), response.min_circle_radius),
            revision=response.revision,
        )

    return Call("GetMeasures", request, decode, timeout)


def separate(
    name: str, other: str, *, min_revision: int = 0, other_min_revision: int = 0, timeout: float | None = None
) -> Call[Separation]:
    """Whether two hulls intersect, how far apart they are and the line between them, or how deep they overlap.

    A hull and itself are read once: it overlaps itself by its width. HullEmptyError where one of them has no points.

    Args:
        name: the first hull.
        other: the other.
        min_revision: a revision of the first hull to wait for.
        other_min_revision: one of the other.
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
    """The hull as a binary phase diagram: the stable entries, and what (k, 2) entries fall into. Exact.

    Entries, the hull's points among them, are compositions, the share of the second element from 0 to 1, and energies.
    HullUnsuitableError where the hull has a point of another composition.
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
    """The hull as an efficient frontier, its points being risk and return. Exact.

    HullUnsuitableError where the hull has a point without positive risk, HullEmptyError for rates without points.

    Args:
        name: the hull.
        points: (k, 2) risks and returns to compare with the frontier.
        rates: (r,) risk-free rates to tell the tangencies of.
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
