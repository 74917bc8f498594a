"""Conversion of batches, their keys and times."""

from typing import Any

import numpy as np
import numpy.typing as npt
from google.protobuf.timestamp_pb2 import Timestamp

from dynhull.keys import PackedKeys
from dynhull_proto.v1 import batch_pb2, points_pb2

from ..state.admission import GREATEST_TIME, shown
from ..state.batch import NO_POINTS, Batch, KeyedBatch
from ..state.records import Accuracies, Condition, Keys, Times
from .decode import InvalidFieldError, decode_points
from .decode_settings import MICROSECONDS, NANOSECONDS, decode_duration

MISSING_POINT_POLICIES = frozenset(batch_pb2.MissingPointPolicy.values())
MISSING_KEY_POLICIES = frozenset(batch_pb2.MissingKeyPolicy.values())
CONDITIONS: dict[int, Condition | None] = {
    batch_pb2.PUT_CONDITION_UNSPECIFIED: None,
    batch_pb2.PUT_CONDITION_ALWAYS: None,
    batch_pb2.PUT_CONDITION_IF_ABSENT: "absent",
    batch_pb2.PUT_CONDITION_IF_PRESENT: "present",
}
BYTES_PER_NUMBER = 8
SIGNED, UNSIGNED, DOUBLE = np.dtype("<i8"), np.dtype("<u8"), np.dtype("<f8")
MOST_KEY_BYTES = 255
NANOSECONDS_PER_SECOND = 1_000_000_000
NO_STRINGS, NO_INTEGERS = PackedKeys(b"", b""), np.empty(0, np.uint64)


def decode_batch(batch: batch_pb2.Batch) -> Batch | KeyedBatch:
    """A batch of keys, or one of points, whose moves have equally many origins and destinations."""
    has = batch.HasField
    if has("puts") or has("removes") or has("releases") or has("drops"):
        keyed = _decode_keyed(batch)
        if keyed is not None:
            return keyed
        if batch.puts.HasField("ttl") and (has("inserts") or has("deletes") or has("moves")):
            raise InvalidFieldError("batch.puts.ttl", "present", "points without keys have no ttl")
    missing_points = batch.missing_points
    if missing_points not in MISSING_POINT_POLICIES:
        raise InvalidFieldError("batch.missing_points", missing_points, "not a policy that this server supports")
    inserts = decode_points(batch.inserts, "batch.inserts") if has("inserts") else NO_POINTS
    deletes = decode_points(batch.deletes, "batch.deletes") if has("deletes") else NO_POINTS
    times = None
    if has("insert_times"):
        times = _decode_row_times(batch.insert_times, "batch.insert_times", len(inserts), "inserts")
    moves = 0
    if has("moves"):
        origins = decode_points(batch.moves.origins, "batch.moves.origins")
        destinations = decode_points(batch.moves.destinations, "batch.moves.destinations")
        moves = len(origins)
        if len(destinations) != moves:
            problem = f"must be as many as the origins, {moves}"
            raise InvalidFieldError("batch.moves.destinations", f"{len(destinations)} points", problem)
        inserts, deletes = np.concatenate((inserts, destinations)), np.concatenate((deletes, origins))
    return Batch(inserts, deletes, moves, missing_points == batch_pb2.MISSING_POINT_POLICY_COUNT, times)


