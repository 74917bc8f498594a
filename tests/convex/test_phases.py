"""Phase diagrams: against what pymatgen said of the formation energies that it ships, and against definitions."""

import json
from fractions import Fraction
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynhull.envelope import PhaseDiagram, energy_above_hull_nd

SYSTEMS = json.loads((Path(__file__).parents[1] / "data" / "phases.json").read_text())["systems"]
BINARY = [system for system in SYSTEMS if len(system["elements"]) == 2]

entry = st.tuples(st.integers(0, 8).map(lambda i: i / 8), st.integers(-8, 8).map(float))
entries = st.lists(entry, min_size=1, max_size=10)


def name(system):
    return "-".join(system["elements"])


@pytest.mark.parametrize("system", BINARY, ids=name)
def test_agrees_with_pymatgen(system):
    rows = [(e["shares"][1], e["energy"]) for e in system["entries"]]
    diagram = PhaseDiagram(rows)
    above = diagram.energy_above_hull(rows)
    assert above == pytest.approx([e["above"] for e in system["entries"]], abs=1e-9)
    # Pymatgen names one of several entries at the same place; a made-up one above its element is none of them.
    stable = {row for row, e in zip(rows, system["entries"], strict=True) if e["stable"]}
    assert {tuple(row) for row in diagram.stable().tolist()} == stable


@pytest.mark.parametrize("system", SYSTEMS, ids=name)
def test_three_elements_and_two_agree_with_pymatgen(system):
    shares, energies = [e["shares"] for e in system["entries"]], [e["energy"] for e in system["entries"]]
    expected = [e["above"] for e in system["entries"]]
    assert energy_above_hull_nd(shares, energies) == pytest.approx(expected, abs=1e-9)


def floor(rows, x):
    """The least energy of a mixture of two entries at a composition, by definition."""
    found = [Fraction(e) for c, e in rows if c == x]
    for (c, e), (d, f) in combinations(rows, 2):
        if min(c, d) < x < max(c, d):
            share = (Fraction(x) - Fraction(c)) / (Fraction(d) - Fraction(c))
            found.append((1 - share) * Fraction(e) + share * Fraction(f))
    return min(found, default=None)


@given(entries, entries)
def test_energy_above_hull_by_definition(rows, others):
    for (x, energy), above in zip(others, PhaseDiagram(rows).energy_above_hull(others), strict=True):
        lowest = floor(rows, x)
        assert np.isnan(above) if lowest is None else above == float(Fraction(energy) - lowest)


@given(entries)
def test_decomposition_makes_the_composition_at_the_energy_of_the_hull(rows):
    diagram = PhaseDiagram(rows)
    stable = {tuple(row) for row in diagram.stable().tolist()}
    compositions = [c for c, _ in rows]
    found = diagram.decompose(compositions)
    for x, phases, shares in zip(compositions, found.phases.tolist(), found.shares.tolist(), strict=True):
        assert {tuple(phase) for phase in phases} <= stable
        assert sum(share * phase[0] for share, phase in zip(shares, phases, strict=True)) == pytest.approx(x)
        energy = sum(share * phase[1] for share, phase in zip(shares, phases, strict=True))
        assert energy == pytest.approx(float(floor(rows, x)))
        assert min(shares) >= 0
        assert sum(shares) == pytest.approx(1)


@given(entries, entry)
def test_what_an_entry_makes_unstable_is_stable_again_without_it(rows, new):
    diagram = PhaseDiagram(rows)
    before = {tuple(row) for row in diagram.stable().tolist()}
    lost = {tuple(row) for row in diagram.add(*new).tolist()}
    assert lost == before - {tuple(row) for row in diagram.stable().tolist()}
    assert {tuple(row) for row in diagram.remove(*new).tolist()} == lost
    assert {tuple(row) for row in diagram.stable().tolist()} == before
    assert len(diagram) == len(rows)
    assert diagram.entries().tolist() == sorted([list(row) for row in rows])


def test_a_diagram_without_entries():
    diagram = PhaseDiagram()
    assert (len(diagram), diagram.stable().shape) == (0, (0, 2))
    assert np.isnan(diagram.energy_above_hull([[0.5, 1]])).all()
    assert np.isnan(diagram.decompose([0.5]).shares).all()
    assert diagram.add_many([[0, 1], [0, 0]]).shape == (0, 2)
    assert diagram.stable().tolist() == [[0, 0]]


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda d: d.add(1.5, 0), "entries row 0 has composition 1.5"),
        (lambda d: d.add(0.5, np.nan), "entries row 0"),
        (lambda d: d.add_many([[0, 0], [np.inf, 0]]), "entries row 1"),
        (lambda d: d.decompose([0.5, -1]), "compositions row 1 has composition -1"),
        (lambda d: d.decompose(0.5), r"compositions must have shape \(k,\)"),
        (lambda _: energy_above_hull_nd([[0.5, 0.6]], [1]), "not shares that make up 1"),
        (lambda _: energy_above_hull_nd([[1, 0], [0.5, 0.5]], [1, 1]), "element 1 has no entry"),
        (lambda _: energy_above_hull_nd([[1, 0], [0, 1]], [1]), r"energies must have shape \(2,\)"),
        (lambda _: energy_above_hull_nd([[1, 0], [0, 1]], [1, np.inf]), "entries row 1"),
    ],
)
def test_bad_input(ask, message):
    diagram = PhaseDiagram([[0, 0], [1, 0]])
    with pytest.raises(ValueError, match=message):
        ask(diagram)
    assert len(diagram) == 2


def test_an_entry_that_is_not_there():
    with pytest.raises(KeyError, match="is missing and cannot be deleted"):
        PhaseDiagram([[0, 0]]).remove(0, 1)
