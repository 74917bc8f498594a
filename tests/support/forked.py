"""`dynhull` commands and programs that use dynhull, each in a process of its own that starts fast.

Most of the processor time of a short-lived server goes into importing what it needs; a fork of a process that has
imported it needs a tenth. On Linux the commands of the tests are forked from this file, which runs as a process for
each worker of the tests. It tells the worker how they end: to make them children of the worker, each was forked twice.
"""

import atexit
import gc
import importlib
import inspect
import json
import multiprocessing.util
import os
import resource
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from contextlib import suppress
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import NoReturn

COMMAND = str(Path(sys.executable).with_name("dynhull"))

# What the commands import when they run, and those that serve with several processes.
UVICORN = ["uvicorn.lifespan.off", "uvicorn.loops.auto", "uvloop"]
RUN_BY = {
    "serve": [
        "dynhull_server.process",
        "encodings.idna",  # of the first address
        *(f"dynhull_cluster.storages.{each}" for each in ("choice", "folder", "memory")),
    ],
    "gateway": ["dynhull_client", "dynhull_cli.certificates", "dynhull_gateway.serve", *UVICORN],
    "dashboard": ["dynhull_client", "dynhull_cli.certificates", "dynhull_gateway.serve", *UVICORN],
    "ingest": ["dynhull_client", "dynhull_bridges.ingest.ingest", "dynhull_bridges.ingest.jetstream"],
    "relay": ["dynhull_client", "dynhull_bridges.relay", "dynhull_bridges.webhook"],
}
RUN_BY_SEVERAL = ["dynhull_cluster.process", "dynhull_cluster.child"]
RUN_ON_DATABASE = ["dynhull_cluster.storages.postgresql", "dynhull_cluster.machines.only_member"]
SERVER = "dynhull_server"  # the module
RUN_BY_OTHERS = ["dynhull_client", "dynhull_cli.certificates", "grpc._channel", "rich.console", "rich.table"]

REQUEST_BYTES = 2**18


