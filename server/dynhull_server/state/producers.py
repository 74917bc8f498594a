"""Writers that number their batches, so that each batch is applied exactly once."""

from collections import Counter, OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass

from .errors import LimitExceededError, SequenceGapError

# A producer idle for this many seconds may be dropped to make room for another.
IDLE = 24 * 3600.0


@dataclass(slots=True)
class _Producer:
    last: int
    used: float
    owner: str


class Producers:
    """The last sequence number of each producer of one hull.

    A refused batch does not use its number: later batches of the producer are then a gap, and refused too.

    Args:
        most: the limit on the number of producers.
        most_of_one: the limit on those of one caller.
        last: the last sequence number of each known producer.
        now: seconds on a monotonic clock.
    """

    def __init__(self, most: int, most_of_one: int, last: Mapping[str, int], now: float) -> None:
        self._most = most
        self._most_of_one = most_of_one
        self._producers = OrderedDict((name, _Producer(number, now, "")) for name, number in last.items())
        self._owned: Counter[str] = Counter()

    def state(self) -> dict[str, int]:
        """The last sequence number of each producer."""
        return {name: each.last for name, each in self._producers.items()}

    def last(self, producer: str) -> int:
        """The last number applied, 0 for an unknown producer."""
        known = self._producers.get(producer)
        return 0 if known is None else known.last

    def is_new(self, producer: str, sequence: int, owner: str, now: float) -> bool:
        """Whether the batch is the next one; False where it has already been applied.

        Raises:
            SequenceGapError: batches before it are missing.
            LimitExceededError: the hull has too many producers to add one.
        """
        last = self.last(producer)
        if sequence > last + 1:
            raise SequenceGapError(producer, sequence, last + 1)
        if last == 0:
            self._make_room(owner, now)
        return sequence > last

    def applied(self, producer: str, sequence: int, owner: str, now: float) -> None:
        """Record that the batch has been applied."""
        known = self._producers.get(producer)
        if known is None:
            self._producers[producer] = _Producer(sequence, now, owner)
            self._owned[owner] += 1
            return
        known.last, known.used = sequence, now
        self._producers.move_to_end(producer)

    def _make_room(self, owner: str, now: float) -> None:
        """Drop idle producers where a limit leaves no room for another one."""
        if self._owned[owner] >= self._most_of_one:
            self._forget_idle(now)
            if self._owned[owner] >= self._most_of_one:
                raise LimitExceededError("max_producers_per_caller", self._most_of_one)
        if len(self._producers) >= self._most:
            self._forget_idle(now)
            if len(self._producers) >= self._most:
                raise LimitExceededError("max_producers", self._most)

    def _forget_idle(self, now: float) -> None:
        while self._producers:
            name, oldest = next(iter(self._producers.items()))
            if now - oldest.used < IDLE:
                return
            del self._producers[name]
            self._owned[oldest.owner] -= 1
