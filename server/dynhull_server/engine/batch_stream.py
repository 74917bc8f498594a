"""Many batches of one caller to one hull, several of them in flight."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ..state.batch import Batch, Write
from ..state.events import Arrived, Gone
from ..state.hull import Hull
from ..state.requests import Birth, Request, Stream, WriteBatch

if TYPE_CHECKING:
    from ..state.batch import Applied
    from .driver import Driver


class BatchStream:
    """Applies batches in the order they are written. A refused batch stops the stream: none after it is applied.

    `notify` is called after each batch that was applied or refused.

    Attributes:
        applied: the number and the result of each batch applied, in order; the caller removes them from the left.
        refusal: the error that refused a batch; None while there is none.
        batches: the number of batches in flight.
        rows: the number of points in them.
    """

    def __init__(self, driver: "Driver", name: str, hull: Hull | None, notify: Callable[[], None]) -> None:
        self.applied: deque[tuple[int, Applied]] = deque()
        self.refusal: Exception | None = None
        self.batches = 0
        self.rows = 0
        self._driver = driver
        self._stream = Stream(name, hull)
        self._notify = notify

    def apply_points(self, batch: Batch) -> bool:
        """Apply a small batch of points and nothing else, if that needs neither a request nor what one has."""
        applied = self._driver.at_once(self._driver.core.apply_points, self._stream, batch)
        if applied is None:
            return False
        self.applied.append((0, applied))
        self._notify()
        return True

    def write_one(self, write: Write) -> None:
        """Send a batch."""
        applied = self._driver.at_once(self._driver.core.write_at_once, self._stream, write)
        if applied is not None:
            self.applied.append((write.sequence, applied))
            self._notify()
            return
        self.batches += 1
        self.rows += write.rows
        self._driver.dispatch(WriteBatch(self, write, self._birth(), self._stream))

    def write(self, writes: Sequence[Write]) -> None:
        """Send batches that have arrived together."""
        if len(writes) == 1:
            self.write_one(writes[0])
            return
        birth = self._birth()
        requests = [WriteBatch(self, write, birth, self._stream) for write in writes]
        self.batches += len(requests)
        self.rows += sum([write.rows for write in writes])
        if requests:
            self._driver.dispatch(Arrived(requests))

    def _birth(self) -> Birth | None:
        """The origin of the hull, if the stream may create it; None once it has written to one."""
        return self._driver.birth() if self._stream.hull is None else None

    def answer(self, request: Request) -> None:
        """Take the answer to a batch."""
        assert type(request) is WriteBatch  # the stream sends no other requests
        self.batches -= 1
        self.rows -= request.rows
        if request.error is None:
            self.applied.append((request.write.sequence, request.result))
        else:
            self.refusal = request.error
        self._notify()

    def close(self) -> None:
        """Stop the stream: batches that have not begun are not applied."""
        self._driver.dispatch(Gone(self._stream))