class Process(subprocess.Popen[str]):
    """`subprocess.Popen`, but processes of `COMMAND`, Python files and modules, in our environment, are forked."""

    _ended: int | None = None  # from where to read how it has ended, if it is forked: it is no child of this process

    def kill(self) -> None:
        """End it at once: when this returns it has ended, and its locks are free."""
        super().kill()
        self.wait()

    def _try_wait(self, wait_flags: int) -> tuple[int, int]:
        if self._ended is None:
            return super()._try_wait(wait_flags)
        if wait_flags & os.WNOHANG and not _may_read(self._ended):
            return 0, 0
        status = os.read(self._ended, 4)
        if not status:
            raise ChildProcessError(f"nobody knows how {self.args} has ended")
        os.close(self._ended)
        return self.pid, int.from_bytes(status, "little")

    def _internal_poll(self, _deadstate: int | None = None) -> int | None:
        if self._ended is None:
            return super()._internal_poll(_deadstate)
        if self.returncode is None and self._waitpid_lock.acquire(blocking=False):
            try:
                if self.returncode is None:  # no other thread has waited
                    process, status = self._try_wait(os.WNOHANG)
                    if process:
                        self._handle_exitstatus(status)
            finally:
                self._waitpid_lock.release()
        return self.returncode

    def _execute_child(self, *arguments: object) -> None:
        call = inspect.signature(super()._execute_child).bind(*arguments).arguments
        ours = [call[each] for each in ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite")]
        command = list(map(str, call["args"]))
        is_python = command[0] == sys.executable and (command[1] == "-m" or command[1].endswith(".py"))
        apart = call["env"] is not None or call["start_new_session"]
        if sys.platform != "linux" or apart or not (is_python or command[0] == COMMAND):
            super()._execute_child(*arguments)
            return
        files = [number if given == -1 else given for number, given in enumerate((ours[0], ours[3], ours[5]))]
        try:
            self.pid, self._ended = _fork(command, str(call["cwd"] or Path.cwd()), files)
        finally:
            self._close_pipe_fds(*ours)
        self._child_created = True


_lock = threading.Lock()


def _fork(command: list[str], folder: str, files: list[int]) -> tuple[int, int]:
    """Run the command in a process with these files as its standard ones.

    Returns its number, and a file with its exit status, as of waitpid, once it has ended.
    """
    request = json.dumps([command, folder, dict(os.environ)]).encode()
    ended, ends = os.pipe()
    try:
        with _lock:
            parent = _parent()
            socket.send_fds(parent, [request], [*files, ends])
            return int(parent.recv(64)), ended
    finally:
        os.close(ends)


def _may_read(file: int) -> bool:
    asked = select.poll()
    asked.register(file)
    return bool(asked.poll(0))


@cache
def _parent() -> socket.socket:
    """The connection with the process that forks, which ends with this process."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        process = subprocess.Popen([sys.executable, __file__, str(theirs.fileno())], pass_fds=[theirs.fileno()])

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours


def _wait_to_be(connection: socket.socket) -> None:
    """Answer requests, tell how processes have ended, and return in each of them, as the process of its command."""
    running: dict[int, tuple[int, int]] = {}  # by the descriptor of a process: its number, and where its end is told
    waiting = select.poll()
    waiting.register(connection, select.POLLIN)
    while True:
        for each, _ in waiting.poll():
            if each in running:
                waiting.unregister(each)
                process, ends = running.pop(each)
                with suppress(BrokenPipeError):  # nobody asks any more
                    os.write(ends, os.waitpid(process, 0)[1].to_bytes(4, "little"))
                for file in (each, ends):
                    os.close(file)
                continue
            request, files, _flags, _address = socket.recv_fds(connection, REQUEST_BYTES, 4)
            if not request:
                sys.exit()
            command, folder, environment = json.loads(request)
            import_for(command)
            *own, ends = files
            if (process := os.fork()) == 0:
                for file in (ends, *running, *(told for _, told in running.values())):
                    os.close(file)
                connection.close()
                _become(command, folder, environment, own)
                return
            connection.send(str(process).encode())
            descriptor = os.pidfd_open(process)
            running[descriptor] = process, ends
            waiting.register(descriptor, select.POLLIN)
            for file in own:
                os.close(file)


def import_for(command: list[str]) -> None:
    for module in ("dynhull_client",) if command[0] == sys.executable else ("dynhull_cli.main", "dynhull_cli.commands"):
        importlib.import_module(module)
    if SERVER in command:
        command = [*command, "serve"]
    for entry in _entries():
        if entry.name in command:
            for module in (entry.module, *RUN_BY.get(entry.name, RUN_BY_OTHERS)):
                importlib.import_module(module)
            _read_options(entry.name)
    for option, modules in (
        ("--workers", RUN_BY_SEVERAL),
        ("--cluster", RUN_BY_SEVERAL),
        ("--journal", RUN_ON_DATABASE),
    ):
        if option in command:
            for module in modules:
                importlib.import_module(module)
    gc.freeze()  # a collection would write to, and so copy, all of the memory that the processes share


@cache
def _entries() -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group="dynhull.commands"))


@cache
def _read_options(name: str) -> None:
    """Have typer read the options of a command, by parsing none: of `serve`, that takes a third of its start."""
    import typer

    from dynhull_cli.commands import app

    typer.main.get_command(app).get_command(None, name).make_context(name, [], resilient_parsing=True)


def _become(command: list[str], folder: str, environment: dict[str, str], files: list[int]) -> None:
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    multiprocessing.util.spawnv_passfds = _fork_instead
    time.tzset()
    sys.argv = command[command[0] == sys.executable :]
    sys.path[0] = folder if sys.argv[0] == "-m" else str(Path(sys.argv[0]).parent)
    sys.stdin, sys.stdout, sys.stderr = (
        open(number, mode, buffering, encoding=old.encoding, errors=old.errors, closefd=False)  # noqa: SIM115
        for number, mode, buffering, old in ((0, "r", -1, sys.stdin), (1, "w", -1, sys.stdout), (2, "w", 1, sys.stderr))
    )


_spawn = multiprocessing.util.spawnv_passfds


def _fork_instead(path: bytes, arguments: list[str], files: list[int]) -> int:
    """What `multiprocessing` starts its helpers by: that which forks workers has imported all of it, if it is a fork.

    A fork has only one thread, so there must be no others.
    """
    code = arguments[-1]
    if "multiprocessing.forkserver" not in code or len(list(Path("/proc/self/task").iterdir())) > 1:
        return _spawn(path, arguments, files)
    if (process := os.fork()) != 0:
        return process
    try:
        signal.set_wakeup_fd(-1)
        for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
            if callable(signal.getsignal(number)):
                signal.signal(number, signal.SIG_DFL)
        first = 3
        for each in sorted(files):
            os.closerange(first, each)
            first = each + 1
        os.closerange(first, resource.getrlimit(resource.RLIMIT_NOFILE)[0])
        exec(code)
    except Exception:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(0)


def _leave(code: int) -> NoReturn:
    """End this process as Python would, but without the time in which it takes the modules apart."""
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    # OpenBLAS, which numpy starts, ends its threads before a fork.
    warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
    _wait_to_be(socket.socket(fileno=int(sys.argv[1])))
    try:
        if sys.argv[0] == "-m":
            del sys.argv[0]
            runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
        else:
            runpy.run_path(sys.argv[0], run_name="__main__")
    except SystemExit as end:
        if not isinstance(end.code, int):
            raise
        _leave(end.code)
    _leave(0)
