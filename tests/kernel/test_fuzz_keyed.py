"""A short run of the fuzzer of entities."""


def test_fuzz_keyed(fuzz):
    fuzz("fuzz_keyed.cpp", "-DDYNHULL_HASH_SEED=1", runs=[map(str, range(20)), ["--seconds", "1"]])
