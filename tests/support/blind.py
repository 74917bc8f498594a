"""Programs that another user runs, and that see no processes but their own in /proc."""

import subprocess

from peers import program

# The user may read this project's files.
BLIND = (
    "mount -t proc -o hidepid=2 proc /proc && exec setpriv --reuid 65534 --regid 65534 --clear-groups "
    '--inh-caps +dac_override --ambient-caps +dac_override "$@"'
)


def blind() -> list[str]:
    """The words before a command that has another user run it, with a /proc that hides processes; needs root."""
    return [program("unshare"), "--mount", "sh", "-c", BLIND, "sh"]


def may_blind() -> bool:
    """Whether this process may do that."""
    return subprocess.run([*blind(), "true"], capture_output=True, check=False).returncode == 0
