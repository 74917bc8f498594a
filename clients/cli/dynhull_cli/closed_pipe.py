"""Ends the command with success when the reader closes the pipe early, as `head` does."""

import io
import os
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from dynhull_surface.reasons import Exit


class _Output(io.FileIO):
    """Standard output; a write to a closed pipe ends the process with exit code 0, one to a full disk with an error."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            # Whatever is still buffered goes nowhere, so that it cannot fail again on the way out.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            if isinstance(error, BrokenPipeError):
                raise SystemExit(0) from None
            sys.stderr.write(f"error: standard output: {error.strerror}\n")
            raise SystemExit(Exit.UNUSABLE) from None


@contextmanager
def success_on_closed_pipe() -> Iterator[None]:
    """Replace sys.stdout, if there is one. Inside click it would be too late: rich and click exit with code 1 first."""
    old = sys.stdout
    if old is None:
        yield
        return
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(_Output(old.fileno(), "w", closefd=False)),
        encoding=old.encoding,
        errors="backslashreplace",  # of what the terminal's encoding has no character for
        line_buffering=bool(old.line_buffering),
    )
    try:
        yield
    finally:
        sys.stdout.flush()


def when_pipe_closes(stop: Callable[[], None]) -> None:
    """Call `stop` from a thread when the reader of standard output closes the pipe.

    For commands that may not write for a long time: only a write notices otherwise. Does nothing on systems without
    `poll`, and if standard output has no file descriptor.
    """
    try:
        output = sys.stdout.fileno()
    except (AttributeError, io.UnsupportedOperation):
        return
    if not hasattr(select, "poll"):
        return
    closed = select.poll()
    closed.register(output, 0)  # reports POLLERR and POLLHUP only

    def wait() -> None:
        closed.poll()
        stop()

    threading.Thread(target=wait, name="closed pipe", daemon=True).start()
