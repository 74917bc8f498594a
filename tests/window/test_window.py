"""Windows: bad input, times at the edges, both implementations on large inputs, windows as values, threads."""

import copy
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import datetime
from fractions import Fraction
from math import inf, nextafter
from threading import Event
from time import sleep

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from inputs import cloud
from windows import WINDOWS, Model, assert_as

from dynhull import DynamicHull, MissingPointError, WindowHull

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.fixture(params=WINDOWS)
def make(request):
    return WINDOWS[request.param]


@pytest.mark.parametrize(
    ("limits", "error", "message"),
    [
        ({}, ValueError, "max_age and max_points are both None"),
        ({"max_age": 0}, ValueError, r"max_age is 0\.0: must be positive"),
        ({"max_age": -1.5}, ValueError, r"max_age is -1\.5: must be positive"),
        ({"max_age": inf}, ValueError, "max_age is inf: times must be finite"),
        ({"max_age": np.nan}, ValueError, "max_age is nan"),
        ({"max_age": "5"}, TypeError, "max_age: times must be real numbers, got '5'"),
        ({"max_age": 2**53 + 1}, ValueError, "max_age is 9007199254740993: no double has this value"),
        ({"max_points": 0}, ValueError, "max_points is 0: must be at least 1"),
        ({"max_points": -3}, ValueError, "max_points is -3"),
        ({"max_points": 2.5}, TypeError, r"max_points must be an integer, got 2\.5"),
    ],
)
def test_bad_limits(make, limits, error, message):
    with pytest.raises(error, match=message):
        make(**limits)


BAD_TIMES = [
    (None, ValueError, "times is None: a window with max_age needs the time of each point"),
    ([1.0], ValueError, r"times must have shape \(2,\) like the points, got \(1,\)"),
    (7.0, ValueError, r"got \(\)"),
    ([[1.0, 2.0]], ValueError, r"got \(1, 2\)"),
    (np.array([1.0, np.nan]), ValueError, "times row 1 is nan: times must be finite"),
    ([-inf, 1.0], ValueError, "times row 0 is -inf: times must be finite"),
    (np.array([1, np.inf], np.float32), ValueError, "times row 1 is inf"),
    ([1.0, "2"], TypeError, "times must be real numbers, got <U"),
    ([1.0, None], TypeError, "times row 1: times must be real numbers, got None"),
    (np.array(["2020-01-01", "2020-01-02"], "M8[s]"), TypeError, r"times must be real numbers, got datetime64\[s\]"),
    ([datetime(2020, 1, 1)] * 2, TypeError, "times row 0: times must be real numbers, got datetime"),
    ([0, 2**53 + 1], ValueError, "times row 1 is 9007199254740993: no double has this value"),
    ([0, Fraction(1, 3)], ValueError, r"times row 1 is Fraction\(1, 3\): no double has this value"),
    (np.ma.masked_array([1.0, 2.0], [True, False]), ValueError, "times must not be or contain a masked array"),
]


@pytest.mark.parametrize(("times", "error", "message"), BAD_TIMES)
def test_bad_times_change_nothing(make, times, error, message):
    window = make(max_age=5.0)
    window.add(SQUARE, [1, 2, 3, 4])
    before = window.copy()
    with pytest.raises(error, match=message):
        window.add([[9, 9], [8, 8]], times)
    assert window == before
    window.check()


def test_bad_points_change_nothing(make):
    window = make(max_age=5.0)
    window.add(SQUARE, [1, 2, 3, 4])
    before = window.copy()
    for rows in ([[9, 9], [8, np.nan]], np.array([[9, 9], [8, np.inf]])):
        with pytest.raises(ValueError, match="points row 1"):
            window.add(rows, np.array([100.0, 100.0]))
        with pytest.raises(ValueError, match="points row 1"):
            window.delete_many(rows)
    with pytest.raises(ValueError, match='missing must be "raise" or "ignore", got 1'):
        window.delete_many(SQUARE, missing=1)
    with pytest.raises(MissingPointError, match="row 1: point "):
        window.delete_many([[0, 0], [0, 0]])
    with pytest.raises(MissingPointError, match=r"point \(7\.0, 7\.0\) is missing"):
        window.delete(7, 7)
    assert window == before


