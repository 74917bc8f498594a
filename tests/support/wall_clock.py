"""A wall clock that is set for one process, by libfaketime."""

import subprocess
from functools import cache

from peers import program


def at(offset: str) -> list[str]:
    """The words before a command that set its wall clock off by, for example, "-1h"; its monotonic clock stays.

    The test is skipped where libfaketime is missing.
    """
    # Debian's library is built with the fix, which makes every wait on a condition 60 ms longer.
    only_wall = "FAKETIME_DONT_FAKE_MONOTONIC=1", "FAKETIME_FORCE_MONOTONIC_FIX=0"
    return ["env", f"LD_PRELOAD={_library()}", f"FAKETIME={offset}", *only_wall]


@cache  # the program fails where one of the same number was killed before
def _library() -> str:
    return subprocess.check_output([program("faketime"), "-f", "+0", "printenv", "LD_PRELOAD"], text=True).strip()
