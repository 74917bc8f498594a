"""What processes send each other about hulls over shards: messages of roots and shards, with an address."""

from dataclasses import dataclass
from typing import Any

from dynhull_server.state.records import HullSettings


@dataclass(frozen=True, slots=True)
class Greeting:
    """A root looks for one of its shards, which is created if there is none. The reply is Greeted.

    Attributes:
        name: the name of the hull.
        uid: distinguishes it from others of its name.
        created: seconds since 1970.
        settings: those of the shard.
    """

    name: str
    uid: str
    created: float
    settings: HullSettings


@dataclass(frozen=True, slots=True)
class Greeted:
    """The shard is there, and knows of the epochs up to this one."""

    epoch: int


@dataclass(frozen=True, slots=True)
class Letter:
    """A message of a root to a shard of a generation. The reply is Answer."""

    uid: str
    generation: int
    shard: int
    message: Any


@dataclass(frozen=True, slots=True)
class Answer:
    """The reply of a shard; None where the message came too late."""

    reply: Any


@dataclass(frozen=True, slots=True)
class Wanted:
    """A worker asks the one that has the root whether the shards of a generation are needed. The reply is IsWanted."""

    name: str
    uid: str
    generation: int


@dataclass(frozen=True, slots=True)
class IsWanted:
    """Whether the hull is there, and may be divided among these shards."""

    wanted: bool