def _decode_keyed(batch: batch_pb2.Batch) -> KeyedBatch | None:
    """A batch of keys; None if it names no key."""
    has, missing_keys = batch.HasField, batch.missing_keys
    if missing_keys not in MISSING_KEY_POLICIES:
        raise InvalidFieldError("batch.missing_keys", missing_keys, "not a policy that this server supports")
    puts = batch.puts
    keys = decode_keys(puts.keys, "batch.puts.keys")
    points = decode_points(puts.points, "batch.puts.points")
    rows = 0 if keys is None else len(keys)
    if len(points) != rows:
        problem = f"must be as many as the keys, {rows}"
        raise InvalidFieldError("batch.puts.points", f"{len(points)} points", problem)
    times = deadlines = ttl = None
    has_of_puts = puts.HasField
    if has_of_puts("times"):
        times = _decode_row_times(puts.times, "batch.puts.times", rows, "keys")
    if has_of_puts("expire_times"):
        deadlines = _decode_row_times(puts.expire_times, "batch.puts.expire_times", rows, "keys")
    if has_of_puts("ttl"):
        ttl = decode_duration(puts.ttl, "batch.puts.ttl", least=1)
    if ttl is not None and deadlines is not None:
        raise InvalidFieldError("batch.puts.ttl", "ttl and expire_times", "use one or the other")
    accuracies = _decode_accuracies(puts.accuracies, rows) if has_of_puts("accuracies") else None
    condition = puts.condition
    if condition not in CONDITIONS:
        raise InvalidFieldError("batch.puts.condition", condition, "not a condition that this server supports")
    parts = {"puts.keys": keys}
    for part in ("removes", "releases", "drops"):
        parts[part] = decode_keys(getattr(batch, part), f"batch.{part}") if has(part) else None
    named = {part: found for part, found in parts.items() if found is not None}
    if not named:
        return None
    if has("inserts") or has("deletes") or has("moves"):
        raise InvalidFieldError("batch", "points and keys", "a batch has points without keys, or keys")
    if has("insert_times"):
        raise InvalidFieldError("batch.insert_times", "present", "keys have their times in puts.times")
    first, *others = named
    strings = not isinstance(named[first], np.ndarray)  # PackedKeys is an abstract Sequence, and slow to test for
    for part in others:
        if isinstance(named[part], np.ndarray) == strings:
            raise InvalidFieldError(f"batch.{part}", "strings and integers", "all keys of a batch are of one kind")
    none: Keys = NO_STRINGS if strings else NO_INTEGERS
    return KeyedBatch(
        "str" if strings else "int",
        none if keys is None else keys,
        points,
        named.get("removes", none),
        times,
        CONDITIONS[condition],
        ttl,
        deadlines,
        missing_keys == batch_pb2.MISSING_KEY_POLICY_REFUSE,
        named.get("releases"),
        named.get("drops"),
        accuracies=accuracies,
    )


# Keys


def decode_keys(keys: points_pb2.Keys, field: str) -> Keys | None:
    """The keys of a request; None if there are none."""
    strings, integers = keys.strings, keys.integers
    packed_strings, packed_integers = bool(keys.lengths or keys.text), keys.packed_integers
    if packed_strings + bool(strings) + bool(packed_integers) + bool(integers) > 1:
        raise InvalidFieldError(field, "several encodings", "use one kind of keys and one encoding")
    if packed_strings:
        return _decode_packed(keys.lengths, keys.text, field)
    if strings:
        return _decode_strings(list(strings), field)
    if packed_integers:
        return _numbers(packed_integers, f"{field}.packed_integers", UNSIGNED).astype(np.uint64, copy=False)
    return np.array(integers, np.uint64) if integers else None


def _decode_packed(lengths: bytes, text: bytes, field: str) -> PackedKeys:
    try:
        return PackedKeys(lengths, text)
    except ValueError:
        pass
    if sum(lengths) != len(text):
        problem = f"must add up to the bytes of text, {len(text)}"
        raise InvalidFieldError(f"{field}.lengths", f"{sum(lengths)} bytes", problem)
    start = 0
    for row, length in enumerate(lengths):
        key = text[start : start + length]
        start += length
        try:
            bad = not key.decode()
        except UnicodeDecodeError:
            bad = True
        if bad:
            raise InvalidFieldError(field, repr(key), f"a key has 1 to {MOST_KEY_BYTES} bytes in UTF-8", row)
    raise AssertionError(f"{field} have no bad row")


