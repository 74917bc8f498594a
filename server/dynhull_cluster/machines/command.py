"""The commands `dynhull cluster ...`: they write wishes into the tables, and the workers carry them out."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from dynhull_cli.groups import group
from dynhull_cli.plural import plural

if TYPE_CHECKING:
    from ..postgres.database import Connection
    from .board import Tables

JOURNAL = Annotated[
    str,
    typer.Option(
        envvar="DYNHULL_JOURNAL", help="Address of the database of the cluster: postgresql://user@host/database."
    ),
]
WORKER = Annotated[str, typer.Argument(help="The name of a worker, as `dynhull cluster status` shows it.")]
ANYWHERE = "anywhere"


def status(journal: JOURNAL) -> None:
    """Show the workers, and who serves which partitions."""
    from ..versions import apart
    from .board import read

    with _connected(journal) as (connection, count):
        tables = read(connection)
    typer.echo(plural(count, "partition"))
    owners = {owner.worker for owner in tables.owners.values() if not owner.free}
    for worker in sorted({*tables.workers, *owners}):
        own = [str(each) for each, owner in sorted(tables.owners.items()) if owner.worker == worker and not owner.free]
        typer.echo(f"{worker}  {_state(tables, worker)}  {len(own)}: {', '.join(own) or '-'}")
    left = [str(each) for each in range(count) if (owner := tables.owners.get(each)) is None or not owner.serves]
    if left:
        typer.echo(f"nobody serves {', '.join(left)}")
    for worker, versions in tables.strangers().items():
        typer.echo(apart(worker, versions))
    said = {str(each.versions) for each in tables.workers.values()}
    if len(said) > 1:
        typer.echo(f"the workers are of {' and '.join(sorted(said))}")
    if count == 1 and len(tables.workers) > 1:
        typer.echo("one worker can have a single partition: to divide it among several, run `dynhull cluster split N`")
    if tables.workers and all(present.draining for present in tables.workers.values()):
        typer.echo("no worker takes partitions, because all of them were drained: start the process of one again")
    for partition, worker in sorted(tables.wishes.items()):
        typer.echo(f"partition {partition} is to be on {worker}")


def _state(tables: "Tables", worker: str) -> str:
    """What a worker does, as far as its machine and the database can say."""
    from ..postgres.processes import is_known_dead

    owned = [owner for owner in tables.owners.values() if owner.worker == worker and not owner.free]
    present = tables.workers.get(worker)
    processes = {owner.process for owner in owned} | ({present.process} if present else set())
    if all(is_known_dead(process) for process in processes):
        return "has ended"
    if worker in tables.apart():
        return "not connected to this database"
    if owned and not any(owner.renewed for owner in owned):
        return "is stopped or cut off: it does not renew its lease"
    if present is None:
        return "away"
    if not present.host:
        return "serves, without --cluster"
    return "gives up its partitions" if present.draining else "serves"


def drain(worker: WORKER, journal: JOURNAL) -> None:
    """Have a worker give up its partitions to the others, and take none until it is started again."""
    with _connected(journal, to_change=True) as (connection, _):
        _require_worker(connection, worker)
        connection.execute("UPDATE workers SET draining = true WHERE worker = %s", [worker])


def move(
    partition: Annotated[int, typer.Argument(min=0, help="The number of a partition.")],
    worker: Annotated[str, typer.Argument(help=f"The worker to move it to, or `{ANYWHERE}` to let it be moved again.")],
    journal: JOURNAL,
) -> None:
    """Move a partition to a worker, where it stays as long as that worker is there."""
    from dynhull_server.failure import fail

    with _connected(journal, to_change=True) as (connection, count):
        if partition >= count:
            fail(f"PARTITION is {partition}: there are {count}, from 0 to {count - 1}")
        connection.execute("DELETE FROM wishes WHERE partition = %s", [partition])
        if worker != ANYWHERE:
            _require_worker(connection, worker)
            connection.execute("INSERT INTO wishes VALUES (%s, %s)", [partition, worker])


def split(
    partitions: Annotated[int, typer.Argument(min=2, max=1024, help="How many partitions the database is to have.")],
    journal: JOURNAL,
) -> None:
    """Divide a database that one server has used first among several partitions, while a cluster serves it.

    A database that `dynhull serve --journal` has made has a single partition, so of a cluster only one worker can have
    anything. Start servers with --cluster, stop the one without, whose hulls they take at once, and split:

        dynhull serve --cluster --journal postgresql://dynhull@db/hulls --port 50052
        dynhull cluster split 8 --journal postgresql://dynhull@db/hulls

    Callers wait meanwhile, for about as long as a start of a server takes; watches are resumed. Nothing is lost or
    applied twice, and numbered batches go on. It cannot be undone, and the number cannot be changed again.

    A name belongs to a partition by its part before the first "/". A fence and the hulls that it needs have to be in
    the same partition: fences that would lie apart from theirs are listed, each with its consumers, and nothing is
    changed. From then on a batch over several hulls is refused if they are in different partitions.

    If the command is killed, the database has either one partition, which the workers take back, or all of them: run
    it again.
    """
    from dynhull_server.failure import code_of, fail, text_of
    from dynhull_server.storage.port import StorageError

    from ..postgres.database import Database
    from ..postgres.splitting import FencesApartError
    from . import split as splitting

    try:
        done = splitting.split(Database(journal), partitions)
    except FencesApartError as error:
        for fence in error.fences:
            typer.echo(fence, err=True)
        fail(text_of(error))
    except (StorageError, OSError, ValueError) as error:
        fail(text_of(error), code_of(error))
    if not done.hulls:
        typer.echo(f"{done.database} has {partitions} partitions already")
        return
    hulls = (
        f"{plural(sum(done.hulls), 'hull')} in {sum(map(bool, done.hulls))} of them, at most {max(done.hulls)} in one"
    )
    typer.echo(f"{done.database} has {partitions} partitions: {hulls}")
    typer.echo(f"it was not served for {done.seconds:.1f} s, and until workers have read what they take")


def scale(
    servers: Annotated[int, typer.Argument(min=0, help="How many servers Ray is to run, each with its own processes.")],
    journal: JOURNAL,
    options: Annotated[
        list[str] | None, typer.Argument(help="Options of `dynhull serve` for them, after `--`; --port 0 by default.")
    ] = None,
) -> None:
    """Have Ray run that number of servers of the cluster, and restart those that die, on other nodes if need be.

    With RAY_ADDRESS, the servers go on after this command, on the nodes of that Ray. Without it, this command starts
    Ray itself, and all ends with it.

        dynhull cluster scale 3 --journal postgresql://dynhull@db/hulls -- --host 0.0.0.0 --insecure
    """
    import signal

    from dynhull_server.failure import fail

    try:
        from . import launcher

        own = launcher.start_ray()
    except ImportError as error:
        fail(f"dynhull cluster scale needs {error.name}: pip install 'dynhull[cluster]'")
    except (ConnectionError, RuntimeError, ValueError) as error:
        fail(f"Ray cannot be used: {error}")
    environment, host = {"DYNHULL_JOURNAL": journal}, "127.0.0.1" if own else ""
    found = launcher.scale(servers, ["--port", "0", *(options or [])], environment, host)
    for number, said in sorted(found.items()):
        typer.echo(f"server {number}: {said or 'it does not serve, see the log of Ray'}")
    if own and found:
        signal.sigwait({signal.SIGTERM, signal.SIGINT})
        launcher.scale(0, [], {}, "")


@group(status=status, drain=drain, move=move, split=split, scale=scale)
def cluster() -> None:
    """See which servers of a cluster serve what, and have them serve something else.

    A cluster is what `dynhull serve --cluster` makes of the servers of a PostgreSQL database.
    """


def _require_worker(connection: "Connection", worker: str) -> None:
    from dynhull_server.failure import fail

    from .board import read

    present = list(read(connection).workers)
    if worker not in present:
        fail(f"WORKER is {worker!r}: no worker of the cluster has this name; there are {', '.join(present) or 'none'}")


@contextmanager
def _connected(journal: str, *, to_change: bool = False) -> Iterator[tuple["Connection", int]]:
    """A transaction on the tables of a cluster, and the number of partitions; others hear of what has changed.

    Of a database that has only been served without --cluster, there is nothing to change.
    """
    from dynhull_server.failure import code_of, fail, text_of
    from dynhull_server.storage.port import StorageError

    from ..postgres.database import Database, as_storage_errors
    from ..postgres.ownership import CHANNEL
    from ..postgres.schema import partitions_of
    from .board import is_of_cluster

    try:
        database = Database(journal)
        with closing(database.connect("dynhull cluster")) as connection, as_storage_errors(), connection.transaction():
            partitions = partitions_of(connection, database)
            if partitions is None or (to_change and not is_of_cluster(connection)):
                raise StorageError(f"{database} is that of no cluster: start one with `dynhull serve --cluster`")
            yield connection, partitions
            if to_change:
                connection.execute(f"NOTIFY {CHANNEL}".encode())
    except (StorageError, OSError, ValueError) as error:
        fail(text_of(error), code_of(error))
