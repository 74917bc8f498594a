"""Who a process is, and whether one has ended: what is known of it, and what cannot be known.

A number of a process means nothing without the machine since its start and the namespace of processes that it counts
in, and is used again, which the time when the process began tells apart. A process of another machine or another
namespace cannot be asked about. One of this namespace always can be, by a signal: only the answer that there is none
proves its end. The files in /proc do not: they may be hidden (hidepid, ProtectProc=), or be those of another namespace.
"""

import errno
import os
import socket
from pathlib import Path
from secrets import token_hex

PROC = Path("/proc")
# Fields of /proc/PID/stat behind the name, see proc_pid_stat(5).
STATE, THREADS, BEGUN = 0, 17, 19


def this_server() -> str:
    """A name for this server. Copies of a machine and containers have the same names and numbers, and so would two."""
    return f"{socket.gethostname()}-{os.getpid()}-{token_hex(2)}"


def this_worker() -> str:
    """This process, for people."""
    return f"process {os.getpid()} on {socket.gethostname()}"


def this_process(proc: Path = PROC) -> str:
    """This process, so that others on the same machine can tell whether it runs; empty where they cannot.

    It is the machine since its start, the namespaces of processes and of networks, and the number and the begin of the
    process; the network is the last, because versions before did not write it.
    """
    try:
        boot = (proc / "sys/kernel/random/boot_id").read_text().strip()
        processes, network = ((proc / f"self/ns/{each}").readlink() for each in ("pid", "net"))
        begun = _stat(proc / "self")[BEGUN]
    except OSError:
        return ""
    return f"{boot} {processes} {os.getpid()} {begun} {network}"


def is_known_dead(process: str, proc: Path = PROC) -> bool:
    """Whether a process has certainly ended; not if it is of another machine or namespace, or cannot be seen.

    Args:
        process: what `this_process` was in that process.
        proc: where the files of processes are.
    """
    own, other = this_process(proc).split(), process.split()
    if not own or not other or own[:2] != other[:2]:
        return False
    number, begun = int(other[2]), other[3]
    return not _has_number(number) or _has_only_number(number, begun, proc)


def shares_loopback(process: str, proc: Path = PROC) -> bool:
    """Whether a process may be reached at the loopback address of this one: not if it certainly has another one."""
    own, other = this_process(proc).split(), process.split()
    if not own or not other:
        return True
    return own[0] == other[0] and own[4:] == (other[4:] or own[4:])


def _has_number(number: int) -> bool:
    """Whether some process has a number, also one of another user."""
    try:
        os.kill(number, 0)
    except OSError as error:
        return error.errno != errno.ESRCH
    return True


def _has_only_number(number: int, begun: str, proc: Path) -> bool:
    """Whether the process that has a number now is known to be another one, or to have ended and not to be reaped."""
    try:
        if (proc / "self").readlink() != Path(str(os.getpid())):
            return False  # these are processes of another namespace
        now = _stat(proc / str(number))
    except OSError:
        return False
    return now[BEGUN] != begun or (now[STATE] in "ZX" and now[THREADS] == "1")


def _stat(process: Path) -> list[str]:
    """The fields of a process behind its name."""
    return (process / "stat").read_text().rpartition(")")[2].split()
