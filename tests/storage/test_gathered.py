"""Many batches of the past as one lead to the very state that they lead to one after the other."""

import dataclasses
import struct
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from cases import one_of
from folders import same
from hypothesis import given
from hypothesis import strategies as st

from dynhull.keys import PackedKeys
from dynhull_server.compiled import native
from dynhull_server.state.batch import Batch, KeyedBatch, Write
from dynhull_server.state.contents import begun
from dynhull_server.state.errors import MisfitError, RefusedError
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import (
    CommitStamp,
    HullRow,
    HullSettings,
    Kept,
    KeyRows,
    QuarantineRules,
    Record,
    Window,
)
from dynhull_server.state.root_state import state_of
from dynhull_server.storage.of_keys import changes_of_keys
from dynhull_server.storage.port import DamagedError
from dynhull_server.storage.rows import batch_columns, past_rows
from dynhull_server.storage.rows.batch_columns import columns_of_rows
from dynhull_server.storage.rows.encoding import STRINGS, encode
from dynhull_server.storage.rows.past_rows import gathered_after
from dynhull_server.storage.segments import by_key, parquet
from dynhull_server.storage.segments import gathered as gathering
from dynhull_server.storage.segments.columns import Batches, columns_of, joined
from dynhull_server.storage.segments.gathered import gathered, key_codes
from dynhull_server.storage.segments.parquet import (
    columns_of_keys,
    from_parquet,
    keys_from_parquet,
    rows_from_parquet,
    to_parquet,
)

LIMITS = Limits(10, 1000, 10, 10, 10**6)
SECOND = 10**6
BEGIN = 10**9 * SECOND
KINDS = {
    "keyed": HullSettings("str"),
    "numbered": HullSettings("int"),
    "multiset": HullSettings(),
    "globe": HullSettings(frame="geographic"),
    "globe-keyed": HullSettings("str", frame="geographic"),
    "event-times": HullSettings("str", by_event_time=True),
    "recent": HullSettings(window=Window(max_age=4 * SECOND)),
    "newest": HullSettings(window=Window(max_points=5)),
    "recent-keyed": HullSettings("int", window=Window(max_age=4 * SECOND)),
    "newest-keyed": HullSettings("str", window=Window(max_points=5)),
    "recent-by-data": HullSettings("str", window=Window(max_age=4 * SECOND, clock="data"), by_event_time=True),
    "quarantine": HullSettings("str", quarantine=QuarantineRules(max_growth=1.5)),
}
STEPS = st.lists(
    st.tuples(
        st.sampled_from(
            ["put", "put", "put", "put", "remove", "both", "dated", "ttl", "absent", "recenter", "nothing"]
        ),
        st.integers(0, 255),  # which of eight keys or points
        st.integers(0, 7),  # where to
        st.integers(0, 9),  # the tenths of a second until then
    ),
    min_size=8,
    max_size=30,
)


