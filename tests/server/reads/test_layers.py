"""Convex layers, influence and sketches from a server, compared with the library's own."""

from contextlib import suppress
from uuid import uuid4

import numpy as np
import pytest

from dynhull import DynamicHull, GeoHull, KeyedHull
from dynhull_client import (
    DeadlineError,
    HullClient,
    HullCopy,
    InvalidRequestError,
    LimitExceededError,
    Sketch,
    Snapshot,
)

K = 4


@pytest.fixture
def points(rng: np.random.Generator) -> np.ndarray:
    return rng.integers(-40, 40, (300, 2)).astype(float)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def new_name() -> str:
    return f"layers/{uuid4().hex}"


def hull_of(client: HullClient, points: np.ndarray) -> str:
    name = new_name()
    client.create_hull(name)
    client.apply(name, insert=points)
    return name


def test_layers_and_influence_are_those_of_the_library(client: HullClient, points: np.ndarray) -> None:
    name, live = hull_of(client, points), DynamicHull(points)
    found = client.layers(name, 1000)
    assert found.revision == 1
    assert found.keys is None
    expected = live.layers(1000)
    assert len(found.layers) == len(expected) > K
    for layer, mine in zip(found.layers, expected, strict=True):
        np.testing.assert_array_equal(layer, mine)
    influence = client.influence(name)
    np.testing.assert_array_equal(influence.vertices, live.vertices())
    np.testing.assert_array_equal(influence.areas, live.influence())


def test_every_read_can_be_about_a_layer(client: HullClient, points: np.ndarray) -> None:
    name = hull_of(client, points)
    layer = DynamicHull(DynamicHull(points).layers(K)[-1])
    asked, far = points[:50], [[90.0, 91.0], [-90.0, 13.0]]
    np.testing.assert_array_equal(client.get_hull(name, layer=K).vertices, layer.vertices())
    np.testing.assert_array_equal(client.locate(name, asked, layer=K).sides, layer.locate(asked))
    np.testing.assert_array_equal(client.distance(name, asked, layer=K).distances, layer.distance(asked))
    np.testing.assert_array_equal(client.support(name, far, layer=K).vertices, layer.support(far))
    np.testing.assert_array_equal(client.tangents(name, far, layer=K).tangents, layer.tangents(far))
    crossings = client.intersect_lines(name, far, -np.array(far), layer=K).crossings
    np.testing.assert_array_equal(crossings, layer.intersect_lines(far, -np.array(far)))
    assert client.get_measures(name, layer=K).area == layer.area
    with client.pipeline() as pipeline:
        answers = [pipeline.locate(name, [place], layer=each) for place in asked for each in (1, K)]
    sides = np.array([answer.result().sides[0] for answer in answers]).reshape(-1, 2)
    np.testing.assert_array_equal(sides.T, [DynamicHull(points).locate(asked), layer.locate(asked)])


def test_a_layer_for_which_no_points_are_left_is_empty(client: HullClient) -> None:
    name = hull_of(client, [[0, 0], [1, 0], [0, 1]])
    assert len(client.layers(name, 5).layers) == 1
    assert client.get_hull(name, layer=2).vertices.shape == (0, 2)
    assert client.locate(name, [[0, 0]], layer=2).sides.tolist() == [-1]
    empty = new_name()
    client.create_hull(empty)
    assert client.layers(empty, 5).layers == ()
    assert client.influence(empty).areas.tolist() == []


def test_keys_of_layers_and_of_the_most_influential_vertices(client: HullClient, points: np.ndarray) -> None:
    name, live = new_name(), KeyedHull()
    keys = [f"k{i}" for i in range(len(points))]
    client.create_hull(name, keyed="str")
    client.put(name, keys, points)
    live.put_many(keys, points)
    found = client.layers(name, K, keys=True)
    assert found.keys is not None
    for layer, named in zip(found.layers, found.keys, strict=True):
        assert list(named) == live.keys_at(layer)
    influence = client.influence(name, keys=True)
    assert list(influence.keys or ()) == live.vertex_keys()
    hull = client.get_hull(name, layer=2)
    assert hull.vertex_keys == found.keys[1]
    outside = client.locate(name, keys=keys, layer=2).sides
    np.testing.assert_array_equal(outside, DynamicHull(found.layers[1]).locate(live.positions(keys)))
    named = client.support(name, [[1, 0]], keys=True, layer=2)
    assert named.keys == tuple(live.keys_at(named.vertices))
    integers = new_name()
    client.create_hull(integers, keyed="int")
    client.put(integers, [7, 8, 9], [[0, 0], [4, 0], [0, 4]])
    assert client.influence(integers, keys=True).keys == (7, 8, 9)


def test_large_layers_are_read_from_a_copy(client: HullClient) -> None:
    angles = np.linspace(0, 2 * np.pi, 20_000)
    points = np.concatenate([radius * np.column_stack((np.cos(angles), np.sin(angles))) for radius in (1.0, 2.0)])
    name, live = hull_of(client, points), DynamicHull(points)
    for layer, mine in zip(client.layers(name, 2).layers, live.layers(2), strict=True):
        np.testing.assert_array_equal(layer, mine)
    np.testing.assert_array_equal(client.influence(name).areas, live.influence())


