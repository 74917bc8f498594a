"""Whether a server may have a part of a database: its clock is right, and all can serve together, or it is alone.

A server without --cluster is a cluster of its own processes. It has no address for others, so it begins when nobody
else serves the database, and nobody else joins it.

The clock of the database is the one that machines have in common. It is compared because a partition that moves goes on
with the clock of its new machine: one that is ahead would expire what the others keep.
"""

import socket
import time
from contextlib import closing

from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.settings import is_loopback
from dynhull_server.storage.port import LockedError, StorageError

from ..postgres.database import Connection, Database, as_storage_errors
from ..postgres.ownership import IS_CONNECTED, LOOK, Leases
from ..postgres.processes import is_known_dead, shares_loopback, this_process
from ..postgres.schema import hold
from ..versions import EARLIER, UNSAID, Versions, apart, own_versions

# Seconds after which a worker that does not renew its row is one no longer.
PRESENT = 5

RENEW = (
    b"INSERT INTO workers (worker, draining, process, host, versions, seen) "
    b"VALUES (%s, %s, %s, %s, %s, clock_timestamp()) "
    b"ON CONFLICT (worker) DO UPDATE SET seen = clock_timestamp(), process = excluded.process, host = excluded.host, "
    b"versions = excluded.versions, "
    b"draining = excluded.draining OR (workers.draining AND workers.process = excluded.process) "
    b"RETURNING extract(epoch FROM clock_timestamp())::float8"
)
# The work that fails while the clock of the machine is wrong.
CLOCK = "clock of the machine"
# How the connection of a worker to the tables is called, before its name.
BOARD = "dynhull board"
# What a worker of a row says of its versions; and if nothing, also not in a column that versions before do not have,
# whether it is of those that own partitions without a lock. Its connection shows that the tables are no copy.
VERSIONS = (
    "coalesce(to_jsonb(workers) ->> 'versions', ''), CASE WHEN coalesce(to_jsonb(workers) ->> 'versions', '') <> '' "  # noqa: S608  (ours)
    "THEN false ELSE EXISTS (SELECT FROM owners WHERE owners.worker = workers.worker AND until > '-infinity' "
    f"AND address <> '' AND NOT {IS_CONNECTED}) AND EXISTS (SELECT FROM pg_stat_activity "
    f"WHERE datname = current_database() AND application_name = left('{BOARD} ' || workers.worker, 63)) END"
)
OTHERS = (
    f"SELECT worker, process, host, seen::text, {VERSIONS} FROM workers "  # noqa: S608  (ours)
    f"WHERE seen > clock_timestamp() - interval '{PRESENT}s' AND worker <> %s ORDER BY worker"
).encode()

OWNERS = b"SELECT partition, worker, process, until::text FROM owners WHERE until > '-infinity'"


def admit(database: Database, worker: str, host: str, limit: float, leases: Leases) -> None:
    """Put a worker into the tables of a cluster, if all servers that are present can reach and understand each other.

    Of owners that have died elsewhere, a server without --cluster awaits the end of the leases, which it sees.

    Args:
        database: the database, which is prepared.
        worker: the worker.
        host: where it listens for other servers; empty for a server without --cluster.
        limit: how many seconds the clock of this machine may be off.
        leases: what this process sees of leases.

    Raises:
        LockedError: another server is there, and one of the two is without --cluster.
        StorageError: the clock is wrong, workers are out of reach or of other versions, or the database cannot be used.
    """
    seen: dict[str, str] = {}
    with as_storage_errors(), closing(database.connect("dynhull start")) as connection:
        require_right_clock(_measured(connection), limit)
        while against := _admit(connection, database, worker, host, leases):
            for other, (reason, when) in against.items():
                if seen.setdefault(other, when) != when:  # it has not died in between
                    raise reason
            time.sleep(LOOK)


def versions_of(said: str, earlier: bool) -> Versions:
    """The versions of a worker, by what VERSIONS has found."""
    return Versions.of(said) if said else EARLIER if earlier else UNSAID


