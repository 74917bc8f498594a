"""Changes of side that are no events yet, because certainty, reports that agree or time are missing.

Beside these rules a fence decides sides as without them; its index knows the sides. A subject with a delay is reported
to be on the other one.
"""

from collections.abc import Iterator, Mapping
from itertools import islice

from sortedcontainers import SortedSet

from .config import FenceConfig
from .records import Delay, Key, Subject


class Delays:
    """The delays of one fence, as of the last request. Committed with the batches that begin and end them.

    Args:
        config: the settings of the fence.
        kept: the delays that the storage has. O(n log n).

    Attributes:
        balance: the number of subjects that are reported inside and are outside, less those of the opposite.
    """

    def __init__(self, config: FenceConfig, kept: Mapping[Subject, Delay] | None = None) -> None:
        self._config = config
        self._of: dict[str, dict[Key, Delay]] = {}
        # Those that wait for time only, by the time since when.
        self._ripening: SortedSet[tuple[int, str, Key]] = SortedSet()
        self.balance = 0
        for subject, delay in (kept or {}).items():
            self.set(subject, delay)

    def __len__(self) -> int:
        """The number of subjects."""
        return sum(map(len, self._of.values()))

    @property
    def first(self) -> int | None:
        """Since when the one waits that has waited longest, of those that wait for time only."""
        return self._ripening[0][0] if self._ripening else None

    def first_after(self, time: int) -> int | None:
        """As `first`, of those who wait since after a time."""
        return next((since for since, _, _ in self._ripening.irange((time + 1,))), None)

    @property
    def newest(self) -> int:
        """Since when the one waits that has waited shortest; 0 if none does. O(n)."""
        return max((delay.since for delays in self._of.values() for delay in delays.values()), default=0)

    def of(self, hull: str) -> Mapping[Key, Delay]:
        """The delays of the keys of a hull."""
        return self._of.get(hull, {})

    def set(self, subject: Subject, delay: Delay | None) -> None:
        """Put the delay of a subject in the place of the one before; None for none. O(log n)."""
        hull, key = subject
        delays = self._of.setdefault(hull, {})
        before = delays.pop(key, None)
        if before is not None:
            self._ripening.discard((before.since, hull, key))
            self.balance += 1 if before.enters else -1
        if delay is not None:
            delays[key] = delay
            self.balance += -1 if delay.enters else 1
            if self._config.min_dwell and self.confirmed(delay):
                self._ripening.add((delay.since, hull, key))
        elif not delays:
            del self._of[hull]

    def confirmed(self, delay: Delay) -> bool:
        """Whether the subject has reported often enough, and not only with positions in doubt."""
        return not delay.doubt and delay.reports >= self._config.confirmations

    def doubts(self, hull: str) -> list[Key]:
        """The keys of a hull no position of which on the other side was certain so far. O(delays)."""
        return [key for key, delay in self.of(hull).items() if delay.doubt]

    def ripe(self, delay: Delay, now: int) -> bool:
        """Whether nothing is missing any more."""
        return self.confirmed(delay) and now - delay.since >= self._config.min_dwell

    def due(self, now: int, most: int) -> list[Subject]:
        """At most that many subjects for which the time has come."""
        found: list[Subject] = []
        for since, hull, key in islice(self._ripening, most):
            if now - since < self._config.min_dwell:
                break
            found.append((hull, key))
        return found

    def all(self) -> Iterator[tuple[Subject, Delay]]:
        """The subjects by hull and key, with their delays. O(n log n)."""
        for hull, delays in sorted(self._of.items()):
            for key in sorted(delays):
                yield (hull, key), delays[key]
