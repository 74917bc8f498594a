"""Everything that is stored, as bytes and back: each combination of what is optional."""

import numpy as np
import pytest
from cases import one_of
from folders import same
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from dynhull.keys import PackedKeys
from dynhull_server.state.contents.joining import in_one
from dynhull_server.state.records import (
    FOREVER,
    NO_TIME,
    Contents,
    Expiry,
    HeldChange,
    HeldRows,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    PointRows,
    QuarantineRules,
    Record,
    Window,
)
from dynhull_server.storage.rows import chunks, hull_rows
from dynhull_server.storage.rows.encoding import CAUSES, decode, encode

times = st.integers(-(2**53), 2**53) | st.sampled_from([NO_TIME, FOREVER])
counts = st.integers(0, 5)
words = st.text(st.characters(codec="utf-8"), min_size=1).map(lambda text: text.encode()[:255].decode(errors="ignore"))
long_words = st.sampled_from(["a" * 255, "\U0001f600" * 63, "é" * 127])
strings = words.filter(bool) | long_words
integers = st.integers(0, 2**64 - 1) | st.sampled_from([0, 2**63, 2**64 - 1])


@st.composite
def of_rows(draw, values, rows, kind):
    return np.array(draw(st.lists(values, min_size=rows, max_size=rows)), kind)


def points(rows):
    finite = st.floats(allow_nan=False, allow_infinity=False)
    return arrays.arrays(np.float64, (rows, 2), elements=finite)


def keys(kind, rows):
    if kind == "int":
        return of_rows(integers, rows, np.uint64)
    return st.lists(strings, min_size=rows, max_size=rows).map(PackedKeys.pack)


def optional_times(rows):
    return st.none() | of_rows(times, rows, np.int64)


def accuracies(rows):
    return of_rows(st.floats(0, allow_infinity=False), rows, np.float64)


@st.composite
def point_rows(draw):
    inserts, deletes = draw(counts), draw(counts)
    return PointRows(draw(points(inserts)), draw(points(deletes)), draw(st.booleans()), draw(optional_times(inserts)))


@st.composite
def held_rows(draw, kind, rows):
    measures = of_rows(st.floats(0) | st.just(np.nan), rows, np.float64)
    numbers = of_rows(st.integers(0, 2**62), rows, np.int64)
    whens = of_rows(times, rows, np.int64)
    columns = keys(kind, rows), points(rows), whens, whens, measures, measures, numbers, numbers, accuracies(rows)
    return HeldRows(*map(draw, columns))


limits = st.none() | st.floats(1, allow_infinity=False)
rules = st.builds(QuarantineRules, limits, limits, st.integers(0, 2**32 - 1))


@st.composite
def held_changes(draw, kind):
    return HeldChange(draw(held_rows(kind, draw(counts))), draw(keys(kind, draw(counts))), draw(st.none() | rules))


@st.composite
def key_rows(draw):
    kind, puts, removes = draw(st.sampled_from(["str", "int"])), draw(counts), draw(counts)
    condition = draw(st.sampled_from([None, "absent", "present"]))
    columns = keys(kind, puts), points(puts), keys(kind, removes), optional_times(puts), optional_times(puts)
    held, errors = draw(st.none() | held_changes(kind)), draw(st.none() | accuracies(puts))
    return KeyRows(*map(draw, columns), condition, held, errors)


centers = st.none() | st.tuples(st.floats(-180, 180, exclude_max=True), st.floats(-90, 90))
expiries = st.builds(Expiry, st.none() | times, st.integers(0, 2**32 - 1))


@st.composite
def records(draw):
    first = draw(st.integers(1, 2**40))
    rows = draw(st.lists(point_rows() | key_rows() | expiries, min_size=1, max_size=4))
    return [
        Record(
            first + i,
            each,
            draw(st.text(max_size=9)),
            draw(st.integers(0, 2**64 - 1)),
            draw(st.none() | times),
            draw(centers),
            draw(st.booleans()),
            cause=draw(st.sampled_from([None, *CAUSES])),
        )
        for i, each in enumerate(rows)
    ]


@st.composite
def contents(draw):
    rows, kind = draw(st.integers(0, 30)), draw(st.sampled_from([None, "str", "int"]))
    return Contents(
        draw(points(rows)),
        None if kind is None else draw(keys(kind, rows)),
        draw(optional_times(rows)),
        draw(optional_times(rows)),
        None if kind is None else draw(st.none() | held_rows(kind, draw(st.integers(1, 30)))),
        None if kind is None else draw(st.none() | accuracies(rows)),
    )


@one_of(2)
@given(records())
def test_records_come_back(given):
    same(list(decode(encode(given), given[0].revision)), given)


