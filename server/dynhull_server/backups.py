"""`dynhull backup`, `dynhull restore`, `dynhull check` and `dynhull export`: commands for data folders."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from dynhull_cli.connected import Connect, connecting

from .storage.databases import is_database
from .storage.segments.place import is_store, require_store

DATA = Path("dynhull-data")


def past_place(place: str | None) -> str | None:
    """Where the past is, unless that cannot be."""
    if place is not None and is_store(place):
        try:
            require_store(place)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
    return place


HistoryDir = Annotated[
    str | None,
    typer.Option(
        "--history-dir",
        help="The folder of the past of the hulls, or s3://BUCKET/PREFIX. Default: `history` in the data folder.",
        callback=past_place,
    ),
]
WithoutHistory = Annotated[
    bool, typer.Option("--without-history", help="Leave the past of the hulls out: as much as the journal drops.")
]


def _folder(path: Path | None) -> Path | None:
    """What an argument names, unless that is a database: these commands are for folders."""
    if path is not None and is_database(path):
        raise typer.BadParameter("no folder: copy a database with pg_dump; every start of a server examines it in full")
    return path


def backup(
    target: Annotated[Path, typer.Argument(metavar="TARGET", help="The folder to create.", callback=_folder)],
    data: Annotated[Path, typer.Option(help="The data folder; a server may be using it.", callback=_folder)] = DATA,
    history_dir: HistoryDir = None,
    without_history: WithoutHistory = False,
) -> None:
    """Copy a data folder consistently, also while a server uses it.

    The past of hulls that keep theirs is copied, too, as hard links where that is possible. The copy is examined in
    full. It is a data folder itself, so `dynhull serve --data COPY` serves it. A copy that was interrupted is refused
    by all commands.
    """
    from .data_folders import copy_folder

    copy_folder(data, target, history=history_dir, without_history=without_history)


def restore(
    backup: Annotated[
        Path,
        typer.Argument(
            metavar="BACKUP", help="A backup, or any data folder.", exists=True, file_okay=False, callback=_folder
        ),
    ],
    data: Annotated[Path, typer.Option(help="The data folder to create.", callback=_folder)] = DATA,
    accept_loss: Annotated[
        bool, typer.Option(help="If the log is missing or damaged, continue without the commits in it.")
    ] = False,
    history_dir: HistoryDir = None,
    without_history: WithoutHistory = False,
) -> None:
    """Create a data folder from a backup, after checking that every hull in it is intact."""
    from .data_folders import copy_folder

    copy_folder(
        backup,
        data,
        accept_loss=accept_loss,
        restores=True,
        history=history_dir,
        without_history=without_history,
    )


def check(
    data: Annotated[
        Path,
        typer.Argument(metavar="DATA", help="A data folder or a backup; a server may be using it.", callback=_folder),
    ] = DATA,
    history_dir: HistoryDir = None,
) -> None:
    """Examine a data folder or a backup, and report on each hull and fence. Nothing is changed.

    All batches and snapshots are compared with their checksums, also those that the next start would not need. Of
    fences, who is inside is compared with positions and areas, and the events with each other and with who is inside.
    While a server uses the folder, the data committed at one moment is examined, but not the log. Run it as the user of
    the server: root reads files that this user may not read.

    The exit code is 0 if everything is intact, 1 if anything is damaged, and 2 if there is no data folder:

        dynhull check backups/monday && echo "can be restored"
    """
    from .data_folders import check_folder

    raise typer.Exit(0 if check_folder(data, history_dir) else 1)


@partial(connecting, optional=True)
def export(
    connect: Connect,
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.")],
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The file to write: .csv, .parquet or .geojson.", dir_okay=False)
    ],
    data: Annotated[
        Path | None,
        typer.Option(
            help="The data folder or a backup; a server may be using it. dynhull-data without this and --address.",
            callback=_folder,
        ),
    ] = None,
) -> None:
    """Write the points of one hull, as of the last commit, to a file.

    They are read from a data folder, or with --address from a server, which needs a token that may read the hull.

    CSV and Parquet have columns x and y, and those of key, time and expires that the hull has; expires is the time at
    which a point leaves the hull. In GeoJSON the key is the id of a feature, and its times are properties. Times are in
    UTC. `dynhull load` reads the file into another hull, with an option for each of these columns that the file has:

        dynhull export fleet fleet.csv
        dynhull load copy fleet.csv --key key --time time --expires expires
    """
    if not connect.address:
        from .data_folders import export_hull

        export_hull(data or DATA, name, file)
        return
    if data is not None:
        raise typer.BadParameter("give --data or --address, not both")
    from dynhull_client import HullClient

    from .exporting import export_served

    with connect(HullClient) as client:
        export_served(client, name, file)
