"""The `dynhull` command. At first it needs only the standard library, so that it can name what is not installed."""

import gc
import sys

from dynhull_surface.reasons import Exit

from .closed_pipe import success_on_closed_pipe

# So many objects more than at the last collection bring the next one. What is imported stays: to search it for garbage
# every 700 objects takes an eighth of the start of a gateway.
YOUNG = 10_000


def main() -> None:
    """Run the command line."""
    gc.set_threshold(YOUNG)
    try:
        from .commands import app
    except ModuleNotFoundError as error:
        if error.name not in ("typer", "click", "rich"):
            raise
        sys.stderr.write("error: the command line is not installed. Install it with: pip install 'dynhull[cli]'\n")
        sys.exit(Exit.UNUSABLE)
    with success_on_closed_pipe():
        app()
