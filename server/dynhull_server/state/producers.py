"""Writers that number their batches, so that each batch is applied exactly once."""

import time
from collections import OrderedDict
from collections.abc import Mapping

from .errors import LimitExceededError, SequenceGapError

# A producer idle for so many seconds is forgotten where another one needs the room.
IDLE = 24 * 3600.0


class Producers:
    """The last sequence number of each producer of one hull.

    A refused batch does not use up its number: whatever the producer had sent after it is a gap, and so refused too.

    Args:
        most: how many producers there may be.
        last: the last sequence number of each that is known already.
    """

    def __init__(self, most: int, last: Mapping[str, int] | None = None) -> None:
        self._most = most
        now = time.monotonic()
        self._last = OrderedDict((producer, (sequence, now)) for producer, sequence in (last or {}).items())

    def state(self) -> dict[str, int]:
        """The last sequence number of each producer."""
        return {producer: sequence for producer, (sequence, _) in self._last.items()}

    def last(self, producer: str) -> int:
        """The last number applied, 0 for a producer that is not known."""
        return self._last.get(producer, (0, 0.0))[0]

    def is_new(self, producer: str, sequence: int) -> bool:
        """Whether the batch is the next one, False where it has been applied before.

        Raises:
            SequenceGapError: there are batches missing before it.
            LimitExceededError: there is no room for another producer.
        """
        last = self.last(producer)
        if sequence > last + 1:
            raise SequenceGapError(producer, sequence, last + 1)
        if last == 0 and len(self._last) >= self._most:
            oldest, (_, used) = next(iter(self._last.items()))
            if time.monotonic() - used < IDLE:
                raise LimitExceededError("max_producers", self._most)
            del self._last[oldest]
        return sequence > last

    def applied(self, producer: str, sequence: int) -> None:
        """Remember that the batch has been applied."""
        self._last[producer] = sequence, time.monotonic()
        self._last.move_to_end(producer)
