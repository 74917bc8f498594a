"""Runs the command that follows, with a storage that fails while a file of that name is in the folder given first.
A fault that has come leaves a file: "commit failed".

Patience is a second, and the log's bound a quarter of a megabyte.

commit: a commit raises an I/O error after it has been kept. hang: it takes until the file is gone. settle: what became
of it cannot be decided. checkpoint: an I/O error. impossible: a checkpoint raises what it never should. thread: the
committing thread ends.
"""

import errno
import runpy
import sys
import time
from pathlib import Path

from dynhull_server.engine import driver, supervisor
from dynhull_server.storage.sqlite import storage
from dynhull_server.storage.sqlite.storage import SQLiteStorage

FAULTS = Path(sys.argv[1] if __name__ == "__main__" else ".")


def fails(name: str, error: BaseException) -> None:
    if (FAULTS / name).exists():
        (FAULTS / f"{name} failed").touch()
        raise error


def no_disk() -> OSError:
    return OSError(errno.EIO, "Input/output error")


class Faulty(SQLiteStorage):
    def commit(self, changes, now):
        fails("thread", SystemExit())
        while (FAULTS / "hang").exists():
            time.sleep(0.05)
        commit = super().commit(changes, now)
        fails("commit", no_disk())
        return commit

    def settle(self):
        fails("settle", no_disk())
        return super().settle()

    def checkpoint(self):
        fails("checkpoint", no_disk())
        fails("impossible", ZeroDivisionError("never"))
        super().checkpoint()


if __name__ == "__main__":
    from dynhull_cluster.storages import folder

    folder.SQLiteStorage = Faulty
    supervisor.PATIENCE = 1.0
    driver.STUCK = 0.5
    storage.CHECKPOINT_BYTES, storage.LONGEST_LOG_BYTES = 2**17, 2**18
    sys.argv = sys.argv[2:]
    runpy.run_path(sys.argv[0], run_name="__main__")
