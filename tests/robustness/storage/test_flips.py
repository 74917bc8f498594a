"""A short run of flips.py."""

import flips
from cases import slow


@slow
def test_no_bit_loses_a_batch_in_silence(tmp_path):
    counts, faults = flips.run(tmp_path, count=20, seed=1, processes=1, every=400)
    assert faults == []
    assert min(counts[each] for each in (flips.HARMLESS, flips.REPAIRED, flips.REFUSED)) > 0