def batch(settings, what, which, where, time):
    """A batch of a hull of that kind; None if it has none of these."""
    rows = np.flatnonzero([which >> bit & 1 for bit in range(8)])
    points = np.random.default_rng(where).integers(-4, 5, (8, 2))[rows] * 0.1
    none = points[:0]
    windowed = settings.window is not None
    if settings.identity == "multiset":
        puts, takes = (
            (points, none)
            if what not in ("remove", "both")
            else (none, points)
            if what == "remove"
            else (points, points[:1])
        )
        dated = np.full(len(puts), time - where * SECOND // 8) if windowed and what == "dated" else None
        return Batch(puts, takes, 0, count_missing=what != "both" or which % 2 == 0, times=dated)
    kind = settings.identity
    keys = [f"key {row}" for row in rows] if kind == "str" else rows.tolist()
    pack = PackedKeys.pack if kind == "str" else lambda keys: np.array(keys, np.uint64)
    dated = np.full(len(keys), time - where * SECOND // 8) if what == "dated" or settings.by_event_time else None
    if what == "remove":
        return KeyedBatch(kind, pack([]), none, pack(keys))
    if what == "both":
        last = len(keys) - 1
        return KeyedBatch(
            kind, pack(keys[:last]), points[:last], pack(keys[last:]), None if dated is None else dated[:last]
        )
    given = {"ttl": (1 + where) * SECOND} if what == "ttl" else {"condition": "absent"} if what == "absent" else {}
    return KeyedBatch(kind, pack(keys), points, pack([]), dated, **given)


def lived(settings, steps):
    """The records of a hull to which these steps have happened."""
    state, records, time = HullState(LIMITS, settings, Kept(), 0.0), [], BEGIN
    for what, which, where, wait in steps:
        time += wait * SECOND // 10
        try:
            if state.next_due is not None and state.next_due <= time:
                state.expire(time, records)
            if what == "recenter":
                state.recenter(None, records)
            else:
                state.apply(Write("hull", batch(settings, what, which, where, time), time), 0.0, records)
        except (MisfitError, RefusedError):
            continue
    return [dataclasses.replace(each, committed=CommitStamp(each.revision, each.revision)) for each in records]


def seen(state):
    """What readers see of a state."""
    keys = state.vertex_keys().tolist() if state.entities() is not None else []
    return [state.counts, state.committed, state.vertices(), keys, state.kept()]


def built(hull, records, after, found):
    """A hull that is built once, of its state at a revision and of what follows it, as for who asks for the past."""
    kept = HullState(LIMITS, hull, Kept(records=records[:after]), 0.0).kept()
    contents = begun(kept, hull, LIMITS.points_of(hull))
    return state_of(LIMITS, hull, dataclasses.replace(kept, records=found), 0.0, contents)


def require_same(hull, records, after, batches):
    """Gathered from a revision on, batches lead to the state that they lead to one by one; returns what is applied."""
    found = list(gathered(batches, hull, after, len(records)))
    one, other = (HullState(LIMITS, hull, Kept(records=records[:after]), 0.0) for _ in range(2))
    for record in records[after:]:
        one.catch_up([record], 0.0)
    if found:
        other.catch_up(found, 0.0)
        same(seen(built(hull, records, after, found)), seen(one))
    same(seen(other), seen(one))
    return found


@pytest.mark.parametrize("kind", KINDS)
@given(steps=STEPS, after=st.integers(0, 10))
@one_of(6)
def test_gathered_batches_lead_to_the_same_state(kind, steps, after):
    hull = KINDS[kind]
    records = lived(hull, steps)
    if records:
        batches = Batches(from_parquet(to_parquet(columns_of(records, hull.identity), {}), "a file")[0])
        assert len(require_same(hull, records, min(after, len(records)), batches)) <= len(records)


@pytest.mark.parametrize("kind", KINDS)
@given(
    steps=STEPS,
    after=st.integers(0, 10),
    less=st.integers(0, 3),
    group_rows=st.sampled_from([1, 2, 3, 5, 2**14]),
    few=st.sampled_from([0, by_key.FEW, 2**20]),
)
@one_of(6)
def test_rows_by_key_lead_to_the_same_state(kind, steps, after, less, group_rows, few):
    """From any revision to any other one, wherever a group of rows ends, which may be amid those of a key."""
    hull = KINDS[kind]
    records = lived(hull, steps)
    if not records:
        return
    until = max(len(records) - less, 0)
    after = min(after, until)
    columns = columns_of(records, hull.identity)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parquet, "GROUP_ROWS", group_rows)
        patch.setattr(by_key, "FEW", few)
        rows, _, _ = rows_from_parquet(to_parquet(columns, {}), "a file")
        found = rows.last_places(hull, after, until)
        some = rows.batches_between(after, until)
    same(rows.batches().columns, columns)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parquet, "native", None)
        same(rows.columns(0, len(rows.starts) - 1), columns)
    same(some.columns.between(after, until), columns.between(after, until))
    if found is None:
        return
    one, other = (HullState(LIMITS, hull, Kept(records=records[:after]), 0.0) for _ in range(2))
    for each in records[after:until]:
        one.catch_up([each], 0.0)
    other.catch_up([found], 0.0)
    same(seen(other), seen(one))
    same(seen(built(hull, records, after, [found])), seen(one))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part_rows", [1, 7, 2**15])
