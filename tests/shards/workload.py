"""Random batches of all kinds, for hulls of all kinds, many of which must be refused."""

import random
from dataclasses import replace

import numpy as np

from dynhull.keys import PackedKeys
from dynhull_server.state.batch import Applied, Batch, KeyedBatch, Write
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import HullSettings, Window

SECOND = 1_000_000
START = 10**9 * SECOND
LIMITS = Limits(max_hulls=10, max_points=60, max_producers=4, max_producers_per_caller=9, resume_bytes=2**16)
KINDS = {
    "points": HullSettings(),
    "strings": HullSettings("str"),
    "integers by event time": HullSettings("int", by_event_time=True),
    "window by server clock": HullSettings(window=Window(max_age=3 * SECOND)),
    "window by event time": HullSettings(
        window=Window(max_age=3 * SECOND, clock="data", max_skew=2 * SECOND, clamps=True)
    ),
    "keyed window": HullSettings("int", window=Window(max_age=3 * SECOND, clock="data")),
}


def same_effect(told: Applied, expected: Applied, before: np.ndarray, after: np.ndarray) -> bool:
    """Whether a hull over shards reports what one hull does.

    One hull removes first and puts then, and reports a change of the vertices also where the last one undoes it.
    """
    undone = expected.expired > 0 or np.array_equal(before, after)
    return told == expected or (undone and told == replace(expected, hull_changed=False))


class Workload:
    """Draws one batch after the other. Few places and keys, so that copies, ties and refusals are common."""

    def __init__(self, settings: HullSettings, seed: int) -> None:
        self._settings = settings
        self._random = random.Random(seed)
        self.time = START
        self._sequences: dict[str, int] = {}
        self._inserted: list[tuple[float, float]] = []

    def batch(self) -> Write:
        draw = self._random
        self.time += draw.choice((0, 1000, 200_000, SECOND))
        content = self._points() if self._settings.identity == "multiset" else self._keys()
        producer, sequence = "", 0
        if draw.random() < 0.5:
            producer = draw.choice("abcde")
            sequence = max(1, self._sequences.get(producer, 0) + draw.choice((1, 1, 1, 1, 0, 2)))
        return Write("hull", content, self.time, 1, producer, sequence, "somebody")

    def applied(self, write: Write) -> None:
        if write.producer:
            self._sequences[write.producer] = max(write.sequence, self._sequences.get(write.producer, 0))

    def _places(self, count: int) -> np.ndarray:
        draw = self._random
        span = draw.choice((2, 4, 9))
        return np.array([(draw.randint(-span, span), draw.randint(-span, span)) for _ in range(count)], float).reshape(
            -1, 2
        )

    def _times(self, count: int) -> np.ndarray:
        draw = self._random
        return np.array([self.time + draw.randint(-4 * SECOND, 3 * SECOND) for _ in range(count)], np.int64)

    def _points(self) -> Batch:
        draw, window = self._random, self._settings.window
        timed = window is not None and (window.clock == "data" or draw.random() < 0.5)
        inserts, deletes = draw.choice((0, 1, 3, 12)), draw.choice((0, 0, 1, 3))
        moves = 0 if window is not None and window.clock == "data" else draw.choice((0, 0, 0, min(inserts, deletes)))
        times = self._times(inserts - moves) if timed else None
        entering, leaving = self._places(inserts), self._places(deletes)
        for row in range(deletes):  # mostly of points that may be there
            if self._inserted and draw.random() < 0.9:
                leaving[row] = draw.choice(self._inserted)
        self._inserted = [*self._inserted[-20:], *map(tuple, entering.tolist())]
        return Batch(entering, leaving, moves, draw.random() < 0.5, times)

    def _keys(self) -> KeyedBatch:
        draw = self._random
        kind = "str" if self._settings.identity == "str" else "int"
        names = draw.sample(range(90), draw.choice((0, 1, 4, 14)))
        if names and draw.random() < 0.1:
            names.append(draw.choice(names))
        cut = draw.randint(0, len(names)) if draw.random() < 0.5 else len(names)
        puts, removes = names[:cut], names[cut:]
        timed = self._settings.by_event_time or self._settings.window is not None or draw.random() < 0.2
        ttl = draw.choice((None, None, None, SECOND)) if self._settings.window is None else None
        return KeyedBatch(
            kind,
            self._packed(puts),
            self._places(len(puts)),
            self._packed(removes),
            self._times(len(puts)) if timed else None,
            draw.choice((None, None, None, "absent", "present")),
            ttl,
            None,
            draw.random() < 0.5,
        )

    def _packed(self, names: list[int]) -> PackedKeys | np.ndarray:
        if self._settings.identity == "str":
            return PackedKeys.pack([f"vehicle {name}" for name in names])
        return np.array(names, np.uint64)
