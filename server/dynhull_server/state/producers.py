"""Writers that number their batches, so that each batch is applied exactly once."""

from collections import Counter, OrderedDict
from collections.abc import Collection, Mapping
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

    A refused batch does not use its number: later batches of the producer are then a gap, and refused too. Where
    numbers may be skipped, any greater number is new. Such a producer is never dropped: without its last number, all
    batches of the log that it reads would be new again.

    Args:
        most: the limit on the number of producers.
        most_of_one: the limit on those of one caller.
        last: the last sequence number of each known producer.
        skipping: those whose numbers may be skipped.
        now: seconds on a monotonic clock.
    """

    def __init__(
        self, most: int, most_of_one: int, last: Mapping[str, int], skipping: Collection[str], now: float
    ) -> None:
        self._most = most
        self._most_of_one = most_of_one
        # The first has been idle for longest.
        self._counting = OrderedDict((name, _Producer(last[name], now, "")) for name in last if name not in skipping)
        self._skipping = {name: _Producer(last[name], now, "") for name in last if name in skipping}
        self._owned: Counter[str] = Counter()

    def state(self) -> dict[str, int]:
        """The last sequence number of each producer."""
        return {name: each.last for known in (self._counting, self._skipping) for name, each in known.items()}

    def skipping(self) -> frozenset[str]:
        """The producers whose numbers may be skipped."""
        return frozenset(self._skipping)

    def last(self, producer: str) -> int:
        """The last number applied, 0 for an unknown producer."""
        known = self._counting.get(producer) or self._skipping.get(producer)
        return 0 if known is None else known.last

    def is_new(
        self, producer: str, sequence: int, owner: str, now: float, *, may_skip: bool = False, after: int | None = None
    ) -> bool:
        """Whether the batch is the next one; False where it has already been applied.

        Args:
            producer: the name of the producer.
            sequence: the batch's number.
            owner: the caller that the producer belongs to.
            now: seconds on a monotonic clock.
            may_skip: whether numbers may be skipped.
            after: the number of the batch that must be the producer's last one; None for any.

        Raises:
            SequenceGapError: batches before it are missing and its number must not skip any, or the last one is not
                `after`.
            LimitExceededError: the hull has too many producers to add one.
        """
        last = self.last(producer)
        if sequence > last + 1 and not may_skip:
            raise SequenceGapError(producer, sequence, last + 1)
        if after not in (None, last) and sequence > last:
            words = f"batch {sequence} of producer {producer!r} follows {after}, but the last one applied is {last}"
            raise SequenceGapError(producer, sequence, last + 1, words)
        if last == 0:
            self._make_room(owner, now)
        return sequence > last

    def applied(self, producer: str, sequence: int, owner: str, now: float, *, may_skip: bool = False) -> None:
        """Record that the batch has been applied."""
        known = self._counting.get(producer) or self._skipping.get(producer)
        if known is None:
            known = self._counting[producer] = _Producer(sequence, now, owner)
            self._owned[owner] += 1
        known.last, known.used = sequence, now
        if producer in self._counting:
            if may_skip:
                self._skipping[producer] = self._counting.pop(producer)
            else:
                self._counting.move_to_end(producer)

    def forget_beyond(self, most: int) -> None:
        """Drop the producers that have been idle for longest, as far as there are more than that."""
        while self._counting and len(self._counting) + len(self._skipping) > most:
            _, oldest = self._counting.popitem(last=False)
            self._owned[oldest.owner] -= 1

    def _make_room(self, owner: str, now: float) -> None:
        """Drop idle producers where a limit leaves no room for another one."""
        if self._owned[owner] >= self._most_of_one:
            self._forget_idle(now)
            if self._owned[owner] >= self._most_of_one:
                raise LimitExceededError("max_producers_per_caller", self._most_of_one)
        if len(self._counting) + len(self._skipping) >= self._most:
            self._forget_idle(now)
            if len(self._counting) + len(self._skipping) >= self._most:
                raise LimitExceededError("max_producers", self._most)

    def _forget_idle(self, now: float) -> None:
        while self._counting:
            name, oldest = next(iter(self._counting.items()))
            if now - oldest.used < IDLE:
                return
            del self._counting[name]
            self._owned[oldest.owner] -= 1
