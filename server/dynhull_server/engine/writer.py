"""Many batches of one caller to one hull, with more than one under way."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from ..state.batch import Applied, Batch
from ..state.errors import RefusedError
from .serial import SerialExecutor

# Work on at most so many points, about, is done at once, on the event loop: a tenth of a millisecond.
SMALL = 128


@dataclass(slots=True)
class Write:
    """A batch to come, of about `rows` points: `make` decodes it, off the event loop where it is large.

    Without a `producer` it is not numbered.
    """

    make: Callable[[], Batch]
    rows: int
    producer: str = ""
    sequence: int = 0


class StoppedError(RefusedError):
    """A batch came after one that was refused."""


class Writer:
    """Batches are applied in the order they are written; a refused one stops it, and none after it is applied.

    `notify` is called when a batch has been applied or refused.

    Attributes:
        applied: what the batches did, in their order; to be taken from the left.
        refusal: what refused a batch; None as long as nothing has.
        batches: batches under way.
        rows: points in them.
    """

    def __init__(self, apply: Callable[[Write], Applied], serial: SerialExecutor, notify: Callable[[], None]) -> None:
        self.applied: deque[Applied] = deque()
        self.refusal: Exception | None = None
        self.batches = 0
        self.rows = 0
        self._apply = apply
        self._serial = serial
        self._notify = notify
        self._stopped = False

    def write(self, write: Write) -> None:
        """Send a batch on its way."""
        self.batches += 1
        self.rows += write.rows

        def apply() -> Applied:
            if self._stopped:
                raise StoppedError
            try:
                return self._apply(write)
            except Exception:
                self._stopped = True
                raise

        def done(applied: Applied, error: Exception | None) -> None:
            self.batches -= 1
            self.rows -= write.rows
            if error is None:
                self.applied.append(applied)
            elif self.refusal is None:
                self.refusal = error
            self._notify()

        self._serial.submit(apply, done, small=write.rows <= SMALL, writes=True)
