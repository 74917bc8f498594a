"""Many batches of one caller to one hull, several of them in flight."""

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..state.events import Birth, Gone, Request, Stream, WriteBatch
from ..state.hull import Hull

if TYPE_CHECKING:
    from ..state.batch import Applied
    from .engine import Engine


class BatchStream:
    """Applies batches in the order they are written. A refused batch stops the stream: none after it is applied.

    `notify` is called after each batch that was applied or refused.

    Attributes:
        applied: the number and the result of each batch applied, in order; the caller removes them from the left.
        refusal: the error that refused a batch; None while there is none.
        batches: the number of batches in flight.
        rows: the number of points in them.
    """

    def __init__(
        self, engine: "Engine", name: str, hull: Hull | None, notify: Callable[[], None], birth: Callable[[], Birth]
    ) -> None:
        self.applied: deque[tuple[int, Applied]] = deque()
        self.refusal: Exception | None = None
        self.batches = 0
        self.rows = 0
        self._engine = engine
        self._stream = Stream(name, hull)
        self._birth = birth
        self._notify = notify

    def write(self, request: WriteBatch) -> None:
        """Send a batch."""
        self.batches += 1
        self.rows += request.rows
        stream = request.stream = self._stream
        request.to, request.name = self, stream.name
        if stream.hull is None:
            request.birth = self._birth()
        if stream.hull is None or stream.hull.timed:
            request.arrived = self._engine.time()
        self._engine.dispatch(request)

    def answer(self, request: Request) -> None:
        """Take the answer to a batch."""
        assert type(request) is WriteBatch  # the stream sends no other requests
        self.batches -= 1
        self.rows -= request.rows
        if request.error is None:
            self.applied.append((request.sequence, request.result))
        else:
            self.refusal = request.error
        self._notify()

    def close(self) -> None:
        """Stop the stream: batches that have not begun are not applied."""
        self._engine.dispatch(Gone(self._stream))
