"""Many batches of one caller to one hull, several of them in flight."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ..state.batch import Write
from ..state.events import Arrived, Gone
from ..state.hull import Hull
from ..state.requests import Request, Stream, WriteBatch

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

    def write(self, writes: Sequence[Write]) -> None:
        """Send batches that have arrived together."""
        stream = self._stream
        birth = self._driver.birth() if stream.hull is None else None
        requests = []
        for write in writes:
            requests.append(WriteBatch(self, write, birth, stream))
            self.rows += write.rows
        self.batches += len(requests)
        if len(requests) == 1:
            self._driver.dispatch(requests[0])
        elif requests:
            self._driver.dispatch(Arrived(requests))

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
