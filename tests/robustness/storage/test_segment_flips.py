"""A short run of segment_flips.py."""

import segment_flips
from cases import slow


@slow
def test_no_bit_of_a_segment_makes_another_past(tmp_path):
    past = segment_flips.Past(tmp_path, segment_flips.KINDS[:1])
    done = segment_flips.flips(past, count=60, seed=1) + segment_flips.other_damage(past)
    past.close()
    assert past.faults == []
    assert done["flipped"] == 60
    assert min(done[each] for each in ("cut", "exchanged", "taken away")) >= len(past.files)
