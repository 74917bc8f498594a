"""All hulls of a server, by name."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from sortedcontainers import SortedDict

from .errors import HullExistsError, HullNotFoundError, LimitExceededError
from .limits import Limits
from .live_hull import Config, LiveHull


class Engine:
    """Named hulls, in memory."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._hulls: SortedDict[str, LiveHull] = SortedDict()
        self._pool = ThreadPoolExecutor(thread_name_prefix="hull")

    def __len__(self) -> int:
        return len(self._hulls)

    def __iter__(self) -> Iterator[LiveHull]:
        return iter(list(self._hulls.values()))

    def create(self, name: str, config: Config) -> LiveHull:
        """Make an empty hull, or raise HullExistsError or LimitExceededError."""
        if name in self._hulls:
            raise HullExistsError(name)
        if len(self._hulls) >= self._limits.max_hulls:
            raise LimitExceededError("max_hulls", self._limits.max_hulls)
        hull = self._hulls[name] = LiveHull(name, config, self._pool, self._limits)
        return hull

    def get(self, name: str) -> LiveHull:
        """The hull of that name, or raise HullNotFoundError."""
        hull: LiveHull | None = self._hulls.get(name)
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    def has(self, name: str) -> bool:
        """Whether there is a hull of that name."""
        return name in self._hulls

    def delete(self, name: str) -> None:
        """Remove the hull of that name, or raise HullNotFoundError."""
        self.get(name).delete()
        del self._hulls[name]

    def discard_unwritten(self, hull: LiveHull) -> None:
        """Remove a hull that nothing has been written to."""
        if hull.counts.revision == 0 and self._hulls.get(hull.name) is hull:
            self.delete(hull.name)

    def page(self, prefixes: Sequence[str], after: str, size: int) -> tuple[list[LiveHull], bool]:
        """At most `size` hulls whose names follow `after`, and whether there are more.

        The names begin with one of the prefixes, which are sorted and none of which begins with another.
        """
        hulls: list[LiveHull] = []
        for prefix in prefixes:
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
