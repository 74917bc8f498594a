"""Which shard a point belongs to: by its key or, where it has none, by its coordinates."""

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys
from dynhull_server.state.records import Keys

# Points belong to slots, for ever, and slots to shards.
SLOTS = 1024

Hashes = npt.NDArray[np.uint64]
Shards = npt.NDArray[np.uint16]

# Odd, so that multiplication is invertible: the multipliers of SplitMix64's finalizer (Steele, Lea and Flood 2014).
FIRST, SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
BYTE_FACTOR = 0x9E3779B97F4A7C15  # the fraction of the golden ratio
LONGEST_KEY = 255
POWERS = np.array([pow(BYTE_FACTOR, each, 2**64) for each in range(1, LONGEST_KEY + 1)], np.uint64)


def point_hashes(points: Points) -> Hashes:
    """(k,) hashes of (k, 2) points."""
    bits = np.ascontiguousarray(points).view(np.uint64)
    return _mixed(_mixed(bits[:, 0]) + bits[:, 1])


def key_hashes(keys: Keys) -> Hashes:
    """(k,) hashes of k keys. O(k) and the length of the strings."""
    if not isinstance(keys, PackedKeys):
        return _mixed(keys)
    lengths = np.frombuffer(keys.lengths, np.uint8).astype(np.intp)
    if not len(lengths):
        return np.empty(0, np.uint64)
    starts = np.cumsum(lengths) - lengths
    places = np.arange(lengths.sum()) - np.repeat(starts, lengths)
    weighted = (np.frombuffer(keys.data, np.uint8).astype(np.uint64) + np.uint64(1)) * POWERS[places]
    return _mixed(np.add.reduceat(weighted, starts))


def shards_of(hashes: Hashes, count: int) -> Shards:
    """The shard of each hash: `count` shards have equal numbers of slots, or such that differ by one."""
    of_slot = (np.arange(SLOTS) * count // SLOTS).astype(np.uint16)
    shards: Shards = of_slot[hashes % np.uint64(SLOTS)]
    return shards


def _mixed(values: Hashes) -> Hashes:
    mixed = (values ^ (values >> np.uint64(30))) * FIRST
    mixed = (mixed ^ (mixed >> np.uint64(27))) * SECOND
    return mixed ^ (mixed >> np.uint64(31))
