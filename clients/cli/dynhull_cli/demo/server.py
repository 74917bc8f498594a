"""The processes of the demo: the server and, where the demo is live, its gateway and dashboard."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import PIPE, Popen, TimeoutExpired
from tempfile import TemporaryDirectory

from . import child

STOP_SECONDS = 10
SERVE = "dynhull_server", "--port", "0", "--log-level", "warning"
IN_MEMORY = "--in-memory"
# What is kept goes with the demo, so it need not survive a power failure.
KEPT = "--durability", "none", "--data"


class Process:
    """A running command.

    Attributes:
        addresses: the last words of the lines that it has printed.
    """

    def __init__(self, name: str, process: Popen[str], lines: int) -> None:
        self._name = name
        self._process = process
        assert process.stdout is not None
        self.addresses = []
        for _ in range(lines):
            line = process.stdout.readline()
            if " on " not in line:
                raise RuntimeError(f"the {name} did not start: {line.strip() or 'see its message above'}")
            self.addresses.append(line.split()[-1])

    def check(self) -> None:
        """Raise a RuntimeError if the command has ended."""
        code = self._process.poll()
        if code is not None:
            raise RuntimeError(f"the {self._name} has ended with exit code {code}: see its message above")


@contextmanager
def running(name: str, *arguments: str, lines: int = 1, apart: bool = False) -> Iterator[Process]:
    """Run a module, and stop it at the end, or when this process is killed.

    Args:
        name: what it is, for errors.
        arguments: the module and its arguments.
        lines: how many lines with addresses it prints when it has started.
        apart: whether Ctrl-C on the terminal does not reach it, so that it ends when the block ends.
    """
    command = [sys.executable, "-m", child.__name__, *arguments]
    with Popen(command, stdin=PIPE, stdout=PIPE, text=True, start_new_session=apart) as process:  # noqa: S603  (our own module)
        try:
            yield Process(name, process, lines)
        finally:
            process.terminate()
            try:
                process.wait(STOP_SECONDS)
            except TimeoutExpired:
                process.kill()


@contextmanager
def server_process() -> Iterator[str]:
    """Start `dynhull serve` on a free port, with a folder of its own; yield its address; stop it at the end."""
    with TemporaryDirectory(prefix="dynhull-demo-") as folder, running("server", *SERVE, *KEPT, folder) as server:
        yield server.addresses[0]
