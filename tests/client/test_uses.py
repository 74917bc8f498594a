"""Measures, separations, phase diagrams and frontiers of a server: the library's answers on the same points."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from dynhull import DynamicHull
from dynhull.envelope import Frontier, PhaseDiagram
from dynhull.margin import max_margin
from dynhull_client import (
    DeadlineError,
    HullClient,
    HullEmptyError,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidRequestError,
)

random = np.random.default_rng(8)
POINTS = np.round(random.normal(scale=9, size=(300, 2)), 2)
# Several on one line, one at both places, some at one composition.
ENTRIES = np.concatenate(
    [[[0, 0], [0, 2], [0.25, -0.5], [0.5, -1], [0.5, -1], [1, 0.125]], random.random((40, 2)) - 0.5]
)
ENTRIES[:, 0] = np.abs(ENTRIES[:, 0])
OFFERS = np.round(random.uniform([1, -2], [9, 12], (60, 2)), 1)


@pytest.fixture
def client(address: str, connect: type[HullClient]) -> Iterator[HullClient]:
    with connect(address) as client:
        yield client


@pytest.fixture
def make(client: HullClient, name: str):
    """Makes a hull of points and returns its name."""

    def make(points, which: str = "") -> str:
        client.create_hull(name + which)
        if len(points):
            client.apply(name + which, insert=points)
        return name + which

    return make


SETS = {
    "many": POINTS,
    "none": np.empty((0, 2)),
    "one": [[3, 4], [3, 4]],
    "on a line": [[0, 0], [1, 1], [3, 3]],
    "large": [[-1.5e308, -1.5e308], [1.5e308, 0], [0, 1.5e308]],
    "tiny": [[0, 0], [5e-324, 0], [0, 5e-324]],
}


@pytest.mark.parametrize("points", SETS.values(), ids=SETS)
def test_measures(client: HullClient, make, points) -> None:
    answer, expected = client.get_measures(make(points)), DynamicHull(points)
    assert answer.revision == bool(len(points))
    assert (answer.area, answer.perimeter) == (expected.area, expected.perimeter)
    for numbers, measured in [
        (answer.centroid, expected.centroid),
        (answer.bounds, expected.bounds),
        (answer.min_box, expected.min_box()),
        (answer.min_perimeter_box, expected.min_perimeter_box()),
        (answer.min_circle[0], expected.min_circle()[0]),
    ]:
        np.testing.assert_array_equal(numbers, measured)
    assert (answer.diameter, answer.width, answer.min_circle[1]) == (
        expected.diameter(),
        expected.width(),
        expected.min_circle()[1],
    )


@pytest.mark.parametrize("offset", [(40, 3), (9, 9), (0, 0)], ids=["apart", "overlapping", "the same"])
def test_separation(client: HullClient, make, offset) -> None:
    name, other = make(POINTS), make(POINTS + offset, "-other")
    client.apply(other, insert=[POINTS[0] + offset])
    answer, expected = client.separate(name, other), max_margin(DynamicHull(POINTS), DynamicHull(POINTS + offset))
    assert (answer.revision, answer.other_revision) == (1, 2)
    assert answer.intersect == (not expected.separable)
    assert (answer.distance, answer.depth, answer.offset) == (expected.margin, expected.depth, expected.offset)
    assert list(answer.normal) == expected.normal.tolist()
    assert answer.closest.tolist() == expected.points.tolist()


def test_touching_hulls_and_hulls_next_to_each_other(client: HullClient, make) -> None:
    name, other = make([[0, 0], [1, 0], [0.5, 1]]), make([[1, 0], [2, 0]], "-other")
    answer = client.separate(name, other)
    assert (answer.intersect, answer.distance, answer.depth) == (True, 0, 0)
    client.apply(other, move=([[1, 0]], [[np.nextafter(1, 2), 0]]))
    answer = client.separate(name, other)
    assert (answer.intersect, answer.distance, answer.depth) == (False, np.spacing(1.0), 0)


def test_a_hull_and_itself(client: HullClient, make) -> None:
    name = make([[0, 0], [4, 0], [4, 2], [0, 2]])
    answer = client.separate(name, name)
    assert (answer.revision, answer.other_revision) == (1, 1)
    assert (answer.intersect, answer.distance, answer.depth) == (True, 0, 2)
    one = make([[7, 7]], "-one")
    assert (client.separate(one, one).intersect, client.separate(one, one).depth) == (True, 0)


def test_two_hulls_wait_for_their_revisions(client: HullClient, make) -> None:
    name, other = make([[0, 0]]), make([[3, 4]], "-other")
    for revisions in ({"min_revision": 2}, {"other_min_revision": 2}):
        with pytest.raises(DeadlineError):
            client.separate(name, other, **revisions, timeout=0.05)
    with pytest.raises(DeadlineError):
        client.separate(name, name, other_min_revision=2, timeout=0.05)
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(client.separate, name, other, min_revision=2, other_min_revision=2)
        client.apply(other, insert=[[0, 2]])
        client.apply(name, insert=[[0, 1]])
        answer = waiting.result()
    assert (answer.revision, answer.other_revision, answer.distance) == (2, 2, 1)


def test_hulls_that_are_empty_or_not_there(client: HullClient, make) -> None:
    full, empty = make([[1, 1]]), make([], "-empty")
    for pair in ((full, empty), (empty, full), (empty, empty)):
        with pytest.raises(HullEmptyError, match=empty):
            client.separate(*pair)
    for pair in ((full, "not-there"), ("not-there", full)):
        with pytest.raises(HullNotFoundError, match="not-there"):
            client.separate(*pair)


@pytest.mark.parametrize("count", [0, 1, 2, len(ENTRIES)])
def test_phase_diagrams(client: HullClient, make, count: int) -> None:
    hull, diagram = make(ENTRIES[:count]), PhaseDiagram(ENTRIES[:count])
    answer, expected = client.phase_diagram(hull, ENTRIES), diagram.decompose(ENTRIES[:, 0])
    assert answer.revision == bool(count)
    assert answer.stable.tolist() == diagram.stable().tolist()
    np.testing.assert_array_equal(answer.energies_above_hull, diagram.energy_above_hull(ENTRIES))
    np.testing.assert_array_equal(answer.phases, expected.phases)
    np.testing.assert_array_equal(answer.shares, expected.shares)
    alone = client.phase_diagram(hull)
    assert alone.stable.tolist() == answer.stable.tolist()
    assert [each.shape for each in (alone.energies_above_hull, alone.phases, alone.shares)] == [(0,), (0, 2, 2), (0, 2)]


@pytest.mark.parametrize("count", [1, 2, len(OFFERS)])
def test_frontiers(client: HullClient, make, count: int) -> None:
    rates = [-3.0, 0.0, 1.25, 1e308, *Frontier(OFFERS[:count]).tangencies().rates.tolist()]
    answer, expected = client.frontier(make(OFFERS[:count]), OFFERS, rates), Frontier(OFFERS[:count])
    assert answer.revision == 1
    assert answer.efficient.tolist() == expected.efficient().tolist()
    assert answer.dominated.tolist() == expected.dominated(OFFERS).tolist()
    assert answer.tangencies.tolist() == [list(expected.tangency(rate)) for rate in rates]
    assert answer.sharpe_ratios.tolist() == [expected.sharpe_ratio(rate) for rate in rates]
    assert answer.turning_rates.tolist() == expected.tangencies().rates[: len(answer.efficient) - 1].tolist()


def test_a_frontier_without_points(client: HullClient, make) -> None:
    empty = make([])
    answer = client.frontier(empty, [[1, 2]])
    assert (answer.efficient.shape, answer.turning_rates.shape, answer.dominated.tolist()) == ((0, 2), (0,), [False])
    with pytest.raises(HullEmptyError):
        client.frontier(empty, rates=[0])


@pytest.mark.parametrize(
    ("ask", "point"),
    [("phase_diagram", [-0.5, 1]), ("phase_diagram", [2, 0]), ("frontier", [0, 1]), ("frontier", [-3, 1])],
)
def test_hulls_of_other_points(client: HullClient, make, ask: str, point) -> None:
    hull = make([[0.5, 1], [0.75, 2], point])
    with pytest.raises(
        HullUnsuitableError, match=str(tuple(map(float, point))).replace("(", r"\(").replace(")", r"\)")
    ):
        getattr(client, ask)(hull)
    client.apply(hull, delete=[point])
    assert getattr(client, ask)(hull).revision == 2


def test_bad_values(client: HullClient, make) -> None:
    hull = make([[0.5, 1]])
    for ask, message in [
        (lambda: client.phase_diagram(hull, [[0, 0], [0, np.nan]]), "entries row 1"),
        (lambda: client.frontier(hull, rates=[0, np.inf]), "rates row 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            ask()
    with pytest.raises(InvalidRequestError) as caught:
        client.phase_diagram(hull, [[0, 0], [1.5, 0]])
    assert (caught.value.field, caught.value.row, caught.value.value) == ("entries", 1, "(1.5, 0.0)")
    with pytest.raises(InvalidRequestError) as caught:
        client.frontier(hull, [[1, 1], [0, 2]])
    assert (caught.value.field, caught.value.row, caught.value.value) == ("points", 1, "(0.0, 2.0)")
