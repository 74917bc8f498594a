"""The command `dynhull move`."""

from pathlib import Path
from typing import Annotated

import typer

from dynhull_cli.plural import plural
from dynhull_server.backups import past_place
from dynhull_server.storage.databases import is_database

SOURCE_HELP = "A data folder, or the address of a database; no server may be using it."
TARGET_HELP = "The address of an empty database, or the folder to create."


def move(
    source: Annotated[str, typer.Argument(metavar="FROM", help=SOURCE_HELP)],
    target: Annotated[str, typer.Argument(metavar="TO", help=TARGET_HELP)],
    history_dir: Annotated[
        str | None,
        typer.Option(
            "--history-dir",
            help="The folder of the past of the hulls in the database, or s3://BUCKET/PREFIX, if they have any.",
            callback=past_place,
        ),
    ] = None,
) -> None:
    """Copy a data folder into a PostgreSQL database, or a database into a folder.

    Everything is examined before and after, and the copy is there as a whole or not at all. FROM is not changed. Do not
    serve both: what one of them has is not in the other.

        dynhull move dynhull-data postgresql://dynhull@localhost/hulls
        dynhull serve --journal postgresql://dynhull@localhost/hulls
    """
    to_database = is_database(Path(target))
    if to_database == is_database(Path(source)):
        raise typer.BadParameter("one of FROM and TO must be a folder, the other one a database: postgresql://…")

    from dynhull_server.data_folders import hulls_counted
    from dynhull_server.failure import code_of, fail, text_of
    from dynhull_server.progress import progress_bar
    from dynhull_server.storage.port import StorageError

    from .postgres import transfer
    from .postgres.database import Database

    try:
        with progress_bar("rows") as progress:
            if to_database:
                moved = transfer.to_database(Path(source), Database(target), progress, history_dir)
            else:
                moved = transfer.to_folder(Database(source), Path(target), progress, history_dir)
    except (StorageError, OSError, ValueError) as error:
        fail(text_of(error), code_of(error))
    for note in moved.notes:
        typer.echo(note, err=True)
    hulls = hulls_counted(moved.hulls, moved.shards)
    typer.echo(f"{moved.target}: {hulls}, {plural(moved.fences, 'fence')}, all as in {moved.source}")
