"""Projections and given pairs on the kernel and in the reference: the same to the last bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynhull import _kernel
from dynhull._given import Given
from dynhull._globe import Gnomonic

longitudes = st.one_of(st.sampled_from([-360.0, -180.0, 0.0, 5e-324, 45.0, 90.0, 180.0, 360.0]), st.floats(-360, 360))
latitudes = st.one_of(st.sampled_from([-90.0, 0.0, 45.0, 90.0, 1e-300]), st.floats(-90, 90))


def assert_same_projection(center, places):
    frame = Gnomonic(center)
    expected, expected_near = frame._project(places)
    found, near = _kernel.gnomonic(places, *center, frame._sin, frame._cos)
    assert near.tolist() == expected_near.tolist()
    assert found[near].tobytes() == expected[near].tobytes()
    assert np.isnan(found[~near]).all()


@given(st.tuples(longitudes, latitudes), st.lists(st.tuples(longitudes, latitudes), min_size=1, max_size=30))
def test_projections(center, places):
    assert_same_projection(center, np.array(places) + 0.0)


def test_many_projections():
    rng = np.random.default_rng(0)
    for _ in range(20):
        places = np.column_stack([rng.uniform(-360, 360, 10_000), rng.uniform(-90, 90, 10_000)])
        assert_same_projection((float(rng.uniform(-180, 180)), float(rng.uniform(-90, 90))), places)


def outcome(function, *arguments):
    try:
        kept, renamed = function(*arguments)
    except KeyError as error:
        return error.args
    return kept.tolist(), {tuple(place) for place in renamed.tolist()}


# Pairs 0 to 2 share a place, and so do 3 and 4.
NUMBERS = [(1.0, 2.0), (0.0, 2.0), (3.0, -1.0), (7.0, 7.0), (6.0, 9.0), (5.0, 5.0)]
PLACES = [(0.5, 0.5)] * 3 + [(0.25, 1.0)] * 2 + [(2.0, 2.0)]
batches = st.lists(
    st.tuples(st.lists(st.tuples(st.sampled_from([1, -1]), st.integers(0, 5)), max_size=12), st.booleans()), max_size=12
)


@settings(max_examples=300)
@given(batches)
def test_given_pairs_live_the_same_lives(lives):
    reference, kernel = Given(), _kernel.Given()
    pairs, places = np.array(NUMBERS), np.array(PLACES)
    for rows, ignore_missing in lives:
        which = np.array([row for _, row in rows], dtype=int)
        arguments = np.array([op for op, _ in rows], np.int8), pairs[which], places[which], ignore_missing
        assert outcome(kernel.apply, *arguments) == outcome(reference.apply, *arguments)
        assert kernel.distinct == reference.distinct
        assert kernel.counts(pairs, places).tolist() == reference.counts(pairs, places).tolist()
        assert kernel.counts(pairs[::-1].copy(), places).tolist() == reference.counts(pairs[::-1], places).tolist()
        assert kernel.points().tolist() == reference.points().tolist()
        there = places[reference.counts(pairs, places) > 0]
        assert kernel.at(there).tolist() == reference.at(there).tolist()
        kernel = kernel.copy()
    kernel.clear()
    assert (kernel.distinct, kernel.points().tolist()) == (0, [])


def test_many_given_pairs():
    rng = np.random.default_rng(1)
    reference, kernel = Given(), _kernel.Given()
    pairs = np.column_stack([rng.integers(0, 300, 5000), rng.integers(0, 9, 5000)]).astype(float)
    places = np.floor(pairs / 2)
    for start in range(0, 5000, 250):
        rows = rng.integers(0, start + 250, 500)
        ops = np.where(rng.random(500) < 0.55, 1, -1).astype(np.int8)
        arguments = ops, pairs[rows], places[rows], True
        assert outcome(kernel.apply, *arguments) == outcome(reference.apply, *arguments)
        assert kernel.points().tobytes() == reference.points().tobytes()
    assert kernel.memory > 0
    with pytest.raises(KeyError):
        kernel.at(np.array([[0.5, 0.5]]))
    with pytest.raises(ValueError, match="must have the same length"):
        kernel.apply(np.ones(2, np.int8), pairs[:3], places[:3], True)