@given(records(), st.data())
def test_a_payload_that_is_cut_short_is_refused(given, data):
    payload = encode(given[:1])
    cut = data.draw(st.integers(1, len(payload) - 1))
    with pytest.raises(ValueError, match="is cut short at byte"):
        list(decode(payload[:cut], 1))


def test_batches_of_earlier_formats():
    """A header of 19 bytes, whose last one says whether the batch is lenient, a name and the points."""
    payload = bytes.fromhex("01000000 01000000 0700000000000000 0200 01") + b"p1" + np.arange(4.0).tobytes()
    rows = PointRows(np.array([[0.0, 1.0]]), np.array([[2.0, 3.0]]), lenient=True)
    same(list(decode(payload, 9)), [Record(9, rows, "p1", 7)])
    assert encode([Record(9, rows, "p1", 7)]) == payload


def test_keys_of_two_kinds_are_refused():
    rows = KeyRows(PackedKeys.pack(["a"]), np.zeros((1, 2)), np.array([1], np.uint64))
    with pytest.raises(TypeError, match="the keys to put and to remove are of different kinds"):
        encode([Record(1, rows)])


def test_errors_that_are_all_zero_are_none():
    rows = KeyRows(PackedKeys.pack(["a"]), np.zeros((1, 2)), PackedKeys.pack([]), accuracies=np.zeros(1))
    assert rows.accuracies is None
    rows.accuracies = np.zeros(1)  # as earlier versions wrote them
    (found,) = decode(encode([Record(1, rows)]), 1)
    assert found.rows.accuracies is None


@given(contents(), st.sampled_from([300, 1000, 2**19]))
def test_contents_come_back_from_chunks(given, size):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunks, "CHUNK_BYTES", size)
        cuts = chunks.cuts(given)
    parts = [chunks.chunk(given, cut) for cut in cuts]
    longest_row = 16 + 6 * 8 + 256  # in quarantine
    assert max(map(len, parts)) <= chunks.HEADER.size + size + longest_row
    *_, decoded = chunks.state_from(chunks.state(Kept()))
    same(in_one([decoded(part) for part in parts]), given)


@given(st.dictionaries(st.text(), st.integers(1, 2**64 - 1)) | st.just({"producers": 3, "clock": 4}), st.none() | times)
def test_the_state_of_a_snapshot_comes_back(producers, clock):
    for center in (None, (-180.0, 89.5)):
        rules = None if center is None else QuarantineRules(0.1, confirmations=0)
        skipping = frozenset(list(producers)[::2])
        before = Kept(producers=producers, clock=clock, center=center, skipping=skipping, rules=rules)
        kept, _ = chunks.state_from(chunks.state(before))
        assert (kept.producers, kept.clock, kept.center) == (producers, clock, center)
        assert (kept.skipping, kept.rules) == (skipping, rules)


def test_a_snapshot_without_producers_that_skip():
    """As before there were any."""
    kept, _ = chunks.state_from(b'{"producers": {"p": 3}, "clock": 4}')
    assert (kept.producers, kept.clock, kept.skipping) == ({"p": 3}, 4, frozenset())


@pytest.mark.parametrize("state", [b"", b"{}", b'{"producers": 3, "clock": 4}'])
def test_snapshots_of_earlier_formats(state):
    """Their chunks are points alone, and their state the last number of each producer."""
    kept, decoded = chunks.state_from(state)
    assert kept.producers == ({"producers": 3, "clock": 4} if len(state) > 2 else {})
    assert (kept.clock, kept.center) == (None, None)
    points = np.arange(6.0).reshape(-1, 2)
    same(in_one([decoded(points.tobytes()), decoded(b"")]), Contents(points))
    same(in_one([]), Contents())


windows = st.builds(
    Window,
    st.integers(0, 2**53),
    st.integers(0, 2**32),
    st.sampled_from(["server", "data"]),
    st.none() | st.integers(0, 2**53),
    st.booleans(),
)
settings = st.builds(
    HullSettings,
    st.sampled_from(["multiset", "str", "int"]),
    st.integers(0, 2**64 - 1),
    st.none() | windows,
    st.booleans(),
    st.sampled_from(["plane", "geographic"]),
    centers,
    st.none() | rules,
)


@given(settings)
def test_settings_come_back(given):
    assert hull_rows.settings_from(hull_rows.settings_text(given)) == given


def test_settings_are_stored_without_defaults():
    """So that a later version can add some, and the checksums of earlier rows stay."""
    *_, text, _ = hull_rows.values(HullRow(1, "a", "b", 2.0))
    assert text == "{}"
    assert (
        hull_rows.settings_text(HullSettings("str", window=Window(5)))
        == '{"identity": "str", "window": {"max_age": 5}}'
    )
