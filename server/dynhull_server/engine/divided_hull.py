"""A hull over shards as its callers use it: what needs all points, its shards answer."""

import asyncio

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Checked, Points

from ..state.errors import HullUnsuitableError
from ..state.hull import Hull
from ..state.hull_state import Counts
from ..state.records import QuarantineRules
from .division import DividedReads
from .driver import Driver
from .fences import Fences
from .layers import Layers, Peeling
from .live_hull import LiveHull
from .recalls import Recalls
from .verification import Verification

NO_LAYERS = "is divided among shards, and only its outermost layer is known"


class NoLayers(Peeling):
    """The layers of a hull over shards: its root has the vertices alone."""

    async def layers(self, count: int, min_revision: int = 0) -> Layers:
        """Raise HullUnsuitableError."""
        del count, min_revision
        raise HullUnsuitableError(self._hull.name, NO_LAYERS, field="layer")

    async def influence(self, min_revision: int = 0) -> tuple[Counts, Points, npt.NDArray[np.float64], None]:
        """Raise HullUnsuitableError."""
        del min_revision
        raise HullUnsuitableError(self._hull.name, "is divided among shards, and what lies below a vertex is not known")


class DividedHull(LiveHull):
    """A hull whose points are divided among shards.

    Attributes:
        division: the shards.
    """

    def __init__(
        self,
        driver: Driver,
        hull: Hull,
        recalls: Recalls,
        fences: Fences,
        copies: asyncio.Semaphore,
        division: DividedReads,
    ) -> None:
        super().__init__(driver, hull, recalls, fences, copies)
        self.division = division
        self._peeling = NoLayers(self, driver.aside, copies)

    @property
    def size(self) -> int:
        """The number of vertices of all shards, which a snapshot has."""
        return len(self._hull.state.hull)

    async def count(self, xy: Checked, min_revision: int = 0) -> tuple[Counts, npt.NDArray[np.int64]]:
        """The multiplicity of each of some points."""
        await self.reached(min_revision)
        return await self.division.count(xy.points)

    async def sample(self, size: int, min_revision: int = 0) -> tuple[Counts, Points]:
        """A sample of at most `size` of the points. Writes continue meanwhile."""
        await self.reached(min_revision)
        return await self.division.sample(size)

    async def verify(
        self, min_revision: int = 0, prefixes: tuple[str, ...] = ("",), *, events: bool = True
    ) -> tuple[Counts, Verification]:
        """Compare the hull with Chan's algorithm on the points of all shards. It has no fences."""
        del prefixes, events
        await self.reached(min_revision)
        return await self.division.verify()

    async def reshard(self, shards: int) -> Counts:
        """Divide the points among another number of shards."""
        return await self.division.reshard(shards)

    async def set_quarantine(self, rules: QuarantineRules) -> Counts:
        """Raise HullUnsuitableError."""
        del rules
        raise HullUnsuitableError(self.name, "is divided among shards, so it has no quarantine", field="quarantine")
