"""Windows on random inputs, with allocations that fail: a short run of fuzz_window.cpp."""


def test_random_lives(fuzz):
    fuzz("fuzz_window.cpp", runs=[["--seconds", "1"]])