def test_callers_who_leave_do_not_use_up_the_copies(client: HullClient) -> None:
    x = np.arange(-3_000.0, 3_000.0)
    parabola = np.column_stack((x, x * x))
    name = hull_of(client, parabola)
    for timeout in (0.001, 0.002, 0.004, 0.008, 0.016, 0.032):
        with suppress(DeadlineError):
            client.influence(name, timeout=timeout)
    np.testing.assert_array_equal(client.influence(name).areas, DynamicHull(parabola).influence())


def test_on_the_globe(client: HullClient, rng: np.random.Generator) -> None:
    lonlat = rng.uniform((5, 40), (15, 50), (200, 2))
    name, live = new_name(), GeoHull(lonlat, (10, 45))
    client.create_hull(name, geographic=True, center=(10, 45))
    client.apply(name, insert=lonlat)
    for layer, mine in zip(client.layers(name, K).layers, live.layers(K), strict=True):
        np.testing.assert_array_equal(layer, mine)
    np.testing.assert_array_equal(client.influence(name).areas, live.influence())
    inside = client.locate(name, lonlat, layer=2).sides >= 0
    np.testing.assert_array_equal(inside, live.depth(lonlat, 2) == 2)
    for layer, mine in ((1, live), (2, GeoHull(live.layers(2)[1], (10, 45)))):
        with client.watch(name, max_vertices=8, layer=layer, measures=True) as events:
            few, (vertices, error) = next(events), mine.sketch(8)
        assert isinstance(few, Sketch)
        np.testing.assert_array_equal(few.vertices, vertices)
        assert (few.error, few.measures and few.measures.area) == (error, mine.area)


def test_a_watch_follows_a_layer_although_the_hull_stays(client: HullClient) -> None:
    name = hull_of(client, [[0, 0], [10, 0], [10, 10], [0, 10], [4, 4], [6, 4], [5, 6]])
    copy = HullCopy()
    with client.watch(name, layer=2, copy=copy, outline=True, timeout=60) as events:
        assert isinstance(next(events), Snapshot)
        assert copy.vertices.tolist() == [[4, 4], [6, 4], [5, 6]]
        client.apply(name, insert=[[5, 5]])  # in the third layer: no event
        client.apply(name, insert=[[9, 5]])
        assert next(events).revision == 3
        assert copy.vertices.tolist() == [[4, 4], [6, 4], [9, 5], [5, 6]]
        assert copy.area == DynamicHull(copy.vertices).area
        client.apply(name, delete=[[0, 0], [10, 0], [10, 10], [0, 10]])
        next(events)
        assert copy.vertices.tolist() == [[5, 5]]


def test_a_watch_of_few_vertices_says_how_far_the_hull_reaches_beyond(client: HullClient) -> None:
    angles = np.linspace(0, 2 * np.pi, 500)
    circle = np.column_stack((np.cos(angles), np.sin(angles)))
    name, live = hull_of(client, circle), DynamicHull(circle)
    for most in (2, 12, 100):
        with client.watch(name, max_vertices=most, measures=True, timeout=60) as events:
            event = next(events)
            assert isinstance(event, Sketch)
            vertices, error = live.sketch(most)
            np.testing.assert_array_equal(event.vertices, vertices)
            assert event.error == error
            assert event.measures is not None
            assert event.measures.area == live.area
    with client.watch(name, max_vertices=12, layer=2, outline=True, timeout=60) as events:
        assert next(events).vertices.tolist() == []
        client.apply(name, insert=[[0.0, 0.5], [0.5, 0.0]])
        assert next(events).vertices.tolist() == [[0.0, 0.5], [0.5, 0.0]]


def test_a_watch_of_few_vertices_names_them(client: HullClient) -> None:
    name = new_name()
    client.create_hull(name, keyed="str")
    client.put(name, ["a", "b", "c", "d", "e"], [[0, 0], [9, 1], [8, 9], [4, 10], [5, 5]])
    with client.watch(name, max_vertices=4, keys=True, timeout=60) as events:
        event = next(events)
        assert isinstance(event, Sketch)
        assert event.keys == tuple(client.get_hull(name).vertex_keys or ())
        client.put(name, ["0"], [[0, 0]])
        assert "0" in (next(events).keys or ())


@pytest.mark.parametrize(
    ("ask", "field"),
    [
        (lambda client, name: client.layers(name, 0), "layer_count"),
        (lambda client, name: client.layers(name, 1001), "layer_count"),
        (lambda client, name: client.locate(name, [[0, 0]], layer=1001), "layer"),
        (lambda client, name: next(client.watch(name, max_vertices=1001)), "max_vertices"),
        (lambda client, name: next(client.watch(name, layer=2, directions=[[1, 0]])), "layer"),
    ],
)
def test_refusals_name_the_field(client: HullClient, points: np.ndarray, ask, field: str) -> None:
    with pytest.raises(InvalidRequestError) as refused:
        ask(client, hull_of(client, points))
    assert refused.value.field == field


def test_the_influence_of_too_many_vertices_is_refused(client: HullClient) -> None:
    x = np.arange(-50_001.0, 50_001.0)
    name = hull_of(client, np.column_stack((x, x * x)))
    with pytest.raises(LimitExceededError, match="max_influence_vertices"):
        client.influence(name)
