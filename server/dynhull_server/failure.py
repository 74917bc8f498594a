"""How the commands of the server end with an error: a message, and an exit code of the table in docs/client.md."""

import sys
from typing import NoReturn

import typer

from dynhull_surface.reasons import Exit

from .storage.port import DamagedError


def fail(message: str, code: int = Exit.UNUSABLE) -> NoReturn:
    """Print an error and end the command."""
    typer.echo(f"error: {message}", err=True)
    sys.exit(code)


def code_of(error: Exception) -> Exit:
    """The exit code after an error: damaged data is a result, anything else makes the command unusable."""
    return Exit.FAILED if isinstance(error, DamagedError) else Exit.UNUSABLE


def text_of(error: Exception) -> str:
    """The message of an error; for one of the operating system, the file and the reason."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error)
