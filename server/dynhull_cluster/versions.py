"""Which servers of a cluster understand each other: those that speak a version of their protocol in common.

The protocol is all that servers say to each other: frames, letters of roots and shards, and the tables that each reads.
A server says which versions it speaks in its row of the tables and when it connects, as JSON, of which others pass over
what they do not know. So one server after the other can be replaced by one of a later version, and those that have no
version in common say so.
"""

import json
from functools import cache
from typing import NamedTuple, Self

import dynhull

# The oldest and the newest version of the protocol that this program speaks.
OLDEST, NEWEST = 1, 1


class Versions(NamedTuple):
    """What a server says of itself: its program, and the oldest and the newest version of the protocol it speaks."""

    program: str
    oldest: int
    newest: int

    @classmethod
    def of(cls, text: str) -> Self:
        """Those of what `text` has made."""
        said = json.loads(text)
        return cls(str(said["program"]), int(said["oldest"]), int(said["newest"]))

    @property
    def text(self) -> str:
        """They as text, for others."""
        return json.dumps(self._asdict())

    def meet(self, other: Self) -> bool:
        """Whether some version is in both."""
        return self.oldest <= other.newest and other.oldest <= self.newest

    def __str__(self) -> str:
        spoken = str(self.newest) if self.oldest == self.newest else f"{self.oldest} to {self.newest}"
        return f"{self.program} (protocol {spoken})"


# Of servers that do not say them: those that call each other as this one does, and those before.
UNSAID = Versions("an earlier dynhull", 1, 1)
EARLIER = Versions("an earlier dynhull", 0, 0)


@cache
def own_versions() -> Versions:
    """Those of this program."""
    return Versions(f"dynhull {dynhull.__version__}", OLDEST, NEWEST)


def apart(worker: str, versions: Versions) -> str:
    """Why a worker and this program cannot serve together, and what to do."""
    return (
        f"worker {worker} is of {versions} and this program of {own_versions()}, which do not call each other: stop "
        "all servers of the cluster, then start those of one version"
    )
