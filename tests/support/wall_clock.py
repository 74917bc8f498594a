"""A wall clock that is set for one process, by libfaketime."""

import re
from contextlib import suppress
from functools import cache
from pathlib import Path

from peers import missing, program

# What libfaketime names by the number of a process.
LEFT = re.compile(r"(?:sem\.)?faketime_(?:sem|shm)_(\d+)")


def at(offset: str) -> list[str]:
    """The words before a command that set its wall clock off by, for example, "-1h"; its monotonic clock stays.

    The test is skipped where libfaketime is missing.
    """
    # Debian's library is built with the fix, which makes every wait on a condition 60 ms longer.
    only_wall = "FAKETIME_DONT_FAKE_MONOTONIC=1", "FAKETIME_FORCE_MONOTONIC_FIX=0"
    return ["env", f"LD_PRELOAD={_library()}", f"FAKETIME={offset}", *only_wall]


@cache
def _library() -> Path:
    _forget_the_dead()
    folder = Path(program("faketime")).parents[1]
    found = [*folder.glob("lib*/faketime/libfaketime.so.1"), *folder.glob("lib*/*/faketime/libfaketime.so.1")]
    return found[0] if found else missing("libfaketime.so.1", f"it is not below {folder}")


def _forget_the_dead() -> None:
    """Remove what killed processes have left in memory: another one of the same number would end at its start."""
    for left in Path("/dev/shm").glob("*faketime_*"):
        found = LEFT.fullmatch(left.name)
        if found is not None and not Path("/proc", found[1]).exists():
            with suppress(FileNotFoundError):  # another worker has done it
                left.unlink()
