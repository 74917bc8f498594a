"""What wrong guesses cost in Chan's algorithm: guesses squared each round against guesses doubled.

    python benchmarks/guesses.py [--points 1000000] [--vertices 100]

Counts the orientations and coordinate comparisons of each round, divided by the number of points. Counts do not depend
on the machine. The rounds with squared guesses are those of `dynhull.static.chan`; the doubled guesses run through the
same code. The estimate is that of the trace, n log2(guess).
"""

import argparse
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import log2
from pathlib import Path

from dynhull import static
from dynhull.static.trace import Round, Rounds

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from static_work import counted, points_with_vertices

chan_module = static.chan.__globals__


@dataclass(frozen=True)
class Cost:
    guess: int
    estimate: float  # a point
    steps: float  # a point
    closed: bool


class CountingRounds(Rounds):
    """Notes the steps counted up to the end of each round."""

    def __init__(self, counts: dict[str, int]) -> None:
        self._counts = counts
        self.totals: list[int] = []

    def append(self, event) -> None:
        super().append(event)
        self.totals.append(sum(self._counts.values()))


def squared(xy) -> Iterator[Cost]:
    with counted() as counts:
        trace = CountingRounds(counts)
        static.chan(xy, trace=trace)
    rounds = [event for event in trace if isinstance(event, Round)]
    for event, before, after in zip(rounds, [0, *trace.totals], trace.totals, strict=False):
        yield Cost(event.guess, event.cost / len(xy), (after - before) / len(xy), event.closed)


def doubled(xy) -> Iterator[Cost]:
    points = list(map(tuple, xy.tolist()))
    guess, closed = 2, False
    while not closed:
        with counted() as counts:
            groups = [chan_module["_chains"](points[i : i + guess]) for i in range(0, len(points), guess)]
            _, closed = chan_module["_wrap"](min(points), groups, guess, None)
        yield Cost(guess, log2(guess), sum(counts.values()) / len(points), closed)
        guess *= 2


def show(title: str, rounds: Iterable[Cost]) -> None:
    print(f"{title}\n{'guess':>8}{'estimate':>10}{'steps a point':>15}  outcome")
    estimate = steps = 0.0
    for cost in rounds:
        estimate, steps = estimate + cost.estimate, steps + cost.steps
        outcome = "closed" if cost.closed else "thrown away"
        print(f"{cost.guess:>8}{cost.estimate:>9.0f}n{cost.steps:>15.1f}  {outcome}", flush=True)
    print(f"{'all':>8}{estimate:>9.0f}n{steps:>15.1f}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description="What wrong guesses cost in Chan's algorithm.")
    parser.add_argument("--points", type=int, default=10**6, help="default 1,000,000")
    parser.add_argument("--vertices", type=int, default=100, help="default 100")
    options = parser.parse_args()
    xy = points_with_vertices(options.points, options.vertices)
    show("squared", squared(xy))
    show("doubled", doubled(xy))


if __name__ == "__main__":
    main()
