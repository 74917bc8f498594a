"""Examination of the rows of segments: what is damaged of one is put right, or is a hole in the past of its hull.

A row of segments is no reason to refuse the whole database: it is about the past of one hull alone. But its weight is
in the sum of the totals, which also says whether rows of batches are missing. So a damaged row counts as explained only
if, with the weight that it must have had, the sum is that of the totals.
"""

import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from ...state.records import INCARNATION
from ..past import Erasure, created
from .group import MendSegment
from .ledger import HullRows
from .segment_rows import (
    NOT_A_ROW,
    SegmentFacts,
    StoredErasure,
    StoredSegment,
    Values,
    erasure_from,
    erasure_values,
    is_whole,
    segment_checksum,
    segment_from,
    segment_values,
    segment_weight,
    unused_values,
)
from .tables import COLUMNS, Reader
from .totals import SUM_BITS

BITS = 64  # of a number in a column
# Damaged rows of which it is not known which column is damaged: more have too many explanations.
MOST_UNEXPLAINED = 12
NAME = re.compile(r"(?P<uid>[^/]+)/(?P<first>\d{19})-(?P<last>\d{19})-\d+-[0-9a-f]{16}")


class _Explained(NamedTuple):
    """What a damaged row may have been.

    Attributes:
        weight: its weight in the sum of the totals.
        values: the row as it was; None where its file or what is known of it is lost.
    """

    weight: int
    values: Values | None


@dataclass(frozen=True, slots=True)
class Mended:
    """What becomes of a damaged row.

    Attributes:
        hull: whose it is; None for nobody's.
        text: what is said of it.
        step: puts it into the database.
        lost: whether it cannot be put right.
    """

    hull: HullRows | None
    text: str
    step: MendSegment
    lost: bool


