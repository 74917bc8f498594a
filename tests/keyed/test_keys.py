"""Keys come in many forms, and bad ones are refused with the row and the value."""

import pickle

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

from dynhull.keys import FEW_ROWS, PackedKeys, as_key, as_keys, key_list, take_keys

STRINGS = ["a", "bé", "日本", "\U0001f600" * 63]
INTEGERS = [3, 0, 2**31]


@pytest.mark.parametrize(
    "column",
    [
        *(STRINGS, tuple(STRINGS), iter(STRINGS), PackedKeys.pack(STRINGS)),
        *(np.array(STRINGS), np.array(STRINGS, object), np.array(STRINGS * 2)[::2][:0]),
        *(pd.Series(STRINGS), pd.Series(STRINGS, dtype=object), pd.Series(STRINGS, dtype="string[pyarrow]")),
        *(pd.Index(STRINGS), pd.Categorical(STRINGS), pl.Series(STRINGS)),
        *(pa.array(STRINGS), pa.array(STRINGS, pa.large_string()), pa.array(["x", *STRINGS, "y"])[1:-1]),
        *(pa.chunked_array([STRINGS[:1], [], STRINGS[1:]]), pa.array(STRINGS).dictionary_encode()),
        *([], np.array([]), pa.array([], pa.string()), pa.array([]), pd.Series([], dtype=object)),
    ],
    ids=lambda column: type(column).__module__.split(".")[0],
)
def test_strings(column):
    keys = as_keys(column, "str")
    assert list(keys) in (STRINGS, [])
    assert keys == PackedKeys.pack(list(keys))


@pytest.mark.parametrize(
    "column",
    [
        *(INTEGERS, tuple(INTEGERS), iter(INTEGERS), [np.int64(key) for key in INTEGERS]),
        *(np.array(INTEGERS), np.array(INTEGERS, np.uint64), np.array(INTEGERS, ">u4"), np.array(INTEGERS, object)),
        *(np.repeat(np.array(INTEGERS, np.uint64), 2)[::2], pd.Series(INTEGERS), pd.Series(INTEGERS, dtype="Int64")),
        *(pl.Series(INTEGERS), pa.array(INTEGERS), pa.chunked_array([INTEGERS[:1], INTEGERS[1:]])),
        *([], np.array([]), pd.Series([], dtype=int)),
    ],
    ids=lambda column: type(column).__module__.split(".")[0],
)
def test_integers(column):
    keys = as_keys(column, "int")
    assert keys.dtype == np.uint64
    assert keys.flags.c_contiguous
    assert keys.tolist() in (INTEGERS, [])


def test_what_is_not_copied():
    packed, array = PackedKeys.pack(STRINGS), np.array(INTEGERS, np.uint64)
    assert as_keys(packed, "str") is packed
    assert as_keys(array, "int") is array
    assert PackedKeys(packed.lengths, packed.data).data is packed.data


BAD = [
    ("str", ["a", ""], ValueError, "keys row 1 is '', 0 bytes: a key has 1 to 255 bytes"),
    ("str", ["a", "é" * 128], ValueError, "keys row 1 is 'ééé.*256 bytes: a key has 1 to 255 bytes"),
    ("str", ["a", "x" * 10**6], ValueError, "^.{0,140}$"),
    ("str", ["a", "\ud800"], ValueError, r"keys row 1 is '\\ud800': not valid Unicode"),
    ("str", ["a", None, ""], TypeError, "keys row 1 is None: must be a string"),
    ("str", ["a", 3], TypeError, "keys row 1 is 3: must be a string, as the keys are strings"),
    ("str", [b"a"], TypeError, "keys row 0 is b'a': must be a string"),
    ("str", np.array([1, 2]), TypeError, "keys row 0 is 1: must be a string"),
    ("str", np.array([["a"]]), ValueError, r"keys must have shape \(k,\), got \(1, 1\)"),
    ("str", np.ma.array(["a", "b"], mask=[0, 1]), ValueError, "masked array"),
    ("str", "abc", TypeError, "keys is 'abc': must be a list or an array of keys"),
    ("str", 7, TypeError, "keys is 7: must be a list"),
    ("str", pa.array(["a", None]), TypeError, "keys row 1 is None: must be a string"),
    ("str", pa.array([1]), TypeError, "keys row 0 is 1: must be a string"),
    ("str", pa.array(["a", "b" * 300]), ValueError, "keys row 1 is 'bbb.*300 bytes"),
    ("str", pa.array(["a", ""]), ValueError, "keys row 1 is ''"),
    ("str", pd.Series(["a", None]), TypeError, "keys row 1 is nan: must be a string"),
    ("int", [1, True], TypeError, "keys row 1 is True: must be an integer, as the keys are integers"),
    ("int", [1, 1.0], TypeError, "keys row 1 is 1.0: must be an integer"),
    ("int", [1, -1], ValueError, r"keys row 1 is -1: a key is from 0 to 2\*\*64 - 1"),
    ("int", [1, 2**64], ValueError, "keys row 1 is 18446744073709551616: a key is from 0"),
    ("int", [1, None], TypeError, "keys row 1 is None: must be an integer"),
    ("int", ["a"], TypeError, "keys row 0 is 'a': must be an integer"),
    ("int", PackedKeys.pack(["a"]), TypeError, "keys row 0 is 'a': must be an integer"),
    ("int", np.array([1.5]), TypeError, "keys row 0 is 1.5: must be an integer"),
    ("int", np.array([True]), TypeError, "keys row 0 is True: must be an integer"),
    ("int", np.array([5, -2], np.int8), ValueError, "keys row 1 is -2: a key is from 0"),
    ("int", np.zeros((2, 2), int), ValueError, r"keys must have shape \(k,\), got \(2, 2\)"),
    ("int", np.ma.array([1, 2]), ValueError, "masked array"),
    ("int", pa.array([1, None]), TypeError, "keys row 1 is None: must be an integer"),
    ("int", pd.Series([1, None], dtype="Int64"), TypeError, "keys row 1 is <NA>: must be an integer"),
    ("int", 5, TypeError, "keys is 5: must be a list"),
    ("float", [1.0], ValueError, 'key_type must be "str" or "int", got \'float\''),
]


