"""Many batches of one caller to one hull, with more than one under way."""

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..state.events import Birth, Gone, Request, Stream, WriteBatch
from ..state.hull import Hull

if TYPE_CHECKING:
    from ..state.batch import Applied
    from .engine import Engine


class BatchStream:
    """Batches are applied in the order they are written; a refused one stops the stream, and none after it is applied.

    `notify` is called when a batch has been applied or refused.

    Attributes:
        applied: the numbers of the batches applied and what they did, in their order; to be taken from the left.
        refusal: what refused a batch; None as long as nothing has.
        batches: batches under way.
        rows: points in them.
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

    @property
    def hull(self) -> Hull | None:
        """The hull, once it is there."""
        return self._stream.hull

    def write(self, request: WriteBatch) -> None:
        """Send a batch on its way."""
        self.batches += 1
        self.rows += request.rows
        stream = request.stream = self._stream
        request.to, request.name = self, stream.name
        if stream.hull is None:
            request.birth = self._birth()
        self._engine.dispatch(request)

    def tell(self, request: Request) -> None:
        """A batch has been applied or refused."""
        assert type(request) is WriteBatch  # nothing else is asked for
        self.batches -= 1
        self.rows -= request.rows
        if request.error is None:
            self.applied.append((request.sequence, request.result))
        else:
            self.refusal = request.error
        self._notify()

    def close(self) -> None:
        """The caller has gone, or wants no more: batches that have not begun are not applied."""
        self._engine.dispatch(Gone(self._stream))