def test_batches_that_follow_each_other_come_a_part_at_a_time_from_any_revision_on(kind, part_rows, monkeypatch):
    monkeypatch.setattr(by_key, "PART_ROWS", part_rows)
    monkeypatch.setattr(parquet, "GROUP_ROWS", 10)
    hull = KINDS[kind]
    records = lived(hull, [("both", 1 << place % 8 | 1, place % 7, 0) for place in range(40)])
    columns = columns_of(records, hull.identity)
    content, last = to_parquet(columns, {}), len(records)
    for first in (0, 1, last // 2, last - 1):
        rows, _, _ = rows_from_parquet(content, "a file")
        for _ in range(2):
            at, parts = first, 0
            while at < last:
                part = rows.next_batches(at)
                assert len(part.columns) <= max(part_rows, columns.revision.tolist().count(at + 1))
                end = int(part.columns.revision[-1])
                same(part.columns.between(at, end), columns.between(at, end))
                assert [each.revision for each in part.between(at, last)] == list(range(at + 1, end + 1))
                assert rows.next_batches(at) is part
                at, parts = end, parts + 1
            assert part_rows > len(columns) or parts > 1 or first == last - 1
    same(rows.batches().columns, columns)
    assert rows.next_batches(0) is rows.batches()


@pytest.mark.skipif(native is None, reason="C++ is not built")
def test_keys_with_some_numbers_are_the_same_in_both_languages():
    names = ["b", "c", "é", "a" * 255, "ab"]
    text, lengths = "".join(names).encode(), [len(each.encode()) for each in names]
    ends = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    for codes in ([4, 0, 3, 3, 1, 2], [], [2]):
        found = native.keys_at(ends, text, np.array(codes, np.int32))
        assert list(PackedKeys(*found)) == [names[each] for each in codes]
    for wrong in ([5], [-1], [0, 2**31 - 1]):
        with pytest.raises(ValueError, match="where they are said to"):
            native.keys_at(ends, text, np.array(wrong, np.int32))
    for other in (ends[::-1].copy(), ends + 1, ends - 1, ends[:0]):
        with pytest.raises(ValueError, match="where they are said to"):
            native.keys_at(other, text, np.arange(5, dtype=np.int32))


def test_the_last_places_of_a_thousand_moves_of_a_few_keys_need_no_records():
    """In groups of few rows, so that most keys are in several; and of a part of the revisions."""
    for kind in ("keyed", "numbered", "recent-keyed"):
        hull = KINDS[kind]
        records = lived(hull, [("put", 1 << place % 8, place % 7, 0) for place in range(100)])
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(parquet, "GROUP_ROWS", 10)
            rows, _, _ = rows_from_parquet(to_parquet(columns_of(records, hull.identity), {}), "a file")
        for after, until, keys in ((0, 100, 8), (0, 99, 8), (50, 57, 7), (93, 100, 7)):
            found = rows.last_places(hull, after, until)
            assert found is not None
            assert (found.revision, len(found.rows.keys), found.committed) == (
                until,
                keys,
                records[until - 1].committed,
            )
        assert rows.last_places(hull, 50, 56) is None  # so few are put in order


@pytest.mark.parametrize("which", [1, 7])
def test_a_file_that_lacks_a_row_is_damaged(which):
    """Of one row for each revision, and of three: of these not the last, which nothing but the digest tells."""
    columns = columns_of(lived(KINDS["keyed"], [("put", which, place, 0) for place in range(4)]), "str")
    for lacks in range(1, len(columns) - 1):
        if which == 1 or columns.place[lacks + 1] > 0:
            left = [columns.rows(0, lacks), columns.rows(lacks + 1, len(columns))]
            with pytest.raises(DamagedError, match="a row is missing"):
                from_parquet(to_parquet(joined(left, "str"), {}), "a file")


@given(kind=st.sampled_from(sorted(KINDS)), steps=STEPS, together=st.integers(1, 5))
def test_rows_of_the_journal_are_the_same_columns_in_both_languages(kind, steps, together):
    hull = KINDS[kind]
    records = lived(hull, steps)
    rows = []
    for first in range(0, len(records), together):
        some = records[first : first + together]
        commit = (None, None) if first == 0 else (first, 10 * first)
        for each in some:
            each.committed = None if first == 0 else CommitStamp(*commit)
        rows.append((some[0].revision, some[-1].revision, 0, encode(some), *commit))
    expected = columns_of(records, hull.identity)
    same(columns_of_rows(rows, hull.identity), expected)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch_columns, "native", None)
        same(columns_of_rows(rows, hull.identity), expected)


