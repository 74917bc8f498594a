"""Runs a module as `python -m` does, and ends it as soon as standard input ends: whoever started it has ended.

python -m dynhull_cli.demo.child MODULE ARGUMENTS
"""

import os
import runpy
import signal
import sys
import threading


def _end_with_the_parent() -> None:
    """The other end of standard input closes also where its process was killed, on every system."""
    while os.read(0, 4096):  # not sys.stdin, whose lock would be held when the process ends
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
