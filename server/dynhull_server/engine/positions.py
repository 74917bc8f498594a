"""How far those who follow many hulls are: an opaque position, by which they go on elsewhere, or after a restart."""

from collections.abc import Sequence
from struct import Struct
from typing import NamedTuple
from zlib import crc32

from ..state.records import INCARNATION, CommitStamp, HullRow

_STANDING = Struct(">IQQ")


class Standing(NamedTuple):
    """How far a partition is.

    Attributes:
        incarnation: differs for a partition that a backup has led back.
        number: of a commit: what it and all before it have changed is published.
        time: that of a later commit, or of this one, in microseconds since 1970.
    """

    incarnation: int
    number: int
    time: int

    def has(self, commit: CommitStamp | None) -> bool:
        """Whether a commit of the same incarnation is one of these.

        One of a partition that was made anew is not: it is later, whatever its number.
        """
        return commit is None or (commit.number <= self.number and commit.time <= self.time)

    def before(self, commit: CommitStamp | None) -> "Standing":
        """This one, or an earlier one that has nothing of a commit."""
        if commit is None:
            return self
        return self._replace(number=min(self.number, max(commit.number - 1, 0)), time=min(self.time, commit.time))


def incarnation_of(hulls: Sequence[HullRow]) -> str:
    """What the last copy of a storage has added to the uids of all hulls there were; "" for none."""
    return next((hull.uid.partition(INCARNATION)[2] for hull in hulls if INCARNATION in hull.uid), "")


def standing(incarnation: str, latest: CommitStamp) -> Standing:
    """How far a partition is while perhaps not all that its latest commit has changed is published."""
    return Standing(crc32(incarnation.encode()), max(latest.number - 1, 0), latest.time)


def encode_position(standings: Sequence[Standing]) -> bytes:
    """The position of these partitions, by their numbers: 20 bytes each."""
    return b"".join(_STANDING.pack(*each) for each in standings)


def decode_position(position: bytes) -> list[Standing]:
    """The standings in a position. Raises ValueError."""
    if len(position) % _STANDING.size:
        raise ValueError("not a position of this call")
    return [Standing(*each) for each in _STANDING.iter_unpack(position)]
