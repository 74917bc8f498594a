"""A client that writes all the time, one batch after the other."""

import threading
import time

from pacing import pause
from patience import PATIENCE, wait_until

from dynhull_client import HullClient

BREATH = 0.005  # seconds between two batches, which leave the processor to others


class SteadyWriter(threading.Thread):
    """Writes numbered batches of one point until `stop`, each soon after the one before is acknowledged.

    Args:
        address: the address of a server.
        hull: the name of the hull.
        producer: the name of the writer, which numbers its batches from 1.

    Attributes:
        revisions: that of each batch, as acknowledged.
        waits: the seconds from the first attempt of each batch until it was acknowledged.
    """

    def __init__(self, address: str, hull: str, producer: str = "writer") -> None:
        super().__init__(daemon=True)
        self._address = address
        self._hull = hull
        self._producer = producer
        self._over = threading.Event()
        self._error: BaseException | None = None
        self.revisions: list[int] = []
        self.waits: list[float] = []

    @staticmethod
    def point(sequence: int) -> tuple[float, float]:
        """What the batch of a number inserts."""
        return 9.0, float(sequence)

    def run(self) -> None:
        """Write."""
        try:
            with HullClient(self._address, timeout=PATIENCE, retries=1000) as client:
                while not self._over.is_set():
                    sequence = len(self.revisions) + 1
                    begun = time.monotonic()
                    done = client.apply(
                        self._hull, insert=[self.point(sequence)], producer=self._producer, sequence=sequence
                    )
                    self.waits.append(time.monotonic() - begun)
                    self.revisions.append(done.revision)
                    pause(BREATH)
        except BaseException as error:
            self._error = error

    def more(self) -> None:
        """Wait until what is sent from now on is acknowledged."""
        count = len(self.revisions)
        wait_until(lambda: len(self.revisions) > count + 1 or self._error is not None)
        assert self._error is None, self._error

    def stop(self) -> None:
        """Write no more."""
        self._over.set()
        self.join()
        assert self._error is None, self._error

    def check(self, address: str, before: int = 0) -> None:
        """After `stop`: a server has each batch once; `before` is the revision before the first one."""
        count = len(self.revisions)
        assert self.revisions == list(range(before + 1, before + count + 1))
        with HullClient(address, retries=1000) as client:
            assert client.get_hull(self._hull).revision == before + count
            assert client.verify(self._hull).equal
            counts = client.count(self._hull, [self.point(sequence) for sequence in range(1, count + 2)]).counts
        assert counts.tolist() == [1] * count + [0]
