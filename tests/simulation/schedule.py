"""Who comes next: actors that are ready take turns at random, each at its own speed."""

import random
import zlib
from collections.abc import Callable

# Turns after which a life that goes on without end is given up.
LONGEST = 20_000


class Schedule:
    """Draws actors from a seed. A slow actor comes up to a hundred times less often than a fast one.

    Attributes:
        turns: how many turns there have been.
        trace: a hash of all turns and of what was noted in them.
    """

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.turns = 0
        self.trace = 0
        self._actors: list[tuple[str, float, Callable[[], object], Callable[[], None]]] = []

    def actor(self, name: str, ready: Callable[[], object], act: Callable[[], None]) -> None:
        """Add an actor, which takes a turn by `act` when it is `ready`."""
        self._actors.append((name, 10 ** self.random.uniform(-2, 0), ready, act))

    def clear(self) -> None:
        """All actors leave."""
        self._actors = []

    def note(self, what: object) -> None:
        """Something that has to be the same when the run is repeated."""
        self.trace = zlib.crc32(repr(what).encode(), self.trace)

    def turn(self) -> bool:
        """Let one actor act. Returns whether any was ready."""
        total = 0.0
        ready = []
        for actor in self._actors:
            if actor[2]():
                total += actor[1]
                ready.append((total, actor))
        if not ready:
            return False
        drawn = self.random.random() * total
        for bound, actor in ready:
            if drawn < bound:
                break
        self.turns += 1
        self.trace = zlib.crc32(actor[0].encode(), self.trace)
        actor[3]()
        return True

    def rest(self) -> None:
        """Let all act until none is ready."""
        bound = self.turns + LONGEST
        while self.turn():
            if self.turns > bound:
                raise RuntimeError("the server does not come to rest")
