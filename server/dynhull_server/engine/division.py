"""The port to hulls over shards: what the engine asks of whatever runs their roots and shards."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from ..state.contents.keyed import Found
from ..state.hull import Hull
from ..state.hull_state import Counts
from ..state.records import Contents, HullRow, HullSettings, Kept, Keys
from ..state.requests import Expire, WriteBatch

if TYPE_CHECKING:
    from .driver import Driver
    from .shard_store import ShardStore
    from .verification import Verification


class DividedReads(Protocol):
    """The shards of one hull, as its root asks them. What is read is of one revision, that of the counts.

    Every method may raise ShardAwayError, where a shard does not answer; then nothing has changed.
    """

    async def count(self, points: Points) -> tuple[Counts, npt.NDArray[np.int64]]:
        """The multiplicity of each of (k, 2) points."""

    async def sample(self, size: int) -> tuple[Counts, Points]:
        """A sample of at most `size` of all points."""

    async def find(self, keys: Keys) -> tuple[Counts, Found, Points]:
        """The positions of keys, and the vertices of the hull."""

    async def contents(self) -> tuple[Counts, Contents]:
        """All points, in the order of their keys if they have any."""

    async def reshard(self, shards: int) -> Counts:
        """Divide the points among another number of shards. Returns the counts after it."""

    async def verify(self) -> "tuple[Counts, Verification]":
        """Compare the hull with Chan's algorithm on the points of all shards."""


class StoredShard(Protocol):
    """A shard in this process, whose log needs a snapshot from time to time.

    Attributes:
        number: its number in the storage.
        points: the number of its points.
        unsaved: the number of points in steps since the last snapshot.
    """

    number: int
    points: int
    unsaved: int

    def take(self) -> tuple[Kept, int] | None:
        """What is decided of it, and the number of points in steps so far that are not in a snapshot.

        None if that is not certain so far: then it is at hand later, once its root has said so.
        """

    def saved(self, points: int) -> None:
        """Record a snapshot, which includes steps with this number of points."""


class Divisions(Protocol):
    """All hulls over shards whose roots or shards are in this process."""

    def why_not(self, settings: HullSettings) -> tuple[str, str] | None:
        """The field for which no hull with these settings can be divided, and the reason; None if it can be."""

    async def start(
        self, driver: "Driver", store: "ShardStore", shards: Sequence[HullRow], roots: Sequence[Hull]
    ) -> None:
        """Begin, with the shards and the roots that the storage has."""

    def begin(self, hull: Hull) -> None:
        """Begin with the root of a new hull."""

    def end(self, hull: Hull) -> None:
        """The hull is deleted: end its root, and have its shards deleted."""

    def carry_out(self, hull: Hull, requests: Sequence[WriteBatch | Expire]) -> None:
        """Carry out requests in this order, and answer them."""

    def of(self, hull: Hull) -> DividedReads:
        """The shards of a hull."""

    def shards(self) -> Sequence[StoredShard]:
        """The shards in this process."""

    async def close(self) -> None:
        """Refuse what waits, and stop."""
