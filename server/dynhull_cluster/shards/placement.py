"""Which shard a point belongs to: by its key or, where it has none, by its coordinates."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys
from dynhull_server.state.records import Keys

# Points belong to slots, for ever, and slots to shards.
SLOTS = 1024


class ShardAddress(NamedTuple):
    """A shard: its number in a division of a hull. Each division has a generation that no other one of the hull has."""

    generation: int
    number: int


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
    shards: Shards = _of_slot(count)[slots_of(hashes)]
    return shards


def slots_of(hashes: Hashes) -> Shards:
    """The slot of each hash."""
    slots: Shards = (hashes % np.uint64(SLOTS)).astype(np.uint16)
    return slots


def _of_slot(count: int) -> Shards:
    of_slot: Shards = (np.arange(SLOTS) * count // SLOTS).astype(np.uint16)
    return of_slot


class Piece(NamedTuple):
    """Slots of one shard of a division that belong to one of another division: from `first` to before `end`."""

    source: int
    target: int
    first: int
    end: int


def pieces(before: int, after: int, most_slots: int) -> list[Piece]:
    """All slots, in pieces of at most `most_slots`, for a hull that goes from one number of shards to another."""
    sources, targets = _of_slot(before), _of_slot(after)
    ends = np.flatnonzero(np.diff(sources) | np.diff(targets)) + 1
    found: list[Piece] = []
    for first, end in pairwise([0, *ends.tolist(), SLOTS]):
        found.extend(
            Piece(int(sources[begin]), int(targets[begin]), begin, min(end, begin + most_slots))
            for begin in range(first, end, most_slots)
        )
    return found


def _mixed(values: Hashes) -> Hashes:
    mixed = (values ^ (values >> np.uint64(30))) * FIRST
    mixed = (mixed ^ (mixed >> np.uint64(27))) * SECOND
    return mixed ^ (mixed >> np.uint64(31))
