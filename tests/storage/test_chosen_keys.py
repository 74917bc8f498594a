"""Who chooses the keys cannot make the tables of the past slow."""

import random
import time

import numpy as np
import pytest

from dynhull_server.compiled import native

KEYS = 10_000
WORD = 2**64 - 1
FACTOR = 0xC6A4A7935BD1E995  # of MurmurHash64A, with which GNU's library hashes text, always from the same seed
INVERSE = pow(FACTOR, -1, 2**64)


def keys_with_one_hash(state: int = 0x123456789ABCDEF1) -> list[bytes]:
    """Keys of 16 bytes after which that hash is in one state: each of its steps can be undone."""
    words, chosen = random.Random(1), []
    begin = 0xC70F6907 ^ (16 * FACTOR & WORD)
    for _ in range(KEYS):
        first = words.getrandbits(64)
        mixed = first * FACTOR & WORD
        mixed = (mixed ^ mixed >> 47) * FACTOR & WORD
        second = (state * INVERSE & WORD) ^ ((begin ^ mixed) * FACTOR & WORD)
        second = second * INVERSE & WORD
        second = (second ^ second >> 47) * INVERSE & WORD
        chosen.append(first.to_bytes(8, "little") + second.to_bytes(8, "little"))
    return chosen


@pytest.mark.skipif(native is None, reason="C++ is not built")
def test_keys_with_one_hash_elsewhere_cost_what_others_cost():
    """With the library's own hash they took 150 times as long, by the square of their number."""

    def spent(keys: list[bytes]) -> float:
        assert native is not None
        lengths, text = bytes([16]) * KEYS, b"".join(keys)
        began = time.thread_time()
        codes = native.key_codes(lengths, text)
        taken = time.thread_time() - began
        assert np.frombuffer(codes, np.int32).tolist() == list(range(KEYS))
        return taken

    usual = [random.Random(number).randbytes(16) for number in range(KEYS)]
    chosen = keys_with_one_hash()
    assert min(spent(chosen) for _ in range(3)) < 8 * min(spent(usual) for _ in range(3))
