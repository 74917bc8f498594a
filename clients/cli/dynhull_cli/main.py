"""The `dynhull` command. Needs only the standard library, to be able to say what is not installed."""

import sys


def main() -> None:
    """Run the command line."""
    try:
        from .commands import app
    except ModuleNotFoundError as error:
        if error.name not in ("typer", "click", "rich"):
            raise
        sys.exit("The command line is not installed. Install it with: pip install 'dynhull[cli]'")
    app()
