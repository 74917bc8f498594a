"""Which worker has which names.

A name belongs to one of 1,024 slots, by a hash of its first part, up to the first "/"; a worker, or a partition of a
database, has every n-th slot. So names with a common first part are on one worker, which fences, and batches over
several hulls, need.
"""

import zlib

SLOTS = 1024


def first_part(name: str) -> str:
    """The part of a name that decides where it belongs."""
    return name.partition("/")[0]


def slot_of(name: str) -> int:
    """The slot of a name. Part of the format of data folders: it must not change."""
    return zlib.crc32(first_part(name).encode()) % SLOTS


def worker_of(name: str, workers: int) -> int:
    """The number of the worker that has the hulls of this name, from 0 to less than the number of workers."""
    return slot_of(name) % workers


def worker_of_shard(name: str, shard: int, workers: int) -> int:
    """The number of the worker that has a shard of the hull of this name; neither must this change."""
    return (worker_of(name, workers) + shard) % workers
