"""A real server, in a process of its own."""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

COMMAND = str(Path(sys.executable).with_name("dynhull"))
PATIENCE = 60


@dataclass(frozen=True)
class Server:
    address: str
    process: subprocess.Popen[str]


@contextmanager
def server_process(*options: str) -> Iterator[Server]:
    """`dynhull serve` on a free port. It must stop in peace, and have nothing to complain about."""
    command = [COMMAND, "serve", "--port", "0", "--in-memory", "--log-level", "warning", *options]
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        try:
            first_line = process.stdout.readline()
            assert first_line.startswith("dynhull serving on 127.0.0.1:")
            yield Server(first_line.split()[-1], process)
        finally:
            process.terminate()
            code = process.wait(PATIENCE)
            errors.seek(0)
            complaints = errors.read()
            assert (code, complaints) == (0, ""), complaints
