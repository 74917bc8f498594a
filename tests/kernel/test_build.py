"""The compiler keeps to the predicates' arithmetic."""

import platform
import re
import subprocess
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from dynhull import _kernel

ROOT = Path(__file__).parents[2]


@given(st.floats(0.5, 1), st.floats(0.5, 1))
def test_no_operation_is_fused(x, y):
    """The filter must see the same two rounded products, whichever side they are on.

    With a multiply-add fused, x * y - y * x is the rounding error of one product; with fast-math the bounds are gone.
    """
    assert _kernel.plain_difference_of_products(x, y, y, x) == 0.0


def test_infinities_and_nans_are_respected():
    """A filter that overflows must detect that it cannot decide; -ffast-math would remove that."""
    big = 1.7e308
    assert _kernel.orientation((-big, -big), (big, big), (big, -big)) == -1
    assert _kernel.orientation((-big, -big), (0.0, 0.0), (big, big)) == 0
    assert _kernel.plain_difference_of_products(big, big, big, big) != _kernel.plain_difference_of_products(
        big, big, big, big
    )


def test_the_build_forbids_fusing(compiler, tmp_path):
    """With the flags of CMakeLists.txt, even where the processor can fuse; without -ffp-contract=off it does fuse."""
    options = re.search(r"target_compile_options\(_kernel PRIVATE (-.*)\)", (ROOT / "CMakeLists.txt").read_text())
    flags = options.group(1).split()
    source = tmp_path / "filter.cpp"
    source.write_text(
        f'#include "{ROOT}/dynhull/kernel/predicates/signs.hpp"\n'
        "int filter(dynhull::Point a, dynhull::Point b, dynhull::Point c) { return orientation_filter(a, b, c); }"
    )
    able = ["-mfma"] if platform.machine() in ("x86_64", "AMD64") else []

    def fused(flags):
        command = [compiler, "-std=c++20", *flags, *able, "-S", str(source), "-o", "-"]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return bool(re.search(r"\bv?fn?m(add|sub|la|ls)", text))

    assert not fused(flags)
    assert fused([flag if not flag.startswith("-ffp-contract") else "-ffp-contract=fast" for flag in flags])
