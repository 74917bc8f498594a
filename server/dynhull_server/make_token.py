"""`dynhull token`: a new bearer token, and its entry for the server's file."""

import hashlib
import secrets
from typing import Annotated

import typer

from .flags import as_toml


def token(
    name: Annotated[str, typer.Option(help="Whose it is.")] = "",
    read: Annotated[
        list[str] | None, typer.Option(help="Prefix of the hulls it may read; several times for more.")
    ] = None,
    write: Annotated[list[str] | None, typer.Option(help="Prefix of the hulls it may write.")] = None,
) -> None:
    """Make a token. It goes to standard error, its entry for the file given to `serve --tokens` to standard output.

    dynhull token --name trucks --read fleet/ --write fleet/truck- >> tokens.toml
    """
    new = secrets.token_urlsafe(32)
    typer.echo(f"token: {new}", err=True)
    typer.echo("[[token]]")
    typer.echo(f"name = {as_toml(name)}")
    typer.echo(f'sha256 = "{hashlib.sha256(new.encode()).hexdigest()}"')
    typer.echo(f"read = {as_toml(read or [])}")
    typer.echo(f"write = {as_toml(write or [])}")
    typer.echo("")
