"""The rows of segments: which files of the past there are, and what they have to be.

A row of no hull names files that are to be removed: those that are being written, so that a start after a kill finds
them; or those whose time has come.

A row without a file says that keys were erased.
"""

import json
import struct
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..past import Erasure
from ..segments.archive import Written
from .encoding import checksum, weight

NO_HULL = 0
NOT_A_ROW = (ValueError, TypeError, AttributeError, struct.error)  # of values that no row has


@dataclass(frozen=True, slots=True)
class SegmentFacts:
    """What is known of the files of a segment.

    Attributes:
        bytes, digest: the size and the hash of the file with the batches.
        state_bytes, state_digest: those of the file with the state before them; 0 and empty where there is none.
        state_commit: the number and the time of the commit of that state; None where they are not known.
        batches: the number of batches.
        moves: the number of points and keys that they write.
        first_time, last_time: the times of their first and last commit, in microseconds since 1970; 0 if not known.
        blocks, state_blocks: the hashes of the blocks of the files; empty where there are none.
    """

    bytes: int
    digest: str
    state_bytes: int
    state_digest: str
    state_commit: tuple[int, int] | None
    batches: int
    moves: int
    first_time: int
    last_time: int
    blocks: str = ""
    state_blocks: str = ""

    @property
    def wrote(self) -> Written:
        """What the file with the batches was written with."""
        return Written(self.bytes, self.digest, self.blocks)

    @property
    def state_wrote(self) -> Written:
        """What the file with the state was written with."""
        return Written(self.state_bytes, self.state_digest, self.state_blocks)


@dataclass(frozen=True, slots=True)
class StoredSegment:
    """The row of a segment.

    Attributes:
        id: the number of the row.
        first, last: its revisions.
        file: the name of its files, without what tells the batches from the state.
        facts: what is known of them.
    """

    id: int
    first: int
    last: int
    file: str
    facts: SegmentFacts

    @property
    def begins(self) -> bool:
        """Whether its first batch is applied to a state that is there: that beside it, or the empty hull."""
        return self.first == 1 or self.facts.state_bytes > 0

    @property
    def size(self) -> int:
        """The bytes of its files."""
        return self.facts.bytes + self.facts.state_bytes


@dataclass(frozen=True, slots=True)
class StoredErasure:
    """The row of an erasure, and its number."""

    id: int
    erasure: Erasure


Values = tuple[int, int, int, int, str, str, int]


def segment_values(segment: StoredSegment, number: int) -> Values:
    """The columns of the row of a segment of a hull, with their checksum."""
    return _values(segment.id, number, segment.first, segment.last, segment.file, json.dumps(asdict(segment.facts)))


def unused_values(place: int, file: str) -> Values:
    """The columns of a row that names files which nobody needs."""
    return _values(place, NO_HULL, 0, 0, file, "")


def erasure_values(stored: StoredErasure, number: int) -> Values:
    """The columns of the row of an erasure from the past of a hull, with their checksum."""
    erasure = stored.erasure
    facts = json.dumps({"time": erasure.time, "keys": erasure.keys, "moves": erasure.moves})
    return _values(stored.id, number, erasure.first, erasure.last, "", facts)


def erasure_from(place: int, first: int, last: int, facts: str) -> StoredErasure:
    """The inverse of `erasure_values`. ValueError or TypeError for what is none."""
    return StoredErasure(place, Erasure(first, last, **json.loads(facts)))


def segment_from(place: int, first: int, last: int, file: str, facts: str) -> StoredSegment:
    """The inverse of `segment_values`. ValueError or TypeError for what is none."""
    found = SegmentFacts(**json.loads(facts))
    if found.state_commit is not None:
        found = replace(found, state_commit=(found.state_commit[0], found.state_commit[1]))
    return StoredSegment(place, first, last, file, found)


def segment_checksum(place: Any, number: Any, first: Any, last: Any, file: Any, facts: Any) -> int:
    """The checksum of a row; an error of NOT_A_ROW for other values."""
    return checksum(f"{file}\n{facts}".encode(), place, number, first, last)


def is_whole(row: Sequence[Any]) -> bool:
    """Whether a row has its checksum, and can be read."""
    try:
        place, number, first, last, file, facts, stored = row
        if segment_checksum(*row[:-1]) != stored:
            return False
        if number != NO_HULL:
            segment_from(place, first, last, file, facts) if file else erasure_from(place, first, last, facts)
    except NOT_A_ROW:
        return False
    return True


def segment_weight(values: Values) -> int:
    """The contribution of the row of a segment to the sum of the totals."""
    place, number, first, last, _, _, stored = values
    return weight(stored, place, number, first, last)


def _values(place: int, number: int, first: int, last: int, file: str, facts: str) -> Values:
    return place, number, first, last, file, facts, segment_checksum(place, number, first, last, file, facts)
