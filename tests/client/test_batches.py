"""The keys and times that a batch takes, and what it refuses before anything is sent."""

from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

from dynhull.keys import PackedKeys
from dynhull_client import Batch

POINT = [[0, 0]]
NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
NOON_IN_TOKYO = NOON.astimezone(timezone(timedelta(hours=9)))
NAIVE = datetime(2026, 3, 1, 12)
MICROS = 1_772_366_400_000_000
COLUMN = pd.Series([NOON, NOON])


@pytest.mark.parametrize(
    "times",
    [
        [NOON, NOON_IN_TOKYO],
        (each for each in (NOON, NOON)),
        [MICROS, NOON],
        [np.datetime64("2026-03-01T12:00"), np.int64(MICROS)],
        np.array(["2026-03-01T12:00:00.000000999"] * 2, "datetime64[ns]"),
        np.array([MICROS] * 2),
        ["2026-03-01T12:00:00Z", "2026-03-01T11:59:60Z"],
        pd.Series(["2026-03-01T21:00:00+09:00"] * 2),
        COLUMN,
        list(COLUMN),
        COLUMN.dt.tz_convert("Asia/Tokyo"),
        pd.DatetimeIndex(COLUMN),
        COLUMN.astype("timestamp[us, UTC][pyarrow]"),
        pd.Series([MICROS] * 2),
        pa.array([NOON, NOON]),
        pa.chunked_array([[NOON], [NOON_IN_TOKYO]], pa.timestamp("us", "UTC")),
        pl.Series([NOON, NOON]),
    ],
    ids=lambda times: type(times).__name__,
)
def test_times_of_every_kind(times: Any) -> None:
    batch = Batch(keys=["a", "b"], points=POINT * 2, times=times)
    assert np.frombuffer(batch.message.puts.times.packed, "<i8").tolist() == [MICROS] * 2


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (["LH400", "ü"], ["LH400", "ü"]),
        (PackedKeys.pack(["LH400", "ü"]), ["LH400", "ü"]),
        ((each for each in ("LH400", "ü")), ["LH400", "ü"]),
        (np.array(["LH400", "ü"]), ["LH400", "ü"]),
        (pd.Series(["LH400", "ü"]), ["LH400", "ü"]),
        (pa.chunked_array([["LH400"], ["ü"]]), ["LH400", "ü"]),
        (pl.Series(["LH400", "ü"]), ["LH400", "ü"]),
        ([7, 2**64 - 1], [7, 2**64 - 1]),
        (np.array([7, 2**64 - 1], np.uint64), [7, 2**64 - 1]),
        (pd.Series([7, 8]), [7, 8]),
        (pa.array([7, 8]), [7, 8]),
        (range(7, 9), [7, 8]),
    ],
    ids=lambda keys: type(keys).__name__,
)
def test_keys_of_every_kind(keys: Any, expected: list[Any]) -> None:
    sent = Batch(keys=keys, points=POINT * 2, remove=["x"]).message.puts.keys
    if isinstance(expected[0], str):
        assert list(PackedKeys(sent.lengths, sent.text)) == expected
    else:
        assert np.frombuffer(sent.packed_integers, "<u8").tolist() == expected


