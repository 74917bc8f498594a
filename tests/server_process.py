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
def server_process(*options: str, complaints: str = "") -> Iterator[Server]:
    """`dynhull serve` on a free port. It must stop in peace, and have nothing to complain about but what is expected.

    Its log is of warnings and worse, unless the options say otherwise.
    """
    command = [COMMAND, "serve", "--port", "0", "--in-memory", "--log-level", "warning", *options]
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        try:
            first_line = process.stdout.readline()
            assert first_line.startswith("dynhull serving on "), first_line
            yield Server(first_line.split()[-1], process)
        finally:
            process.terminate()
            code = process.wait(PATIENCE)
            errors.seek(0)
            said = errors.read()
            assert code == 0, said
            assert complaints in said if complaints else not said, said


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The `dynhull` command, to its end."""
    return subprocess.run([COMMAND, *arguments], capture_output=True, text=True, timeout=PATIENCE, check=False)
