"""The scheduler: actors that are ready take turns at random, each at its own speed."""

import random
import zlib
from collections.abc import Callable

# Turns after which a life that goes on without end is given up.
LONGEST = 20_000
# How often a slow actor comes, where the others come at most once, and at least a hundredth of that.
SLOWEST = 1e-3
# The actor that lets time pass.
TIME = b"time"


class Schedule:
    """Draws actors from a seed. A slow actor comes up to a hundred times less often than a fast one.

    Attributes:
        turns: how many turns there have been.
        trace: a hash of all turns and of what was noted in them.
        brisk: whether the event loop mostly carries out all that is ready in a turn, as asyncio does, and how the past
            is looked at in the end is drawn.
        slow: the name of an actor that is slower than all others: what it does is done for many at once.
        patient: whether time passes only when nothing else is left to do; else much may pass while a slow actor does
            little, and most turns are those of periodic work.
    """

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.turns = 0
        self.trace = 0
        self.brisk = False
        self.slow = ""
        self.patient = False
        self._actors: list[tuple[Callable[[], object], float, Callable[[], None], bytes]] = []

    def actor(self, name: str, ready: Callable[[], object], act: Callable[[], None]) -> None:
        """Add an actor, which takes a turn by `act` when it is `ready`."""
        speed = 10 ** self.random.uniform(-2, 0)
        self._actors.append((ready, SLOWEST if name == self.slow else speed, act, name.encode()))

    def clear(self) -> None:
        """Remove all actors."""
        self._actors = []

    def note(self, what: object) -> None:
        """Record a value that must be the same when the run is repeated."""
        self.trace = zlib.crc32(repr(what).encode(), self.trace)

    def turn(self) -> bool:
        """Let one actor act. Returns whether any was ready."""
        ready = [actor for actor in self._actors if actor[0]()]
        if not ready:
            return False
        if self.patient and len(ready) > 1:
            ready = [each for each in ready if each[3] != TIME]
        actor = ready[-1]
        if len(ready) > 1:
            drawn = self.random.random() * sum([each[1] for each in ready])
            for each in ready:
                drawn -= each[1]
                if drawn < 0:
                    actor = each
                    break
        self.turns += 1
        self.trace = zlib.crc32(actor[3], self.trace)
        actor[2]()
        return True

    def rest(self) -> None:
        """Let all act until none is ready."""
        bound = self.turns + LONGEST
        while self.turn():
            if self.turns > bound:
                raise RuntimeError("the server does not come to rest")