def _decode_strings(strings: list[str], field: str) -> PackedKeys:
    for row, key in enumerate(strings):
        if not 0 < len(key.encode()) <= MOST_KEY_BYTES:
            raise InvalidFieldError(field, repr(key), f"a key has 1 to {MOST_KEY_BYTES} bytes in UTF-8", row)
    return PackedKeys.pack(strings)


def _numbers(packed: bytes, field: str, kind: np.dtype[Any]) -> npt.NDArray[Any]:
    if len(packed) % BYTES_PER_NUMBER:
        problem = f"a number has {BYTES_PER_NUMBER} bytes, so the number of bytes must be a multiple of that"
        raise InvalidFieldError(field, f"{len(packed)} bytes", problem)
    return np.frombuffer(packed, kind)


# Accuracies and times


def _decode_accuracies(accuracies: points_pb2.Accuracies, rows: int) -> Accuracies | None:
    """The errors of as many positions as there are keys; None if all are 0."""
    field = "batch.puts.accuracies"
    if accuracies.packed and accuracies.values:
        raise InvalidFieldError(field, "packed and values", "use one encoding or the other")
    if accuracies.packed:
        decoded = _numbers(accuracies.packed, f"{field}.packed", DOUBLE).astype(np.float64, copy=False)
    elif accuracies.values:
        decoded = np.array(accuracies.values, np.float64)
    else:
        return None
    if len(decoded) != rows:
        problem = f"must be as many as the keys, {rows}, or none"
        raise InvalidFieldError(field, f"{len(decoded)} accuracies", problem)
    bad = ~((decoded >= 0) & (decoded < np.inf))
    if bad.any():
        row = int(np.argmax(bad))
        raise InvalidFieldError(field, float(decoded[row]), "must be finite and not negative", row)
    return decoded + 0.0 if decoded.any() else None  # without negative zeros


def _decode_row_times(times: points_pb2.Times, field: str, rows: int, what: str) -> Times | None:
    """As many times as rows; None if there are none."""
    decoded = decode_times(times, field)
    if decoded is not None and len(decoded) != rows:
        raise InvalidFieldError(field, f"{len(decoded)} times", f"must be as many as the {what}, {rows}, or none")
    return decoded


def decode_times(times: points_pb2.Times, field: str) -> Times | None:
    """Microseconds since 1970; None if there are none."""
    if times.packed and times.timestamps:
        raise InvalidFieldError(field, "packed and timestamps", "use one encoding or the other")
    if times.packed:
        decoded = _numbers(times.packed, f"{field}.packed", SIGNED).astype(np.int64, copy=False)
    elif times.timestamps:
        return _decode_timestamps(times, field)
    else:
        return None
    far = (decoded > GREATEST_TIME) | (decoded < -GREATEST_TIME)
    if far.any():
        row = int(np.argmax(far))
        raise _far_time(field, f"{decoded[row]} microseconds", row)
    return decoded


def _decode_timestamps(times: points_pb2.Times, field: str) -> Times:
    microseconds = []
    for row, each in enumerate(times.timestamps):
        microseconds.append(decode_timestamp(each, field, row))
    return np.array(microseconds, np.int64)


def decode_timestamp(time: Timestamp, field: str, row: int | None = None) -> int:
    """A time in microseconds since 1970, rounded down."""
    if not 0 <= time.nanos < NANOSECONDS_PER_SECOND:
        raise InvalidFieldError(field, f"{time.nanos} ns", "nanoseconds are from 0 to 999999999", row)
    microseconds: int = time.seconds * MICROSECONDS + time.nanos // NANOSECONDS
    if abs(microseconds) > GREATEST_TIME:
        raise _far_time(field, f"{time.seconds} seconds", row)
    return microseconds


def _far_time(field: str, value: str, row: int | None) -> InvalidFieldError:
    problem = f"a time is from {shown(-GREATEST_TIME)} to {shown(GREATEST_TIME)}"
    return InvalidFieldError(field, value, problem, row)
