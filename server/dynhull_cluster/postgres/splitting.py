"""Dividing the rows of a database with one partition among several, inside of one transaction.

A row keeps its number, its payload and its checksum, and gets another partition. So hulls, fences, their events, and
the numbers of producers are what they were, also for callers that go on with them. A row with events of many fences is
copied to the partitions of all fences that need it; what it has of others counts as that of deleted fences. So is a
consumer of the feed of a prefix, which goes on in each partition where it was in the one.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from dynhull_server.state.alarms.rule import called, unmarked
from dynhull_server.state.feed_consumers import ConsumerId
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.records import HullRow
from dynhull_server.storage.port import DamagedError, StorageError
from dynhull_server.storage.rows.feed_rows import StoredFeedConsumer
from dynhull_server.storage.rows.fence_rows import found_fences
from dynhull_server.storage.rows.fence_runs import FenceRows
from dynhull_server.storage.rows.ledger import HullRows, Ledger
from dynhull_server.storage.rows.tables import COLUMNS, Reader
from dynhull_server.storage.rows.totals import Totals

from ..divisions.divisions import hull_of_shard
from ..placement import worker_of, worker_of_shard
from .database import Connection
from .examination import examined
from .ownership import follow_owner
from .schema import put_totals

# The tables whose rows go where their hull or their fence goes, each with the column of its number.
OF_HULLS = {"batches": "hull", "snapshots": "hull", "segments": "hull", "hulls": "id"}
OF_FENCES = {"insides": "fence", "consumers": "fence", "delays": "fence", "starts": "fence", "fences": "id"}
CHUNKS = (
    b"UPDATE chunks SET partition = given.target FROM unnest(%s::bigint[], %s::integer[]) AS given (number, target) "
    b"JOIN snapshots ON snapshots.partition = 0 AND snapshots.hull = given.number "
    b"WHERE chunks.partition = 0 AND chunks.snapshot = snapshots.id"
)
COPY_EVENTS = (
    f"INSERT INTO events (partition, {', '.join(COLUMNS['events'])}) "  # noqa: S608  (ours)
    f"SELECT given.target, {', '.join(COLUMNS['events'])} FROM unnest(%s::bigint[], %s::integer[]) "
    "AS given (number, target) JOIN events ON events.partition = 0 AND events.rowid = given.number"
).encode()
MOVE_CONSUMERS = (
    b"UPDATE consumers SET partition = given.target FROM unnest(%s::bigint[], %s::integer[]) AS given (number, target) "
    b"WHERE consumers.partition = 0 AND consumers.rowid = given.number"
)
COPY_CONSUMERS = (
    f"INSERT INTO consumers (partition, {', '.join(COLUMNS['consumers'])}) "  # noqa: S608  (ours)
    f"SELECT given.target, {', '.join(COLUMNS['consumers'])} FROM unnest(%s::bigint[], %s::integer[]) "
    "AS given (number, target) JOIN consumers ON consumers.partition = 0 AND consumers.rowid = given.number"
).encode()
DROP_EVENTS = b"DELETE FROM events WHERE partition = 0 AND rowid = ANY(%s::bigint[])"


class FencesApartError(StorageError):
    """Some fences would be in another partition than their hulls.

    Attributes:
        fences: what is said of each of them.
    """

    def __init__(self, fences: list[str], partitions: int) -> None:
        super().__init__(
            f"with {partitions} partitions, {len(fences)} of the fences would lie apart from hulls they need. Nothing "
            'was changed: create them anew under names that agree with those of their hulls before the first "/"'
        )
        self.fences = fences


def require_together(reader: Reader, partitions: int) -> None:
    """Raise FencesApartError if fences would lie apart from hulls that they need."""
    consumers = defaultdict[int, list[str]](list)
    for number, name in reader.every("consumers", "fence, name"):
        consumers[number].append(name)
    apart = []
    for fence in found_fences(reader):
        if fence.row is not None and (reason := _why_apart(fence.name, fence.row.config, partitions)):
            names = sorted(consumers[fence.number])
            some = f" with the consumer{'s' * (len(names) > 1)} {', '.join(map(repr, names))}" if names else ""
            apart.append(f"{called(fence.name)}{some}: {reason}")
    if apart:
        raise FencesApartError(sorted(apart), partitions)


def _why_apart(name: str, config: FenceConfig, partitions: int) -> str:
    """Why a fence would lie apart from its hulls; empty if it would not."""
    own = worker_of(unmarked(name), partitions)
    if config.kind == "prefix" and "/" not in config.subjects:
        return f'hulls whose names begin with {config.subjects!r} may be in any partition: the prefix has no "/"'
    subjects = "its subjects are in" if config.rule is None else "it watches"
    needed = {config.subjects: subjects, config.area_hull: "its area is that of"}
    for other, what in needed.items():
        if other is not None and (there := worker_of(other, partitions)) != own:
            which = f"hulls {other}…" if config.kind == "prefix" and other == config.subjects else f"hull {other!r}"
            return f"it would be in partition {own}, and {what} {which}, in partition {there}"
    return ""


def split_rows(connection: Connection, epoch: int, partitions: int) -> list[int]:
    """Divide the rows of partition 0, inside of a transaction in which nobody else can write them.

    Args:
        connection: the connection.
        epoch: the epoch of the owner of partition 0, which the first owners of the others follow.
        partitions: how many partitions there are afterwards.

    Returns:
        The number of hulls in each partition, without shards.

    Raises:
        DamagedError: the database is damaged.
    """
    before = examined(connection, 0, lambda *_: None, contents=False)
    if damage := [*before.fatal, *before.notes]:
        raise DamagedError(f"the database is damaged: {'; '.join(damage)}: start a server on it, or restore a backup")
    ledger = before.ledger
    hulls = {number: _partition_of(hull.row, partitions) for number, hull in ledger.hulls.items()}
    fences = {number: worker_of(unmarked(fence.row.name), partitions) for number, fence in ledger.fences.items()}
    connection.execute(CHUNKS, _moved(hulls))
    for places, tables in ((hulls, OF_HULLS), (fences, OF_FENCES)):
        for table, column in tables.items():
            connection.execute(_moving(table, column), _moved(places))
    events = _events_of(ledger, fences)
    _move_events(connection, events)
    consumers = _consumers_of(ledger, partitions)
    _move_consumers(connection, ledger, consumers)
    connection.execute("UPDATE format SET partitions = %s", [partitions])
    for partition in range(partitions):
        if partition:
            follow_owner(connection, partition, epoch)
        own_hulls = [ledger.hulls[number] for number, there in hulls.items() if there == partition]
        own_fences = [ledger.fences[number] for number, there in fences.items() if there == partition]
        own_consumers = [ledger.feed_consumers[ident] for ident in consumers[partition]]
        totals = _totals(ledger, own_hulls, own_fences, events[partition], own_consumers)
        put_totals(connection, partition, totals)
        _require_complete(connection, partition, totals)
    counted = Counter(hulls[number] for number, hull in ledger.hulls.items() if hull.row.settings.shard is None)
    return [counted[partition] for partition in range(partitions)]


def _partition_of(row: HullRow, partitions: int) -> int:
    if row.settings.shard is None:
        return worker_of(row.name, partitions)
    return worker_of_shard(hull_of_shard(row.name), row.settings.shard, partitions)


def _moving(table: str, column: str) -> bytes:
    return (
        f"UPDATE {table} SET partition = given.target FROM unnest(%s::bigint[], %s::integer[]) "  # noqa: S608  (ours)
        f"AS given (number, target) WHERE {table}.partition = 0 AND {table}.{column} = given.number"
    ).encode()


def _moved(places: Mapping[int, int]) -> list[list[int]]:
    """The numbers of what leaves partition 0, and where it goes."""
    moved = [(number, there) for number, there in places.items() if there]
    return [[number for number, _ in moved], [there for _, there in moved]]


def _events_of(ledger: Ledger, fences: Mapping[int, int]) -> defaultdict[int, set[int]]:
    """The rows of events that each partition needs."""
    events = defaultdict[int, set[int]](set)
    for number, partition in fences.items():
        events[partition].update(ledger.fences[number].places)
    return events


def _move_events(connection: Connection, events: Mapping[int, set[int]]) -> None:
    """Copy rows of events to where they are needed; in partition 0 those that nobody needs stay, for it to sweep."""
    copies = [(place, partition) for partition, places in events.items() if partition for place in places]
    connection.execute(COPY_EVENTS, [[place for place, _ in copies], [partition for _, partition in copies]])
    gone = {place for place, _ in copies} - events.get(0, set())
    connection.execute(DROP_EVENTS, [list(gone)])


def _consumers_of(ledger: Ledger, partitions: int) -> defaultdict[int, list[ConsumerId]]:
    """The consumers of feeds that each partition needs."""
    needed = defaultdict[int, list[ConsumerId]](list)
    for ident in ledger.feed_consumers:
        feed = ident.feed
        for partition in range(partitions) if feed.prefix else [worker_of(feed.name, partitions)]:
            needed[partition].append(ident)
    return needed


def _move_consumers(connection: Connection, ledger: Ledger, needed: Mapping[int, Sequence[ConsumerId]]) -> None:
    places = {ident: stored.place for ident, stored in ledger.feed_consumers.items()}
    for statement, prefix in ((COPY_CONSUMERS, True), (MOVE_CONSUMERS, False)):
        moved = [(places[each], to) for to, some in needed.items() if to for each in some if each.feed.prefix == prefix]
        connection.execute(statement, [[place for place, _ in moved], [to for _, to in moved]])


def _totals(
    ledger: Ledger,
    hulls: Sequence[HullRows],
    fences: Sequence[FenceRows],
    events: set[int],
    consumers: Sequence[StoredFeedConsumer],
) -> Totals:
    """The totals of a partition with these rows; it gives no number to a hull that another one has had before."""
    before = ledger.totals
    _, weights = ledger.events.left(np.array(sorted(events), np.int64))
    totals = before._replace(hulls=0, batches=0, sum=0, fence_rows=0)
    totals = totals.plus(len(hulls), sum(len(hull.ids) for hull in hulls), sum(hull.sum for hull in hulls))
    weight = sum(fence.sum for fence in fences) + int(weights.sum()) + sum(each.weight for each in consumers)
    return totals.plus(0, 0, weight, sum(fence.count for fence in fences) + len(events) + len(consumers))


def _require_complete(connection: Connection, partition: int, totals: Totals) -> None:
    """Raise DamagedError unless a partition has exactly the rows of its totals."""
    found = examined(connection, partition, lambda *_: None, contents=False)
    if found.fatal or found.notes or found.ledger.totals != totals:
        reason = "; ".join([*found.fatal, *found.notes]) or "other totals"
        raise DamagedError(f"partition {partition} would differ from what there is: {reason}")