@pytest.mark.parametrize(
    ("now", "error", "message"),
    [
        (3, ValueError, r"now is 3\.0, before the window's time 4\.0: time does not go back"),
        (nextafter(4.0, 0.0), ValueError, r"now is 3\.9999999999999996, before the window's time 4\.0"),
        (np.nan, ValueError, "now is nan: times must be finite"),
        (inf, ValueError, "now is inf: times must be finite"),
        ("9", TypeError, "now: times must be real numbers, got '9'"),
        (None, TypeError, "now: times must be real numbers, got None"),
        (10**400, ValueError, "too large for a double"),
    ],
)
def test_bad_clocks_change_nothing(make, now, error, message):
    window = make(max_age=5.0)
    window.add(SQUARE, [1, 2, 3, 4])
    with pytest.raises(error, match=message):
        window.advance(now)
    assert (window.now, len(window), window.expired) == (4.0, 4, 0)


def test_times_of_any_exact_type(make):
    window = make(max_age=np.float32(8))
    window.add(SQUARE, np.arange(8, dtype=np.int64)[::2])
    window.add(SQUARE[:2], (time for time in (Fraction(1, 2), -0.0)))
    window.add(SQUARE[:1], [True])
    assert window.times().tolist() == [0.0, 0.5, 1.0, 6.0, 0.0, 2.0, 4.0]
    assert window.advance(np.int32(8)) == 2


@given(now=finite, age=finite.map(abs).filter(lambda age: age > 0))
@example(now=-1.7e308, age=1.7e308)
@example(now=1.7976931348623157e308, age=5e-324)
@example(now=-1.7976931348623157e308, age=5e-324)
@example(now=5e-324, age=1e-323)
@example(now=2.0**53, age=0.5)
@example(now=1.0, age=2.0**-54)
@example(now=1e300, age=1.0)
def test_a_point_leaves_exactly_when_it_is_too_old(now, age):
    """The points just too old and just young enough, of both implementations."""
    edge = nextafter(now - age, inf)  # one of the next three doubles below is the youngest that is too old
    times = [edge]
    for _ in range(3):
        times.append(nextafter(times[-1], -inf))
    times = [time for time in times if abs(time) < inf and time <= now]
    expected = [time for time in times if Fraction(time) > Fraction(now) - Fraction(age)]
    for make in WINDOWS.values():
        window = make(max_age=age)
        rows = [(row, 0) for row in range(len(times))]
        if times:
            window.add(rows[::-1], times[::-1])
        window.advance(max(now, window.now or now))
        if window.now == now:
            assert sorted(window.times().tolist(), reverse=True) == expected
        late = make(max_age=age)
        late.advance(now)
        assert late.add(rows, times) == len(expected)
        assert late.late == len(times) - len(expected)


def test_a_max_age_below_one_ulp_keeps_the_present_alone(make):
    window = make(max_age=0.25)
    assert window.add([[0, 0], [1, 1], [2, 2]], [2.0**53, 2.0**53 - 1, 2.0**53]) == 2
    assert window.late == 1
    assert window.advance(2.0**53 + 2) == 2


def test_a_batch_counts_for_its_own_rows(make):
    window = make(max_age=10, max_points=3)
    window.add([[5, 5], [6, 6]], [0, 4])
    changes = window.changes
    assert window.add([[0, 0], [1, 1], [4, 0], [2, 5], [9, 9]], [2, 12, 12, 13, 3]) == 3
    assert (window.late, window.expired, window.evicted, window.now) == (2, 1, 1, 13.0)
    assert window.points().tolist() == [[1, 1], [2, 5], [4, 0]]
    assert window.changes == changes + 1


def test_the_earlier_arrival_of_equal_times_is_evicted(make):
    window = make(max_points=2)
    assert window.add([[0, 0], [1, 0], [2, 0]], [7, 7, 7]) == 3
    assert (window.points().tolist(), window.evicted) == ([[1, 0], [2, 0]], 1)
    window.add([[3, 0]], [7])
    assert window.points().tolist() == [[2, 0], [3, 0]]
    window.add([[4, 0]], [6])
    assert (window.points().tolist(), window.evicted) == ([[2, 0], [3, 0]], 3)