@given(kind=st.sampled_from(sorted(KINDS)), steps=STEPS, wanted=st.sets(st.integers(0, 9), min_size=1, max_size=3))
def test_rows_of_keys_that_are_wanted_say_the_same_of_these(kind, steps, wanted):
    hull = KINDS[kind]
    if hull.identity == "multiset":
        return
    some = sorted(wanted)
    keys = PackedKeys.pack([f"key {each}" for each in some]) if hull.identity == "str" else np.array(some, np.uint64)
    records = lived(hull, steps)
    rows = [(each.revision, each.revision, 0, encode([each]), *each.committed) for each in records]
    expected = changes_of_keys(columns_of(records, hull.identity), keys)
    found = columns_of_rows(rows, hull.identity, keys)
    same(changes_of_keys(found, keys), expected)
    assert np.unique(found.revision).tolist() == [each.revision for each in records]
    file = BytesIO(to_parquet(columns_of(records, hull.identity), {}))
    same(changes_of_keys(columns_of_keys([keys_from_parquet(file, "a file", keys)]), keys), expected)


@pytest.mark.skipif(native is None, reason="C++ is not built")
@pytest.mark.parametrize("kind", KINDS)
@given(steps=STEPS, together=st.integers(1, 4), after=st.integers(0, 10), less=st.integers(0, 3))
@one_of(6)
def test_last_places_lead_to_the_same_state(kind, steps, together, after, less):
    """From any revision to any other one, whatever the journal has in one row."""
    hull = KINDS[kind]
    records = lived(hull, steps)
    until = max(len(records) - less, 0)
    after = min(after, until)
    rows = []
    for first in range(0, len(records), together):
        some = records[first : first + together]
        for each in some:
            each.committed = CommitStamp(first, 10 * first)
        rows.append((some[0].revision, some[-1].revision, 0, encode(some), first, 10 * first))
    of_hull = SimpleNamespace(
        row=HullRow(1, "hull", "uid", 0.0, hull),
        start=0,
        last=len(records),
        between=lambda after, until: [row for row in rows if row[1] > after and row[0] <= until],
    )
    one, other = (HullState(LIMITS, hull, Kept(records=records[:after]), 0.0) for _ in range(2))
    for each in records[after:until]:
        one.catch_up([each], 0.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(past_rows, "batch_rows", lambda _, places: iter(places))
        patch.setattr(past_rows, "whole_rows", lambda _, rows: rows)
        patch.setattr(past_rows, "LEAST_BYTES", 1)
        last, all_found = after, []
        while last < until:
            found = gathered_after(None, of_hull, last, until)
            other.catch_up(found, 0.0)
            all_found += found
            last = found[-1].revision
    same(seen(other), seen(one))
    if all_found:
        same(seen(built(hull, records, after, all_found)), seen(one))


@pytest.mark.skipif(native is None, reason="C++ is not built")
def test_a_thousand_moves_of_a_few_keys_are_a_few_rows_in_c_too():
    hull = KINDS["keyed"]
    records = lived(hull, [("put", 1 << place % 8, place % 7, 0) for place in range(100)])
    places = native.LastPlaces(STRINGS)
    assert places.add([encode(records)], [100]) == 1
    assert len(places.taken()[2]) == 8
    assert places.add([encode(records)], [99]) == 0  # one of them is missing
    assert places.add([encode(records)[:-1]], [100]) == 0
    assert len(places.taken()[2]) == 8


def test_a_payload_that_is_cut_anywhere_is_no_batch():
    for kind in ("keyed", "numbered", "recent", "recent-by-data"):
        hull = KINDS[kind]
        payload = encode(lived(hull, [("ttl" if hull.identity == "str" else "dated", 7, 3, 0)]))
        for length in range(1, len(payload)):
            with pytest.raises((ValueError, struct.error)):
                columns_of_rows([(1, 1, 0, payload[:length], 1, 1)], hull.identity)


@pytest.mark.parametrize("kind", ["keyed", "numbered", "multiset", "event-times", "recent", "recent-keyed"])
def test_moves_of_a_few_keys_are_one_record(kind):
    """Otherwise a million batches of one move would be a million records."""
    hull = KINDS[kind]
    records = lived(
        hull, [("both" if hull == HullSettings() else "dated", 1 << place % 8, place % 7, 0) for place in range(100)]
    )
    assert len(records) == 100
    found = require_same(hull, records, 10, Batches(columns_of(records, hull.identity)))
    assert [each.revision for each in found] == [100]
    assert hull.identity == "multiset" or len(found[0].rows) == 8


def test_keys_have_the_same_numbers_in_both_languages(monkeypatch):
    keys = PackedKeys.pack(
        ["b", "a", "é", "b", "a" * 255, "ab", "a" * 255, "a", *(str(each % 700) for each in range(2000))]
    )
    found = key_codes(keys)
    monkeypatch.setattr(gathering, "native", None)
    assert found.tolist() == key_codes(keys).tolist()
    assert key_codes(keys[:0]).tolist() == []


@pytest.mark.parametrize("rows", [1, 3, 4, 9])
def test_keys_of_few_rows_are_written_one_by_one_and_read_as_those_of_many(rows, monkeypatch):
    """In groups of 64 rows, in whose first ones a key ends and the next one begins."""
    monkeypatch.setattr(parquet, "GROUP_ROWS", 64)
    names, places = [f"key {each:03}" for each in range(100)], np.arange(200.0).reshape(-1, 2)
    moved = [KeyRows(PackedKeys.pack(names), places + turn, PackedKeys.pack([])) for turn in range(rows)]
    columns = columns_of([Record(turn + 1, each) for turn, each in enumerate(moved)], "str")
    content = to_parquet(columns, {})
    encodings = pq.ParquetFile(BytesIO(content)).metadata.row_group(0).column(parquet.ORDER.index("key")).encodings
    assert ("RLE_DICTIONARY" in encodings) == (rows >= parquet.SHARED)
    same(from_parquet(content, "a file")[0], columns)
    found = rows_from_parquet(content, "a file")[0].last_places(HullSettings("str"), 0, rows)
    assert list(found.rows.keys) == names
    assert np.array_equal(found.rows.points, places + rows - 1)
    some = columns_of_keys([keys_from_parquet(BytesIO(content), "a file", PackedKeys.pack(["key 007", "key 063"]))])
    assert list(some.keys) == ["key 007", "key 063"] * rows


@pytest.mark.skipif(native is None, reason="C++ is not built")
@pytest.mark.parametrize("identity", ["str", "int"])
@pytest.mark.parametrize("group_rows", [7, 64, 1000])
def test_a_footer_of_the_groups_that_have_some_keys_leads_to_the_same_rows(identity, group_rows, monkeypatch):
    """The list of its groups has its size in four bits, in a byte, or in two."""
    monkeypatch.setattr(parquet, "GROUP_ROWS", group_rows)
    names = [f"key {each:03}" for each in range(200)]
    numbers = np.arange(200, dtype=np.uint64) * np.uint64(2**56)

    def keyed(some):
        return PackedKeys.pack([names[each] for each in some]) if identity == "str" else numbers[list(some)]

    moved = [KeyRows(keyed(range(200)), np.full((200, 2), float(turn)), keyed([])) for turn in range(5)]
    nothing = KeyRows(keyed([]), np.empty((0, 2)), keyed([]))
    columns = columns_of([Record(turn + 1, each) for turn, each in enumerate([*moved, nothing])], identity)
    file = BytesIO(to_parquet(columns, {}))
    for some in ([0], [199], [3, 4, 120], range(0, 200, 2), range(200), []):
        found = keys_from_parquet(file, "a file", keyed(some))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(parquet, "native", None)
            expected = keys_from_parquet(file, "a file", keyed(some))
        assert found.same == expected.same
        assert (found.about, found.state) == (expected.about, expected.state)
        assert found.table.equals(expected.table, check_metadata=True)
        assert len(found.table) == 5 * len(some) + 1


@pytest.mark.skipif(native is None, reason="C++ is not built")
def test_what_is_no_footer_is_left_to_who_knows_all_of_parquet():
    content = to_parquet(columns_of(lived(KINDS["keyed"], [("put", 3, 2, 0)] * 3), "str"), {})
    size = int.from_bytes(content[-8:-4], "little")
    footer, column = content[-8 - size : -8], parquet.ORDER.index("key")
    begin, first, ((end, least, greatest, none),) = native.footer_groups(footer, column)
    assert (least, greatest, none) == (b"key 0", b"key 1", 0)
    assert 0 < begin < first < end < size
    assert native.footer_groups(footer, 99)[2] == [(end, None, None, 0)]
    for length in range(first + 1, end):  # a list of groups that goes beyond the end
        assert native.footer_groups(footer[:length], column) is None
    rng = np.random.default_rng(1)
    for _ in range(2000):
        changed = bytearray(footer)
        changed[rng.integers(size)] ^= 1 << int(rng.integers(8))
        found = native.footer_groups(bytes(changed), column)
        assert found is None or all(0 < each[0] <= size for each in found[2])
    for other in (b"", b"PAR1", content[:-1] + b"2", b"\xff\xff\xff\xffPAR1", bytes(100)):
        with pytest.raises(DamagedError):
            keys_from_parquet(BytesIO(other), "a file", PackedKeys.pack(["key 0"]))
