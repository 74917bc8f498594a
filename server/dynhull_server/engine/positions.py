"""How far those who follow many hulls are: an opaque position, by which they go on elsewhere, or after a restart."""

from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct
from typing import NamedTuple
from zlib import crc32

from ..state.records import FOREVER, INCARNATION, CommitStamp, HullRow

# The most bytes of a position.
MOST_BYTES = 1000
_STANDING, _INCARNATION = Struct(">IQQ"), Struct(">I")
# A position of many partitions: their number, their incarnations together, and the newest time; then ages before that.
_COARSE = Struct(">HIQ")
_COARSE_BYTES = MOST_BYTES - 1  # tells it apart: no multiple of the size of a standing
_AGES_BYTES = _COARSE_BYTES - _COARSE.size
_SHIFT_BITS = 6
_NONE_OF_OURS = "not a position of this call"


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


# Before all commits, of any data.
BEGINNING = Standing(0, 0, 0)


def incarnation_of(hulls: Sequence[HullRow]) -> str:
    """What the last copy of a storage has added to the uids of all hulls there were; "" for none."""
    return next((hull.uid.partition(INCARNATION)[2] for hull in hulls if INCARNATION in hull.uid), "")


def standing(incarnation: str, latest: CommitStamp) -> Standing:
    """How far a partition is while perhaps not all that its latest commit has changed is published."""
    return Standing(crc32(incarnation.encode()), max(latest.number - 1, 0), latest.time)


@dataclass(frozen=True, slots=True)
class Position:
    """What somebody has who was sent all up to there.

    Attributes:
        incarnations: those of all partitions, together.
        standings: how far each partition was, or less than that.
        numbered: whether they have numbers; otherwise times say all.
    """

    incarnations: int
    standings: Sequence[Standing]
    numbered: bool = True

    def precedes(self, standings: Sequence[Standing]) -> bool:
        """Whether what is there now follows what there was then."""
        return (
            len(self.standings) == len(standings)
            and self.incarnations == _together(standings)
            and not (
                self.numbered
                and any(before.number > now.number for before, now in zip(self.standings, standings, strict=True))
            )
        )


# Of something else, which nothing follows.
NOWHERE = Position(0, ())


def encode_position(standings: Sequence[Standing]) -> bytes:
    """The position of these partitions, by their numbers.

    Twenty bytes each. Of more than fifty partitions that would be too much: then times alone, as exactly as there is
    room for them, and never later than they are: who goes on from there is sent some states again.
    """
    if len(standings) * _STANDING.size <= MOST_BYTES:
        return encode_standings(standings)
    newest = max(each.time for each in standings)
    bits, ages = _bits(len(standings)), 0
    for each in reversed(standings):
        ages = ages << bits | _rounded_up(newest - each.time + 1, bits)  # of the commit at that time some may lack
    return _COARSE.pack(len(standings), _together(standings), newest) + ages.to_bytes(_AGES_BYTES, "little")


def decode_position(position: bytes) -> Position:
    """The position. Raises ValueError."""
    if len(position) == _COARSE_BYTES:
        return _decode_coarse(position)
    standings = decode_standings(position)
    return Position(_together(standings), standings)


def encode_standings(standings: Sequence[Standing]) -> bytes:
    """The standings themselves, twenty bytes each."""
    return b"".join(_STANDING.pack(*each) for each in standings)


def decode_standings(position: bytes) -> list[Standing]:
    """The inverse of `encode_standings`. Raises ValueError."""
    if len(position) % _STANDING.size:
        raise ValueError(_NONE_OF_OURS)
    return [Standing(*each) for each in _STANDING.iter_unpack(position)]


def _decode_coarse(position: bytes) -> Position:
    partitions, incarnations, newest = _COARSE.unpack_from(position)
    if not partitions or (bits := _bits(partitions)) <= _SHIFT_BITS:
        raise ValueError(_NONE_OF_OURS)
    ages = int.from_bytes(position[_COARSE.size :], "little")
    standings = []
    for _ in range(partitions):
        code, ages = ages & (1 << bits) - 1, ages >> bits
        age = (code >> _SHIFT_BITS) << (code & (1 << _SHIFT_BITS) - 1)
        standings.append(Standing(0, FOREVER, newest - age))
    return Position(incarnations, standings, numbered=False)


def _bits(partitions: int) -> int:
    """The number of bits that there is room for, for each partition: 7 for 1,024, which are the most."""
    return min(8 * _AGES_BYTES // partitions, 64)


def _rounded_up(age: int, bits: int) -> int:
    """An age as a number of some bits, and the number of bits to shift it by."""
    digits = bits - _SHIFT_BITS
    shift = max(age.bit_length() - digits, 0)
    while (number := -(-age >> shift)) >> digits:
        shift += 1
    return number << _SHIFT_BITS | shift


def _together(standings: Sequence[Standing]) -> int:
    return crc32(b"".join(_INCARNATION.pack(each.incarnation) for each in standings))
