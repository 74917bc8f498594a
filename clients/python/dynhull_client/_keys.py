"""Keys as messages."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dynhull.keys import Keys, KeyType, PackedKeys, as_keys, key_list
from dynhull_proto.v1 import points_pb2

KeyTuple = tuple[str, ...] | tuple[int, ...]
"""Type of the keys of vertices."""


def checked_keys(keys: Any, name: str = "keys") -> Keys:
    """Keys as `PackedKeys` or uint64, whichever the first of them is.

    Raises:
        ValueError: a key is empty, too long, not UTF-8, negative or too large. The message names its row.
        TypeError: a key is neither a string nor an integer, or not of the same kind as the first.
    """
    if isinstance(keys, Iterable) and not hasattr(keys, "__len__"):
        keys = list(keys)
    return as_keys(keys, _key_type(keys, name), name)


def encode_keys(keys: Keys) -> points_pb2.Keys:
    """Checked keys in the form of a message."""
    if isinstance(keys, PackedKeys):
        return points_pb2.Keys(lengths=keys.lengths, text=keys.data)
    return points_pb2.Keys(packed_integers=np.asarray(keys, "<u8").tobytes())


def decode_keys(message: points_pb2.Keys) -> Keys:
    """Keys as received, packed, which is what the client requests. No keys are strings."""
    if message.packed_integers:
        return np.frombuffer(message.packed_integers, "<u8").astype(np.uint64, copy=False)
    return PackedKeys(message.lengths, message.text)


def decode_names(message: points_pb2.Keys) -> KeyTuple:
    """A few keys as received, as plain values."""
    return plain_keys(decode_keys(message))


def plain_keys(keys: Keys) -> KeyTuple:
    """Keys as strings or integers."""
    return tuple(key_list(keys))


def join_keys(parts: Sequence[Keys]) -> Keys:
    """All keys of the parts, which are of one kind."""
    packed = [part for part in parts if isinstance(part, PackedKeys)]
    if len(packed) < len(parts):
        return np.concatenate([part for part in parts if not isinstance(part, PackedKeys)])
    return PackedKeys(b"".join(part.lengths for part in packed), b"".join(part.data for part in packed))


def _key_type(keys: Any, name: str) -> KeyType:
    first = next(iter(keys), "") if isinstance(keys, Iterable) else ""
    first = first.as_py() if hasattr(first, "as_py") else first  # of pyarrow
    if isinstance(first, str):
        return "str"
    if isinstance(first, int | np.integer) and not isinstance(first, bool):
        return "int"
    raise TypeError(f"{name} row 0 is {first!r}: a key is a string or an integer")
