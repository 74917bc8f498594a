"""A cluster that is upgraded, machine by machine, beside callers who must notice nothing of it.

    python tests/robustness/cluster/upgrade.py --base PATH/bin/dynhull [--rounds 3] [--seed 1]

Two machines of an earlier version share a real PostgreSQL. One after the other is stopped and replaced by one of this
version, then back, and forth again, while partitions are moved by hand. Callers of every kind (steady_callers.py) call
through a load balancer, which sends new connections to the machine that stays. In the end there is a table, and no
error.

If the two versions do not serve together, one of them has to say so in a line and end. Then all machines are stopped,
and started in the new version, as that line says, and what the callers know must be there.
"""

import argparse
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "support"))
sys.path.append(str(Path(__file__).parent))
from forked import COMMAND
from planned import Machine, Planned
from postgresql import PostgreSQL, postgresql
from proxy import Proxy
from steady_callers import KINDS, Caller

from dynhull_client import HullClient

# What a server says that does not serve together with another version.
REFUSAL = re.compile(r"^error: cannot serve: (.*: stop all servers .*)$", re.MULTILINE)


class RefusedError(Exception):
    """The versions do not serve together; with what one of them says."""


class Upgrade(Planned):
    """The cluster. `machines` are two, and callers use the first one."""

    def __init__(self, url: str, seed: int, kinds: Sequence[type[Caller]], base: str) -> None:
        self._base = base
        self._proxy = Proxy("")
        super().__init__(url, seed, kinds, restarts=False, command=base)

    def _address(self) -> str:
        self._proxy.server = self.machines[0].address
        return self._proxy.address

    def replace_all(self, command: str) -> None:
        """Replace each machine by one that runs a command, and move partitions before, between and after."""
        for _ in self.machines:
            self._turn()
            self._move()
            self.machines.pop().stop()
            self._settle()
            self.machines.append(self._joined(command))
            self._settle()
            self._move()
            self.counts["new" if command == COMMAND else "old"] += 1

    def start_anew(self) -> None:
        """Have the callers end, replace all machines at once, and have the callers find what they know."""
        for caller in self.callers:
            caller.finish()
        for machine in self.machines:
            machine.stop()
        self.machines = [self._started(), self._started()]
        self._settle()
        with HullClient(self._address()) as client:
            for caller in self.callers:
                caller.check(client)
        self.counts["all anew"] += 1

    def _joined(self, command: str) -> Machine:
        try:
            return self._started(command=command)
        except ChildProcessError as error:
            if (refused := REFUSAL.search(str(error))) is None:
                raise
            raise RefusedError(refused[1]) from None

    def _turn(self) -> None:
        """New connections go to the other machine."""
        self.machines.reverse()
        self._proxy.server = self.machines[0].address

    def kill(self) -> None:
        super().kill()
        self._proxy.close()


def upgrade(database: PostgreSQL, base: str, rounds: int, seed: int) -> tuple[str, list[str]]:
    """Upgrade a cluster. Returns the table, and what went wrong."""
    upgraded = Upgrade(database.new_database(), seed, KINDS, base)
    said = ""
    try:
        try:
            for each in range(rounds):
                upgraded.replace_all(base if each % 2 else COMMAND)
        except RefusedError as error:
            said = f"\nrefused: {error}"
            upgraded.start_anew()
        errors = upgraded.finish()
    finally:
        upgraded.kill()
    return upgraded.table() + said, errors


def main() -> None:
    parser = argparse.ArgumentParser(description="Upgrade a cluster while callers go on.")
    parser.add_argument("--base", required=True, help="the program `dynhull` of an earlier version")
    parser.add_argument("--rounds", type=int, default=3, help="how often all machines are replaced: forth, back, ...")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    version = subprocess.run([options.base, "--version"], capture_output=True, text=True, check=True)
    begun = time.monotonic()
    with ExitStack() as stack:
        database = stack.enter_context(postgresql())
        table, errors = upgrade(database, options.base, options.rounds, options.seed)
    print(f"from {version.stdout.strip()}, seed {options.seed}, {time.monotonic() - begun:.0f} s\n{table}")
    for each in errors:
        print(each)
    sys.exit(bool(errors))


if __name__ == "__main__":
    main()