def served_by(database: Database, worker: str) -> LockedError:
    """The error of a server that would have nothing to serve, because another one has the database."""
    return LockedError(
        f"{database} is served by {worker}: stop that server first, choose another database, or start both with "
        "--cluster, so that they share it"
    )


def server_of(worker: str) -> str:
    """The server that a worker is one of, by their names; one of a single process is the server."""
    return worker.partition("/")[0]


def clock_difference(before: float, there: float, after: float) -> float:
    """Seconds by which the clock of this machine is ahead of another one, at the least; negative if it is behind.

    Args:
        before: the time here, before the other clock was read.
        there: the time there.
        after: the time here, afterwards; however long that took, no difference is seen where there is none.
    """
    return max(before - there, 0.0) + min(after - there, 0.0)


def require_right_clock(difference: float, limit: float) -> None:
    """Raise StorageError if the clock of this machine is off by more than the limit."""
    if abs(difference) > limit:
        side = "ahead of" if difference > 0 else "behind"
        raise StorageError(
            f"the clock of this machine is {abs(difference):.1f} s {side} that of the database, and its windows would "
            "be wrong by that: set it, or raise --max-clock-difference"
        )


def watch_clock(supervisor: Supervisor, difference: float, limit: float) -> None:
    """Say it when the clock of this machine has become wrong, or right again; what it serves keeps its time."""
    try:
        require_right_clock(difference, limit)
    except StorageError as error:
        supervisor.failed(CLOCK, error)
    else:
        supervisor.succeeded(CLOCK)


def _measured(connection: Connection) -> float:
    before = time.time()
    ((there,),) = connection.execute("SELECT extract(epoch FROM clock_timestamp())::float8").fetchall()
    return clock_difference(before, there, time.time())


def _admit(
    connection: Connection, database: Database, worker: str, host: str, leases: Leases
) -> dict[str, tuple[StorageError, str]]:
    """Put the worker into the tables, unless others speak against it: why, and when they were seen."""
    against: dict[str, tuple[StorageError, str]] = {}
    with connection.transaction():
        hold(connection, database)  # two that join at once see each other
        for other, process, where, when, said, earlier in connection.execute(OTHERS, [worker]).fetchall():
            versions = versions_of(said, earlier)
            if server_of(other) == server_of(worker) or (host and _is_awaited(other, where)):
                continue
            if not (host and where):
                if not is_known_dead(process):
                    against[other] = served_by(database, other), when
            elif not own_versions().meet(versions):
                against[other] = StorageError(apart(other, versions)), when
            elif not shares_loopback(process) and (_is_only_here(host) or _is_only_here(where)):
                against[other] = StorageError(_out_of_reach(other, where, host)), when
        for partition, owner, process, until in [] if host else connection.execute(OWNERS).fetchall():
            if server_of(owner) != server_of(worker) and not is_known_dead(process):
                leases.see(partition, until)
                if not leases.ended(partition):
                    against[f"partition {partition}"] = served_by(database, owner), until
        if not against:
            connection.execute(RENEW, [worker, False, this_process(), host, own_versions().text])
    return against


def _is_awaited(other: str, where: str) -> bool:
    """Whether a cluster may begin beside a server that has the database alone, and has what it leaves.

    The processes of a server of several are started again by themselves, and would not get in any more.
    """
    return not where and server_of(other) == other


def _is_only_here(host: str) -> bool:
    """Whether only this machine can reach a host; also one whose name the machine resolves to its loopback address."""
    try:
        places = socket.getaddrinfo(host.strip("[]"), 0, type=socket.SOCK_STREAM)
    except OSError:
        return is_loopback(host)
    return all(is_loopback(str(address[0])) for *_, address in places)


def _out_of_reach(other: str, where: str, host: str) -> str:
    if _is_only_here(host):
        return (
            f"worker {other} of this cluster is on another machine, which cannot reach --cluster-host {host}: "
            "give the address of this machine"
        )
    return (
        f"worker {other} of this cluster is on another machine and listens on {where}, which this one cannot reach: "
        "start it again with the address of its machine as --cluster-host"
    )
