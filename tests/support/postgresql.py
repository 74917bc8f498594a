"""A real PostgreSQL server, in processes of its own."""

import os
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import psycopg
from cluster import descendants, runs
from patience import PATIENCE, wait_until
from peers import program

# Without syncs: only where no test asks what a power failure leaves.
FAST = ("fsync=off", "full_page_writes=off", "shared_buffers=16MB", "autovacuum=off", "max_wal_size=256MB")
DEBIAN = Path("/usr/lib/postgresql")


def postgres_program(name: str) -> str:
    """The path of one of its programs; Debian has those of the server in a folder for each version."""
    newest = sorted(DEBIAN.glob(f"*/bin/{name}"), key=lambda path: int(path.parts[-3]))
    return str(newest[-1]) if newest else program(name)


class PostgreSQL:
    """A server with a folder and a socket of its own; it runs as `nobody` where root starts it.

    Its folder is new, or a physical copy of that of another one, which serves.
    """

    def __init__(self, home: Path, settings: Sequence[str] = FAST, copied: "PostgreSQL | None" = None) -> None:
        self._home = home
        self._settings = settings
        self._databases = count(1)
        self.process: subprocess.Popen[bytes] | None = None
        home.chmod(0o777)
        if copied is None:
            options = "--auth=trust", "--username=tester", "--no-sync", "--encoding=UTF8", "--locale=C"
            self._run("initdb", *options, self._data)
        else:
            source = f"host={copied._home} user=tester"
            self._run("pg_basebackup", "--checkpoint=fast", "--no-sync", "--dbname", source, "--pgdata", self._data)

    @property
    def _data(self) -> Path:
        return self._home / "data"

    def _command(self, name: str, *arguments: object) -> list[str]:
        # Not by subprocess, which would fork for that, and gRPC's handlers of forks have ended the child.
        as_nobody = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups"]
        return [*(as_nobody if os.getuid() == 0 else ()), postgres_program(name), *map(str, arguments)]

    def _run(self, name: str, *arguments: object) -> None:
        subprocess.run(self._command(name, *arguments), check=True, cwd=self._home, stdout=subprocess.DEVNULL)

    def start(self) -> None:
        """Start it, and wait until it answers."""
        self._launch(*self._settings)
        wait_until(self._answers)

    @contextmanager
    def recovering(self) -> Iterator[None]:
        """Start it after a kill, with a recovery that lasts until the end of the block."""
        signal_file, go_on = self._data / "recovery.signal", self._home / "go-on"
        go_on.unlink(missing_ok=True)
        signal_file.touch()
        signal_file.chmod(0o666)
        waiting = f"until test -e {go_on} || ! test -e {self._data}; do sleep 0.05; done; false"
        self._launch(*self._settings, f"restore_command={waiting}")
        try:
            wait_until(self._refuses)
            yield
        finally:
            go_on.touch()

    def _launch(self, *settings: str) -> None:
        options = [each for setting in settings for each in ("-c", setting)]
        with (self._home / "log").open("ab") as log:
            self.process = subprocess.Popen(
                self._command("postgres", "-D", self._data, "-k", self._home, "-h", "", *options),
                stdout=log,
                stderr=log,
                cwd=self._home,
            )

    def _answers(self) -> bool:
        assert self.process.poll() is None, (self._home / "log").read_text()
        try:
            self.query("SELECT 1", database="postgres")
        except psycopg.OperationalError:
            return False
        return True

    def _refuses(self) -> bool:
        """Whether it says that it is not ready: before that, nobody listens."""
        assert self.runs(), (self._home / "log").read_text()
        try:
            self.query("SELECT 1", database="postgres")
        except psycopg.OperationalError as error:
            return "the database system is " in str(error)
        return False

    def stop(self, number: int = signal.SIGQUIT) -> None:
        """End it; by default at once, without a checkpoint."""
        if self.process is not None:
            self.process.send_signal(number)
            self.process.wait(PATIENCE)
            self.process = None

    def runs(self) -> bool:
        """Whether it has not ended by itself."""
        return self.process is not None and self.process.poll() is None

    @property
    def processes(self) -> list[int]:
        """The numbers of its processes, the first one first."""
        return [self.process.pid, *descendants(self.process.pid)]

    def kill(self) -> None:
        """SIGKILL its first process, and wait until the others have ended: before that, it cannot start again.

        It is stopped first, so that it begins no others when these have been counted.
        """
        first = self.process.pid
        os.kill(first, signal.SIGSTOP)
        os.waitid(os.P_PID, first, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
        _, *others = self.processes
        self.stop(signal.SIGKILL)
        wait_until(lambda: not any(map(runs, others)))

    def url(self, database: str) -> str:
        """The address of a database."""
        return f"postgresql:///{database}?host={self._home}&user=tester"

    def new_database(self, template: str = "template1") -> str:
        """The address of an empty database, or of a copy of one that nobody uses."""
        name = f"test{next(self._databases)}"
        # As copies of files: that takes a quarter of the processor time of copying through the log.
        self.query(f"CREATE DATABASE {name} TEMPLATE {template} STRATEGY file_copy", database="postgres")
        if template != "template1":  # it stands for a database that was filled where it is
            self.query("DROP TABLE IF EXISTS dynhull.places", database=name)
        return self.url(name)

    def restored_copy(self, url: str, folder: Path) -> str:
        """A backup as the page makes it, in a database of its own."""
        file, copy = folder / "hulls.dump", self.new_database()
        back_up(url, file)
        bring_back(file, copy)
        return copy

    def query(self, sql: str, *values: object, database: str) -> list[Any]:
        """The rows of a query, in a connection of its own."""
        return query(self.url(database), sql, *values)


def query(url: str, sql: str, *values: object) -> list[Any]:
    """The rows of a query, in a connection of its own; names are of dynhull's tables."""
    with psycopg.connect(url, autocommit=True, options="-c search_path=dynhull") as connection:
        cursor = connection.execute(sql, values)
        return cursor.fetchall() if cursor.description else []


def back_up(url: str, file: Path) -> None:
    """Write a database to a file, as the page does."""
    dump = ["--format", "custom", "--schema", "dynhull", "--file", file, url]
    subprocess.run([postgres_program("pg_dump"), *dump], check=True)


def bring_back(file: Path, url: str) -> None:
    """Fill an empty database from that file."""
    subprocess.run([postgres_program("pg_restore"), "--dbname", url, file], check=True)


@contextmanager
def postgresql(*settings: str, copied: PostgreSQL | None = None) -> Iterator[PostgreSQL]:
    """A server that answers, or a copy of one; it ends with the block."""
    # A path to a socket has at most a hundred bytes, fewer than the folders of tests.
    with tempfile.TemporaryDirectory(prefix="pg-", ignore_cleanup_errors=True) as home:
        server = PostgreSQL(Path(home), settings or FAST, copied)
        server.start()
        try:
            yield server
        finally:
            server.stop()
