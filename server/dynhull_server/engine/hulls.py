"""All hulls of a server, by name."""

from concurrent.futures import ThreadPoolExecutor

from sortedcontainers import SortedDict

from .errors import HullExistsError, HullNotFoundError, LimitExceededError
from .live_hull import LiveHull


class Engine:
    """Named hulls, in memory.

    Args:
        max_hulls: how many there may be at a time.
    """

    def __init__(self, max_hulls: int) -> None:
        self._max_hulls = max_hulls
        self._hulls: SortedDict[str, LiveHull] = SortedDict()
        self._pool = ThreadPoolExecutor(thread_name_prefix="hull")

    def create(self, name: str) -> LiveHull:
        """Make an empty hull, or raise HullExistsError or LimitExceededError."""
        if name in self._hulls:
            raise HullExistsError(name)
        if len(self._hulls) >= self._max_hulls:
            raise LimitExceededError("max_hulls", self._max_hulls)
        hull = self._hulls[name] = LiveHull(name, self._pool)
        return hull

    def get(self, name: str) -> LiveHull:
        """The hull of that name, or raise HullNotFoundError."""
        hull: LiveHull | None = self._hulls.get(name)
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    def delete(self, name: str) -> None:
        """Remove the hull of that name, or raise HullNotFoundError."""
        self.get(name).delete()
        del self._hulls[name]

    def page(self, prefix: str, after: str, size: int) -> tuple[list[LiveHull], bool]:
        """At most `size` hulls whose names begin with `prefix` and follow `after`, and whether there are more."""
        hulls: list[LiveHull] = []
        for name in self._hulls.irange(minimum=max(prefix, after)):
            if not name.startswith(prefix):
                break
            if name == after:
                continue
            if len(hulls) == size:
                return hulls, True
            hulls.append(self._hulls[name])
        return hulls, False

    def close(self) -> None:
        """Wait for the work under way."""
        self._pool.shutdown()
