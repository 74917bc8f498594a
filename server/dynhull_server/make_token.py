"""`dynhull token`: a new bearer token, and its entry for the token file."""

import hashlib
import secrets
from typing import Annotated

import typer

from .flags import as_toml


def token(
    name: Annotated[str, typer.Option(help="Name of the owner, for limits and for people.")] = "",
    read: Annotated[list[str] | None, typer.Option(help="Prefix of the hulls it may read. May be repeated.")] = None,
    write: Annotated[list[str] | None, typer.Option(help="Prefix of the hulls it may write. May be repeated.")] = None,
    past: Annotated[
        list[str] | None,
        typer.Option(help="Prefix of the hulls whose past it may read, too: where things were. May be repeated."),
    ] = None,
) -> None:
    """Create a token. Prints the token to standard error, and its entry for `serve --tokens` to standard output.

    dynhull token --name trucks --read fleet/ --write fleet/truck- >> tokens.toml
    """
    from .failure import fail

    if not read and not write:
        fail('a token without rights is of no use: give --read or --write with a prefix; "" stands for every hull')
    for each in past or []:
        if not any(each.startswith(its) or its.startswith(each) for its in read or []):
            fail(f"--past {each} is of no use without --read {each}: who reads the past of a hull may read it now")
    new = secrets.token_urlsafe(32)
    typer.echo(f"token: {new}", err=True)
    typer.echo("[[token]]")
    typer.echo(f"name = {as_toml(name)}")
    typer.echo(f'sha256 = "{hashlib.sha256(new.encode()).hexdigest()}"')
    typer.echo(f"read = {as_toml(read or [])}")
    typer.echo(f"write = {as_toml(write or [])}")
    if past:
        typer.echo(f"past = {as_toml(past)}")
    typer.echo("")
