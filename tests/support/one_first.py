"""One process does something first, and then all others, which find what it has left."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def one_first(mark: Path) -> Iterator[None]:
    """The block runs in one process alone, the first; then in all others at once.

    Args:
        mark: a file that all of them name, and that is not there yet.
    """
    with mark.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if os.fstat(file.fileno()).st_size == 0:
            yield
            file.write("done")
            return
    yield