class SegmentExamination:
    """Reads the rows of segments, and adds them to those of their hulls.

    Args:
        reader: reads the rows.
        hulls: the hulls by number.

    Attributes:
        newest: the greatest number of a row.
        dead: the rows of no hull.
    """

    def __init__(self, reader: Reader, hulls: Mapping[int, HullRows]) -> None:
        self._reader = reader
        self._hulls = hulls
        self._damaged: list[tuple[Any, ...]] = []
        self._places: set[int] = set()
        self._found: defaultdict[int, list[StoredSegment]] = defaultdict(list)  # that their hulls do not have yet
        self._erased: defaultdict[int, list[StoredErasure]] = defaultdict(list)  # the same
        self.newest = 0
        self.dead: list[int] = []

    def run(self) -> None:
        """Read everything once."""
        for row in self._reader.every("segments", ", ".join(COLUMNS["segments"])):
            self._places.add(row[0])
            if is_whole(row):
                self._add(row)
            else:
                self._damaged.append(row)
        self._hand_out()
        self.newest = max(self._places, default=0)

    def explain(self, lacking: int, committed: int) -> list[Mended] | None:
        """What becomes of the damaged rows; None if it is not certain what they were.

        Args:
            lacking: what the sum of the totals has beyond all rows but these.
            committed: the time of the last commit.
        """
        whole = [self._put_right(row) for row in self._damaged]
        left = [list(self._explanations(row)) for row, found in zip(self._damaged, whole, strict=True) if found is None]
        if len(left) > MOST_UNEXPLAINED:
            return None
        lacking -= sum(found.weight for found in whole if found is not None)
        for some in product(*left):
            if (lacking - sum(each.weight for each in some)) % 2**SUM_BITS == 0:
                rest = iter(some)
                explained = [next(rest) if found is None else found for found in whole]
                return self._mended(explained, committed)
        return None

    def blamed(self) -> Iterator[tuple[HullRows | None, str]]:
        """The hulls of the damaged rows, as far as they say that, and what is damaged."""
        for _, number, first, last, *_ in self._damaged:
            yield self._hulls.get(number), f"the row of the past of revisions {first} to {last} is damaged"

    def _add(self, values: Sequence[Any]) -> int:
        """Add a whole row to its hull. Returns its weight."""
        place, number, first, last, file, facts, _ = values
        hull = self._hulls.get(number)
        if hull is None:
            self.dead.append(place)
            return 0
        if file:
            self._found[number].append(segment_from(place, first, last, file, facts))
        else:
            self._erased[number].append(erasure_from(place, first, last, facts))
        found = segment_weight(values)  # type: ignore[arg-type]  # a row has these columns
        hull.weigh(found)
        return found

    def _weight(self, values: Sequence[Any]) -> int:
        return segment_weight(values) if values[1] in self._hulls else 0  # type: ignore[arg-type]  # as above

    def _put_right(self, row: tuple[Any, ...]) -> _Explained | None:
        """What the row was, if its checksum says that; None if it does not."""
        for found in (*self._named_by_file(row), *_one_bit_off(row)):
            if found[0] == row[0] or found[0] not in self._places:
                return _Explained(self._weight(found), found)
        return None

    def _named_by_file(self, row: tuple[Any, ...]) -> Iterator[Values]:
        """The row with the hull and the revisions that are in the name of its file, if its checksum is that of it."""
        place, _, _, _, file, facts, stored = row
        match = NAME.fullmatch(file) if isinstance(file, str) else None
        if match is None:
            return
        for number, hull in self._hulls.items():
            if _same_origin(match["uid"], hull.row.uid):
                values = place, number, int(match["first"]), int(match["last"]), file, facts, stored
                if is_whole(values):
                    yield values

    def _explanations(self, row: tuple[Any, ...]) -> Iterator[_Explained]:
        """What the row may have been, if one of its columns is damaged: the checksum, or a text.

        The totals know nothing of a row of no hull, so of that a text may be damaged.
        """
        if row[1] in self._hulls:
            with suppress(*NOT_A_ROW):
                values: Values = (*row[:-1], segment_checksum(*row[:-1]))
                if is_whole(values):
                    yield _Explained(self._weight(values), values)
        with suppress(*NOT_A_ROW):
            yield _Explained(self._weight(row), None)

    def _mended(self, explained: list[_Explained], committed: int) -> list[Mended]:
        """The hulls get the rows; those that are lost after the others, between which they are."""
        found: list[Mended] = []
        rows = sorted(zip(self._damaged, explained, strict=True), key=lambda each: each[1].values is None)
        for row, each in rows:
            place, number, first, last, *_ = row if each.values is None else each.values
            hull = self._hulls.get(number)
            text = f"the row of the past of revisions {first} to {last} was damaged"
            if each.values is not None:
                values, text = each.values, f"{text}, and could be put right"
            elif hull is None:  # whatever its file is, it may be that of another row
                values, text = unused_values(place, ""), "a row of files of the past that are to go was damaged"
            else:
                values, text = self._lost(row, hull, committed), f"{text}: they cannot be read"
            step = MendSegment(row[0], values, self._add(values) - each.weight)
            self._hand_out()
            found.append(Mended(hull, text, step, each.values is None))
        return found

    def _hand_out(self) -> None:
        """Give their hulls the segments and the erasures that were found."""
        for number, found in self._found.items():
            self._hulls[number].set_segments((*self._hulls[number].segments, *found))
        for number, erased in self._erased.items():
            self._hulls[number].add_erasures(erased)
        self._found.clear()
        self._erased.clear()

    def _lost(self, row: tuple[Any, ...], hull: HullRows, committed: int) -> Values:
        """A row that says which revisions there were, and which no file can satisfy."""
        place, number, first, last, file, facts, _ = row
        if _is_erasure(file, facts):
            return erasure_values(StoredErasure(place, Erasure(first, last, committed, 0, 0)), number)
        segments = sorted(hull.segments, key=lambda each: each.first)
        at = bisect_left(segments, first, key=lambda each: each.first)
        before, after = segments[at - 1 : at], segments[at : at + 1]
        times = [each.facts.last_time for each in before] or [created(hull.row).time]
        ends = [each.facts.first_time for each in after] or [committed]
        leads = bool(before) and before[0].last + 1 == first
        known = SegmentFacts(0, "", 0 if leads else 1, "", None, last - first + 1, 0, times[0], ends[0])
        match = NAME.fullmatch(file) if isinstance(file, str) else None
        own = match is not None and _same_origin(match["uid"], hull.row.uid)
        if not own or any(each.file == file for each in segments):
            file = f"{hull.row.uid}/{first:019}-{last:019}-0-{0:016}"
        return segment_values(StoredSegment(place, first, last, file, known), number)


def _is_erasure(file: Any, facts: Any) -> bool:
    """Whether a row of which one of these is damaged says that keys were erased."""
    return '"digest"' not in str(facts) and (not file or '"keys"' in str(facts))


def _one_bit_off(row: tuple[Any, ...]) -> Iterator[Values]:
    """The whole rows that differ from a row in one bit: at most one, since CRC-32 finds any two bits."""
    for column, value in enumerate(row[:-1]):
        for changed in _flipped(value):
            values: Any = (*row[:column], changed, *row[column + 1 :])
            if is_whole(values):
                yield values


def _flipped(value: Any) -> Iterator[Any]:
    if isinstance(value, int):
        for bit in range(BITS):  # that of the sign has another place in a number of fewer bytes
            yield from (value + (1 << bit), value - (1 << bit))
    elif isinstance(value, str):
        content = bytearray(value, "utf-8", "surrogateescape")
        for bit in range(8 * len(content)):
            content[bit // 8] ^= 1 << bit % 8
            yield content.decode("utf-8", "surrogateescape")
            content[bit // 8] ^= 1 << bit % 8


def _same_origin(uid: str, other: str) -> bool:
    """Whether two uids are those of a hull before and after a copy was made."""
    return uid.partition(INCARNATION)[0] == other.partition(INCARNATION)[0]