@pytest.mark.parametrize(("key_type", "keys", "error", "message"), BAD)
def test_bad_keys(key_type, keys, error, message):
    with pytest.raises(error, match=message):
        as_keys(keys, key_type)


def test_errors_have_the_callers_name():
    with pytest.raises(ValueError, match=r"^ids row 0 is ''"):
        as_keys([""], "str", "ids")


@pytest.mark.parametrize(
    ("lengths", "data", "error", "message"),
    [
        (b"\x01\x02", b"abcd", ValueError, "keys.lengths add up to 3 bytes, but keys.data has 4"),
        (b"\x01\x00\x01", b"ab", ValueError, "keys row 1 is ''"),
        (b"\x01\x02", b"a\xff\xfe", ValueError, r"keys row 1 is b'\\xff\\xfe': not UTF-8"),
        (b"\x01\x01\x01", "aé".encode(), ValueError, r"keys row 1 is b'\\xc3': not UTF-8"),
        (b"\x01\x03", b"a\xed\xa0\x80", ValueError, "keys row 1 .*: not UTF-8"),  # a surrogate
        ([1, 2], b"abc", TypeError, r"keys.lengths must be bytes or a uint8 array of shape \(n,\), got list"),
        (b"\x01", "a", TypeError, "keys.data must be bytes .* got str"),
        (np.array([1], np.int64), b"a", TypeError, "keys.lengths must be bytes or a uint8 array"),
    ],
)
def test_bad_packed_keys(lengths, data, error, message):
    with pytest.raises(error, match=message):
        PackedKeys(lengths, data)


def test_packed_keys_are_a_sequence():
    keys = PackedKeys.pack(STRINGS)
    arrays = np.frombuffer(keys.lengths, np.uint8).copy(), np.frombuffer(keys.data, np.uint8).copy()
    again = PackedKeys(*arrays)
    arrays[1][:] = 255
    for same in (again, pickle.loads(pickle.dumps(keys)), keys[:], PackedKeys.pack(keys)):
        assert same == keys
    assert (len(keys), keys[0], keys[-1], keys[1:3] == PackedKeys.pack(STRINGS[1:3])) == (4, "a", STRINGS[-1], True)
    for part in (slice(1, 3), slice(-2, None), slice(3, 1), slice(9, 12), slice(None, None, -2)):
        assert list(keys[part]) == STRINGS[part]
    assert STRINGS[2] in keys
    assert keys != PackedKeys.pack(["ab", "é", *STRINGS[2:]])  # the same bytes, cut elsewhere
    with pytest.raises(IndexError):
        keys[4]
    with pytest.raises(TypeError, match="unhashable"):
        hash(keys)


def test_one_key():
    assert as_key("é", "str") == "é"
    assert as_key(np.uint64(2**64 - 1), "int") == 2**64 - 1
    for key, key_type, error, message in [
        ("", "str", ValueError, "key is '', 0 bytes"),
        (3, "str", TypeError, "key is 3: must be a string"),
        ("3", "int", TypeError, "key is '3': must be an integer"),
        (-1, "int", ValueError, "key is -1: a key is from 0"),
        (False, "int", TypeError, "key is False: must be an integer"),
    ]:
        with pytest.raises(error, match=message):
            as_key(key, key_type)


@pytest.mark.parametrize("count", [0, 1, FEW_ROWS, FEW_ROWS + 1, 3000])
@pytest.mark.parametrize("kind", ["str", "int"])
def test_some_of_many_keys_are_taken_in_the_order_that_is_asked_for(kind, count):
    names = [f"{'é' * (row % 9)}{row}" if kind == "str" else row * 2**53 + 1 for row in range(1000)]
    rows = np.random.default_rng(1).integers(0, 1000, count)
    assert key_list(take_keys(as_keys(names, kind), rows)) == [names[row] for row in rows]
