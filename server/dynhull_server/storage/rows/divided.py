"""Hulls over shards in several databases, each of which is read at a moment of its own: what they have in common.

A root decides a revision when all of its shards have it in their logs. So if the revisions of the roots are read first,
and every database after that, then each shard has what was decided by then, whatever else it has. What it has beyond,
and what the root has decided since, is left out: that is what a server would find that was killed at the first moment.
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ...state.records import EPOCHS, STEPS, HullRow, Record
from ..port import DamagedError, StorageError
from .encoding import weight
from .group import DropNewest, DropSnapshot
from .ledger import HullRows, Ledger
from .reading import batch_rows, read_hull, snapshot_state, whole_records
from .tables import Reader


class NoLongerKeptError(StorageError):
    """The hull has changed so much since the first moment that the database has no such revision any more."""


@dataclass(frozen=True, slots=True)
class DatabaseView:
    """A database as of one moment."""

    reader: Reader
    ledger: Ledger


@dataclass(frozen=True, slots=True)
class Whole:
    """A hull over shards at one revision.

    Attributes:
        row: the root.
        part: the place of its database.
        revision: the revision.
        shards: the place of the database and the number of each shard, and its last revision that belongs to this one.
    """

    row: HullRow
    part: int
    revision: int
    shards: list[tuple[int, int, int]] = field(default_factory=list)


def revisions(ledger: Ledger) -> dict[str, int]:
    """The last revision of each root, by the uid of its hull."""
    return {hull.row.uid: hull.last for hull in ledger.hulls.values() if hull.row.settings.divided}


def wholes(parts: Sequence[DatabaseView], before: Mapping[str, int]) -> Iterator[Whole]:
    """The hulls over shards, at the revisions that their roots had before any of the parts was read.

    A hull that was created since is at revision 0. What it costs depends on the roots, and on what shards have beyond.

    Raises:
        NoLongerKeptError: a revision is no longer kept.
        DamagedError: a shard does not have what was decided.
    """
    shards = {
        (hull.row.uid, hull.row.settings.generation, hull.row.settings.shard): (place, hull)
        for place, part in enumerate(parts)
        for hull in part.ledger.hulls.values()
        if hull.row.settings.shard is not None
    }
    for place, part in enumerate(parts):
        for root in part.ledger.hulls.values():
            if not root.row.settings.divided:
                continue
            whole = Whole(root.row, place, min(root.last, before.get(root.row.uid, 0)))
            _require_kept(root, whole.revision)
            kept = read_hull(part.reader, root, whole.revision)
            division, tallies = kept.divided(root.row.settings)
            for shard in range(division.shards):
                found = shards.get((root.row.uid, division.generation, shard))
                step = tallies[shard].step if shard in tallies else 0
                if found is not None:
                    of_shard, hull = found
                    last = _last_revision(parts[of_shard].reader, hull, step, shard)
                    whole.shards.append((of_shard, hull.row.number, last))
                elif step:
                    if read_hull(part.reader, root, root.last).divided(root.row.settings)[0] != division:
                        raise NoLongerKeptError(f"hull {root.row.name!r} has other shards than before")
                    raise DamagedError(f"shard {shard} of hull {root.row.name!r} is missing: restore a backup")
            yield whole


def latest_epoch(part: DatabaseView) -> int:
    """The latest epoch of a root that the shards in a database know of; 0 for none. O(their points)."""
    shards = [hull for hull in part.ledger.hulls.values() if hull.row.settings.shard is not None]
    known = (read_hull(part.reader, hull, hull.last).sequences.get(EPOCHS, 0) for hull in shards)
    return max(known, default=0)


def dropping(reader: Reader, hull: HullRows, last: int) -> list[DropSnapshot | DropNewest]:
    """What leads back to revision `last`, at which one row of batches ends and the next one begins."""
    steps: list[DropSnapshot | DropNewest] = [
        DropSnapshot(hull.row.number, snapshot) for snapshot in hull.snapshots if snapshot.revision > last
    ]
    newest = newest_rows(reader, hull, last)
    return steps if newest is None else [*steps, newest]


def newest_rows(reader: Reader, hull: HullRows, last: int) -> DropNewest | None:
    """What drops the rows of batches after revision `last`; None for none."""
    ids = hull.after(last)
    if not ids:
        return None
    number = hull.row.number
    rows = list(reader.some("batches", "batches.rowid, first, last, checksum", ids))
    if [row[0] for row in rows] != list(ids) or rows[0][1] != last + 1:
        raise DamagedError(f"hull {hull.row.name!r}: a row of batches is missing: restore a backup")
    weights = sum(weight(stored, number, first, end) for _, first, end, stored in rows)
    return DropNewest(number, last, ids, weights)


def _require_kept(hull: HullRows, revision: int) -> None:
    if revision < hull.oldest:
        raise NoLongerKeptError(f"revision {revision} of hull {hull.row.name!r} is no longer kept")


def _last_revision(reader: Reader, hull: HullRows, step: int, shard: int) -> int:
    """The last revision of a shard that belongs to `step`, its last one that was decided."""
    name = hull.row.name.partition("#")[0]
    oldest, last, found = hull.oldest, hull.last, None
    for place, first in zip(reversed(hull.ids), reversed(hull.firsts), strict=True):
        if first <= oldest:
            break
        numbered = [record.sequence for record in _records(reader, hull, place) if record.producer == STEPS]
        if numbered and numbered[-1] <= step:
            found = numbered[-1]
            break
        if numbered:
            last = first - 1
    if found is None:
        found = _step_of_snapshot(reader, hull, oldest)
    if found > step:
        raise NoLongerKeptError(f"step {step} of shard {shard} of hull {name!r} is no longer kept")
    if found < step:
        raise DamagedError(
            f"shard {shard} of hull {name!r} is at step {found}, not {step}: its log has lost steps, or is of another "
            "moment: restore a backup"
        )
    return last


def _records(reader: Reader, hull: HullRows, place: int) -> list[Record]:
    (row,) = batch_rows(reader, array("q", [place]))
    return list(whole_records(hull, [row]))


def _step_of_snapshot(reader: Reader, hull: HullRows, revision: int) -> int:
    """The last step in the snapshot at a revision; 0 where there is none, because the log is complete."""
    for snapshot in hull.snapshots:
        if snapshot.revision == revision:
            kept = snapshot_state(reader, hull.row.number, snapshot)
            if kept is None:
                raise DamagedError(f"hull {hull.row.name!r}: the snapshot at revision {revision} is damaged")
            return kept.producers.get(STEPS, 0)
    return 0
