"""Events of fences as the payload of a row: all that they have comes back, bit by bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynhull_server.state.fences.events.block import block_of
from dynhull_server.state.fences.model.records import Cause, EventType, FenceEvent
from dynhull_server.state.records import NO_TIME
from dynhull_server.storage.rows.event_blocks import decode_block, decode_runs, encode_block

OWN = "fleet"
TIME = 1_700_000_000_000_000
decimals = st.integers(-1_800_000_000, 1_800_000_000).map(lambda number: number / 1e7)
doubles = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from([-0.0, 5e-324, 1e308, 2.0**53 / 1e7])
times = st.sampled_from([NO_TIME, TIME, TIME - 1])


@st.composite
def events(draw, coordinates, sequence):
    kind = draw(st.sampled_from([EventType.ENTER, EventType.EXIT, EventType.DWELL, EventType.BEGIN]))
    keyed = kind is not EventType.BEGIN
    here = draw(st.none() | st.tuples(coordinates, coordinates)) if keyed else None
    before = draw(st.none() | st.tuples(coordinates, coordinates)) if keyed else None
    far = draw(st.sampled_from([0.0, 0.25, float("inf")]))
    return FenceEvent(
        sequence,
        kind,
        draw(st.integers(0, 255)),
        draw(st.sampled_from([OWN, "other"])),
        draw(st.text("aé", min_size=1) | st.integers(0, 2**64 - 1)) if keyed else None,
        draw(st.integers(1, 2**40)),
        draw(st.sampled_from([0, 0, 7])),
        here,
        before,
        far if here is not None or not keyed else None,
        draw(times),
        TIME + sequence,
        draw(times),
    )


@st.composite
def many(draw):
    coordinates = draw(st.sampled_from([decimals, doubles]))
    sizes = draw(st.dictionaries(st.integers(1, 2**40), st.integers(1, 3), min_size=1, max_size=4))
    return {
        number: [draw(events(coordinates, sequence)) for sequence in range(number, number + size)]
        for number, size in sizes.items()
    }


def encoded(made):
    block = block_of(made)
    return encode_block(block, np.array([name == OWN for name in block.names])[block.runs["hull"]])


@given(many())
def test_what_is_written_is_read(made):
    payload = encoded(made)
    found = decode_block(payload, lambda _: OWN)
    assert repr(found.by_fence()) == repr(made)  # also the sign of zero
    runs = decode_runs(payload)
    assert (runs.fences.tolist(), runs.counts.tolist()) == (found.fences.tolist(), found.counts.tolist())


@given(many(), st.data())
def test_a_payload_that_is_cut_off_is_no_events(made, data):
    payload = encoded(made)
    first, *others = [event for each in made.values() for event in each]
    # The key of an event alone is what is left of the payload.
    left = len(first.key.encode()) if not others and isinstance(first.key, str) else 0
    with pytest.raises(ValueError, match=r"\w"):
        decode_block(payload[: data.draw(st.integers(0, len(payload) - 1 - left))], lambda _: OWN)


@pytest.mark.parametrize(
    ("places", "count", "most"), [(7, 1, 51), (7, 8, 42), (7, 800, 36), (None, 1, 64), (None, 8, 55), (None, 800, 51)]
)
def test_an_event_takes_few_bytes(places, count, most):
    """The mean, with keys of 16 bytes; exits have a distance."""
    rng = np.random.default_rng(count)
    size = events = 0
    while events < 400:
        here = rng.uniform(-180, 180, (count, 2))
        before = here + rng.normal(0, 4e-4, (count, 2))
        if places is not None:
            here, before = here.round(places), before.round(places)
        made = {}
        for row, number in enumerate(rng.choice(23_000, count, replace=False).tolist()):
            kind, distance = (EventType.ENTER, 0.0) if (events + row) % 2 else (EventType.EXIT, 1e-4 * row + 1e-5)
            both = tuple(here[row].tolist()), tuple(before[row].tolist())
            key = f"{row:016}"
            made[number] = [FenceEvent(70, kind, Cause.MOVED, OWN, key, 9000, 0, *both, distance, NO_TIME, TIME)]
        size += len(encoded(made))
        events += count
    assert size <= most * events
