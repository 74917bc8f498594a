"""Answers of the library as values: they compare, hash and print by their content."""

import numpy as np
import pytest

from dynhull.convex import box
from dynhull.defects import convexity_defects
from dynhull.envelope import Frontier, PhaseDiagram
from dynhull.gjk import contact
from dynhull.margin import max_margin

ANSWERS = {
    "Contact": lambda: contact(box([0, 0], [1, 1]), box([3, 1], [4, 2])),
    "Margin": lambda: max_margin([[0, 0], [1, 0]], [[3, 0], [4, 4]]),
    "Defects": lambda: convexity_defects([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]]),
    "Tangencies": lambda: Frontier([[1, 2], [2, 5], [4, 6]]).tangencies(),
    "Decomposition": lambda: PhaseDiagram([[0.25, 0], [1, 0]]).decompose([0.5, 0.1]),  # NaN in the second row
}


@pytest.mark.parametrize("name", ANSWERS)
def test_equal_answers_are_one_value(name: str) -> None:
    first, second = ANSWERS[name](), ANSWERS[name]()
    assert first == second
    assert len({first, second}) == 1
    assert all(first != ANSWERS[other]() for other in ANSWERS if other != name)
    assert repr(first).startswith(f"{name}(")
    assert "\n" not in repr(first)


def test_different_answers_differ() -> None:
    first, second = (max_margin([[0, 0]], [[x, 0]]) for x in (3, 4))
    assert first != second
    with pytest.raises(ValueError, match="read-only"):
        first.points[0] = np.nan