def test_points_without_times_leave_in_order_of_arrival(make):
    window = make(max_points=2)
    assert window.add(SQUARE[:3]) == 3
    assert (window.points().tolist(), window.now, window.oldest) == ([[4, 0], [4, 4]], None, None)
    assert window.times().tolist() == [-inf, -inf]
    window.add([[9, 9]], [-5])
    assert (window.points().tolist(), window.now, window.oldest) == ([[4, 4], [9, 9]], -5.0, None)
    window.add([[8, 8]])
    assert (window.times().tolist(), window.oldest) == ([-5.0, -5.0], -5.0)


def test_deletes_take_the_oldest_copy(make):
    window = make(max_age=10)
    window.add([[1, 1]] * 4, [5, 3, 8, 3])
    window.delete(1, 1)
    assert window.times().tolist() == [3, 5, 8]
    window.add([[1, 1]], [1])
    assert window.delete_many([[1, 1]] * 2) == 2
    assert window.times().tolist() == [5, 8]
    assert (window.oldest, window.advance(15), len(window)) == (5.0, 1, 1)
    window.check()


def test_many_deletes_while_an_old_point_stays(make):
    """So many that the order of expiry is built anew, without what was deleted."""
    window, model = make(max_points=10_000), Model(None, 10_000)
    window.add([[0, 0]], [0])
    model.add([(0, 0)], [0])
    rows = [(float(i), float(i % 7)) for i in range(1, 701)]
    for time in range(1, 6):
        window.add(rows, np.full(700, 9.0 - time))
        assert window.delete_many(rows) == 700
        assert (len(window), window.oldest) == (1, 0.0)
    model.now = 8.0
    assert_as(window, model)
    assert window.add([[0, 0]] * 3, [1, 9, 2]) == model.add([(0, 0)] * 3, [1, 9, 2])
    assert_as(window, model)


@pytest.mark.every(4)
@pytest.mark.parametrize("kind", ["uniform", "circle", "grid", "columns", "clusters"])
@pytest.mark.parametrize("delay", [0, 0.01, 1])
def test_implementations_agree_on_large_inputs(kind, delay):
    """Batches of every size, points delayed; the hull is that of the points younger than the window."""
    random = np.random.default_rng(0)
    rows = cloud(kind, 3000, random)
    times = np.arange(3000.0)
    late = random.random(3000) < delay
    times[late] -= random.integers(0, 500, late.sum())
    windows = [make(max_age=600.0, max_points=500) for make in WINDOWS.values()]
    first = 0
    for size in (1, 700, 3, 64, 1000, 200, 1032):
        part = slice(first, first + size)
        first += size
        answers = [(w.add(rows[part], times[part]), w.expired, w.evicted, w.late, w.oldest, w.changes) for w in windows]
        assert all(answer == answers[0] for answer in answers)
        doomed = windows[0].points()[::5]
        for window in windows:
            window.delete_many(doomed)
            np.testing.assert_array_equal(window.points(), windows[0].points())
            np.testing.assert_array_equal(window.times(), windows[0].times())
            np.testing.assert_array_equal(window.vertices(), DynamicHull(window.points()).vertices())
    for window in windows:
        window.check()


@pytest.mark.parametrize(
    "duplicate", [WindowHull.copy, copy.copy, copy.deepcopy, lambda window: pickle.loads(pickle.dumps(window))]
)
def test_copies_are_equal_and_independent(make, duplicate):
    window = make(max_age=100, max_points=5)
    window.add([*SQUARE, [2, 2], [2, 2]], [3, 1, 4, 1, 5, 9])
    window.add([[7, 7], [6, 6]], [2, -95])
    window.delete(2, 2)
    other = duplicate(window)
    other.check()
    assert other == window
    names = ["max_age", "max_points", "now", "oldest", "expired", "evicted", "late", "changes", "area"]
    assert [getattr(other, name) for name in names] == [getattr(window, name) for name in names]
    assert other.advance(104) == window.copy().advance(104) > 0
    assert other != window
    with pytest.raises(TypeError, match="unhashable"):
        hash(window)


