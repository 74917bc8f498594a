"""The deadlines of keys, compared with a dictionary."""

import random

from dynhull_server.state.contents.deadlines import MOST_SPARE_ROWS, Deadlines
from dynhull_server.state.records import FOREVER

KEYS = range(300)


def test_deadlines_come_change_and_pass() -> None:
    choose = random.Random(1)
    deadlines, model = Deadlines(), dict[int | str, int]()
    for now in range(2000):
        keys = choose.sample(KEYS, choose.randrange(6))
        match choose.randrange(4):
            case 0:
                deadlines.drop(keys)
                for key in keys:
                    model.pop(key, None)
            case 1:
                ended = [key for key, deadline in model.items() if deadline <= now]
                assert sorted(deadlines.pop_until(now)) == sorted(ended)
                for key in ended:
                    del model[key]
            case _:
                times = [choose.choice([FOREVER, now + choose.randrange(50), 10**9]) for _ in keys]
                deadlines.set(keys, times)
                model.update(zip(keys, times, strict=True))
                model = {key: deadline for key, deadline in model.items() if deadline != FOREVER}
        assert sorted(deadlines.keys()) == sorted(model)
        assert deadlines.first == min(model.values(), default=None)
        assert deadlines.of(KEYS).tolist() == [model.get(key, FOREVER) for key in KEYS]


def test_deadlines_that_are_renewed_do_not_fill_memory() -> None:
    deadlines = Deadlines()
    for now in range(10 * MOST_SPARE_ROWS):
        deadlines.set(["a", "b"], [now + 10**9, 10**12 - now])
    rows = sum(len(group.keys) for group in deadlines._groups.values())
    assert rows <= 2 * len(deadlines) + MOST_SPARE_ROWS
