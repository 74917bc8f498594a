"""The server process of the demo."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

STOP_SECONDS = 10


@contextmanager
def server_process() -> Iterator[str]:
    """Start `dynhull serve` on a free port, yield its address, and stop it at the end."""
    command = [sys.executable, "-m", "dynhull_server", "--port", "0", "--in-memory", "--log-level", "warning"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:  # noqa: S603  (our own module)
        try:
            assert process.stdout is not None
            first_line = process.stdout.readline()
            if "serving on" not in first_line:
                raise RuntimeError(f"the server did not start: {first_line.strip() or 'see its message above'}")
            yield first_line.split()[-1]
        finally:
            process.terminate()
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