@pytest.mark.parametrize("reader", WINDOWS)
def test_every_implementation_reads_every_pickle(make, reader):
    window = make(max_age=100, max_points=5)
    window.add([*SQUARE, [2, 2], [2, 2]], [3, 1, 4, 1, 5, 9])
    window.add([[7, 7]], [2])
    other = WINDOWS[reader].__new__(WINDOWS[reader])
    other.__setstate__(window.__getstate__())
    assert other == window
    assert (other.evicted, other.changes) == (2, window.changes)


def test_windows_differ_by_points_times_limits_and_clock(make):
    def window(points=SQUARE, times=(1, 2, 3, 4), now=9, **limits):
        made = make(**({"max_age": 50} | limits))
        made.add(points, times)
        made.advance(now)
        return made

    assert window() == window(SQUARE[::-1], (4, 3, 2, 1))
    for other in (
        window(SQUARE[::-1]),
        window(times=(1, 2, 3, 5)),
        window(now=10),
        window(max_age=51),
        window(max_points=99),
        window(SQUARE[:3], (1, 2, 3)),
        DynamicHull(SQUARE),
    ):
        assert window() != other


def test_clear_keeps_the_clock_and_the_totals(make):
    window = make(max_age=10)
    window.add(SQUARE, [0, 5, 12, 13])
    window.clear()
    assert (len(window), window.now, window.late, window.oldest) == (0, 13.0, 1, None)
    assert window.add(SQUARE[:1], [3]) == 0
    window.check()


def test_a_window_answers_as_a_hull_does(make):
    window = make(max_points=100)
    window.add(SQUARE)
    hull = DynamicHull(SQUARE)
    assert (window.area, window.bounds, window.diameter()) == (hull.area, hull.bounds, hull.diameter())
    assert window.locate([[2, 2], [4, 2], [9, 9]]).tolist() == [1, 0, -1]
    assert (0, 4) in window
    assert repr(window).endswith("of 4 points, 4 vertices>")
    assert WindowHull.__module__ == "dynhull"


@contextmanager
def switching_after(seconds):
    interval = sys.getswitchinterval()
    sys.setswitchinterval(seconds)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)


@pytest.mark.skipif("cpp" not in WINDOWS, reason="without the kernel, threads take turns")
def test_threads_move_one_window():
    """Writers and readers at every chance: no answer belongs to half an update."""
    window = WINDOWS["cpp"](max_age=50.0)

    def write(number):
        random = np.random.default_rng(number)
        added = 0
        for time in range(100):
            size = int(random.integers(1, 200))
            added += window.add(random.random((size, 2)), np.full(size, float(time)))
        return added

    def read(_):
        for _ in range(50):
            other = window.copy()
            other.check()
            assert other.oldest is None or other.oldest > other.now - 50

    with switching_after(1e-6), ThreadPoolExecutor(4) as pool:
        writers = [pool.submit(write, number) for number in range(2)]
        for reader in [pool.submit(read, number) for number in range(2)]:
            reader.result()
        added = sum(writer.result() for writer in writers)
    window.check()
    assert added == len(window) + window.expired
    left = len(window)
    assert window.advance(1e6) == left


@pytest.mark.skipif("cpp" not in WINDOWS, reason="without the kernel, threads take turns")
@pytest.mark.parametrize(
    "update", [lambda window: window.advance(9), lambda window: window.add([[5, 5]], [9])], ids=["advance", "add"]
)
def test_other_threads_run_while_many_points_expire(update):
    """Although the update itself has one row at most. A thread never takes the interpreter from another here."""
    window = WINDOWS["cpp"](max_age=5.0)
    window.add(np.random.default_rng(0).random((20_000, 2)), np.ones(20_000))
    copies = [window.copy() for _ in range(50)]  # the system may be slow to run the other thread
    steps, done = [], Event()

    def count():
        while not done.is_set():
            steps.append(None)
            sleep(0)  # releases the interpreter

    with switching_after(1000), ThreadPoolExecutor(1) as pool:
        pool.submit(count)
        try:
            for each in copies:
                before = len(steps)
                update(each)
                if len(steps) > before:
                    break
            else:
                pytest.fail("the other thread stood still")
        finally:
            done.set()