A = {"keys": ["a"], "points": POINT}
REFUSED = [
    (A | {"keys": ["a", 7], "points": POINT * 2}, TypeError, "keys row 1 is 7: must be a string"),
    (A | {"keys": [7, "a"], "points": POINT * 2}, TypeError, "keys row 1 is 'a': must be an integer"),
    (A | {"keys": [1.5]}, TypeError, "keys row 0 is 1.5: a key is a string or an integer"),
    (A | {"keys": [None]}, TypeError, "keys row 0 is None: a key is a string or an integer"),
    (A | {"keys": "a"}, TypeError, "keys is 'a': must be a list or an array of keys"),
    (A | {"keys": [-1]}, ValueError, "keys row 0 is -1: a key is from 0 to"),
    (A | {"keys": [""]}, ValueError, "keys row 0 is '', 0 bytes: a key has 1 to 255 bytes"),
    (A | {"keys": ["a", "b"]}, ValueError, "there are 2 keys and 1 points"),
    (A | {"points": [[0, float("nan")]]}, ValueError, "points row 0 is"),
    (A | {"times": [NAIVE]}, ValueError, r"times row 0 is 2026-03-01T12:00:00, which has no time zone: write"),
    (A | {"times": pd.Series([NAIVE])}, ValueError, "times has no time zone: give it one, in pandas with"),
    (A | {"times": pa.array([NAIVE])}, ValueError, "times has no time zone"),
    (A | {"times": ["2026-03-01T12:00:61Z"]}, ValueError, "times row 0 is '2026-03-01T12:00:61Z': must be a datetime"),
    (
        A | {"times": ["2026-03-01T12:00:60"]},
        ValueError,
        "times row 0 is '2026-03-01T12:00:60', which has no time zone",
    ),
    (A | {"times": NOON}, TypeError, "must be one time for each point"),
    (A | {"times": [1.5]}, TypeError, "times row 0 is 1.5: must be a datetime"),
    (A | {"times": [True]}, TypeError, "times row 0 is True: must be a datetime"),
    (A | {"times": [pd.NaT]}, TypeError, "times row 0 is NaT"),
    (A | {"times": pd.Series([pd.NaT], dtype="datetime64[ns, UTC]")}, ValueError, "times row 0 is missing"),
    (A | {"times": [2**53 + 1]}, ValueError, "times row 0 is .*: not from the years 1685 to 2255"),
    (A | {"times": [NOON, NOON]}, ValueError, "times has 2 rows for 1 points"),
    (A | {"only": "new"}, ValueError, "only must be"),
    (A | {"missing": "ignore"}, ValueError, "missing must be"),
    (
        A | {"ttl": float("nan")},
        ValueError,
        "ttl is nan: must be a finite number of seconds, a timedelta, or text such as 500ms, 90s, 30m, 2h or 7d",
    ),
    (A | {"ttl": 1, "expire_times": [NOON]}, ValueError, "either ttl or expire_times"),
    (A | {"insert": POINT}, ValueError, "a batch either puts and removes keys, or inserts"),
    ({"remove": ["a"], "delete": POINT}, ValueError, "a batch either puts and removes keys, or inserts"),
    ({"keys": ["a"]}, ValueError, "keys and points are given together"),
    ({"delete": POINT, "times": [NOON]}, ValueError, "times are given with the points to put or to insert"),
    ({"remove": ["a"], "ttl": 1}, ValueError, "only, ttl and expire_times are given with keys to put"),
]


@pytest.mark.parametrize(("arguments", "error", "words"), REFUSED, ids=range(len(REFUSED)))
def test_bad_arguments_are_refused(arguments: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        Batch(**arguments)


@pytest.mark.parametrize(
    ("times", "unit"),
    [
        ([1_772_366_400], "seconds"),
        (np.array([1_772_366_400_000]), "milliseconds"),
        (pd.Series([1_772_366_400]), "seconds"),
        ([7], None),
    ],
)
def test_integers_that_are_times_of_1970_are_warned_about(times: Any, unit: str | None) -> None:
    meant = "" if unit is None else f", which as {unit} would be of our age"
    words = f"times: integers are microseconds since 1970, and some are times of 1970{meant}. Give datetimes"
    with pytest.warns(UserWarning, match=words):
        Batch(keys=["a"], points=POINT, times=times)
    Batch(
        keys=["a"], points=POINT, times=[datetime(1970, 1, 1, tzinfo=UTC)], expire_times=np.array([7], "datetime64[us]")
    )


def test_a_batch_prints_its_size() -> None:
    assert repr(Batch(keys=["a", "b"], points=POINT * 2, remove=["c"])) == "<Batch of 3 rows>"
    assert repr(Batch(insert=POINT, delete=POINT, move=(POINT, POINT))) == "<Batch of 4 rows>"
