"""A real server, in a process of its own."""

import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from subprocess import PIPE

from forked import COMMAND, Process
from patience import PATIENCE

# How the servers of the tests run: as one process, or as several, set by `pytest --shape`.
SEVERAL = "--workers", "2", "--gateways", "2"
SHAPES = {"process": (), "workers": SEVERAL, "shards": SEVERAL}
shape = "process"


def shape_options() -> tuple[str, ...]:
    """The options for servers of this shape."""
    return SHAPES[shape]


UNFINISHED = "is incomplete or damaged and was dropped, with at most 1 of the newest commits"


@dataclass(frozen=True)
class Server:
    address: str
    process: subprocess.Popen[str]


@contextmanager
def server_process(
    *options: str,
    wrap: Sequence[str] = (),
    killed: bool = False,
    complaints: str | None = "",
    code: int = 0,
    torn: bool = False,
) -> Iterator[Server]:
    """`dynhull serve` on a free port, in memory unless the options name a folder.

    It must end with `code`, unless it was `killed`, and have nothing to complain about but what is expected: None for
    anything. Its log is of warnings and worse, unless the options say otherwise. With `torn`, the server before it was
    killed while it wrote: it may say that it dropped the commit that was under way.
    """
    memory = [] if {"--data", "--journal"} & set(options) else ["--in-memory"]
    folder = nullcontext("")
    if memory and shape == "shards":  # several workers with shards in memory are refused
        memory, folder = [], tempfile.TemporaryDirectory()
    command = [*wrap, COMMAND, "serve", "--port", "0", "--log-level", "warning", *shape_options(), *memory, *options]
    with (
        folder as data,
        tempfile.TemporaryFile("w+") as errors,
        Process([*command, "--data", data] if data else command, stdout=PIPE, stderr=errors, text=True) as process,
    ):
        try:
            first_line = process.stdout.readline()
            assert first_line.startswith("dynhull serving on "), errors.seek(0) or errors.read()
            yield Server(first_line.split()[-1], process)
        finally:
            process.terminate()
            ended = process.wait(PATIENCE)
            errors.seek(0)
            said = errors.read()
            if torn:
                said = "".join(line for line in said.splitlines(keepends=True) if UNFINISHED not in line)
            assert ended == (-signal.SIGKILL if killed else code), said
            assert complaints is None or (complaints in said if complaints else not said), said


def run(*arguments: object, given: str = "") -> subprocess.CompletedProcess[str]:
    """The `dynhull` command, to its end, with `given` as its standard input."""
    return finished([COMMAND, *map(str, arguments)], given)


def finished(command: Sequence[str], given: str = "") -> subprocess.CompletedProcess[str]:
    """Run any command to its end."""
    with Process(command, stdin=PIPE, stdout=PIPE, stderr=PIPE, text=True) as process:
        output, errors = process.communicate(given, timeout=PATIENCE)
    return subprocess.CompletedProcess(command, process.returncode, output, errors)
