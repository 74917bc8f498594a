"""Changes of a cluster that an operator plans, one after the other, beside callers who must notice none of them.

    python tests/robustness/cluster/planned.py --changes 300 --seed 1 [--restarts]

Real servers share a real PostgreSQL. Partitions are moved by hand, machines join and leave, workers give up what they
have, and with --restarts all processes of a machine are restarted one at a time. These end gateways, too: gRPC loses
a call ("Stream removed (Socket closed (GOAWAY received") of a client that has not heard of it five seconds later.

Callers of every kind (steady_callers.py) call a machine that stays, with the defaults of the client. In the end there
is a table, and no error.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "support"))
from forked import COMMAND, Process
from patience import PATIENCE, wait_until
from postgresql import PostgreSQL, postgresql, query
from server_process import run
from steady_callers import KINDS, Caller

PARTITIONS = 4
MOST_MACHINES = 3
OPTIONS = ("--cluster", "--partitions", str(PARTITIONS), "--scrub-cpu", "0", "--log-level", "info")
SERVED = "SELECT worker FROM owners WHERE until > '-infinity' AND address <> '' ORDER BY partition"
RESTARTED = "all processes are restarted"
COMPLAINTS = ("[error ", "[critical ")
# What is changed, and how often in relation to the others.
CHANGES = {"move": 6, "join": 2, "leave": 2, "drain": 1, "restart": 1}


class Machine:
    """A server of the cluster, and what it logs."""

    def __init__(self, url: str, *options: str, command: str = COMMAND) -> None:
        self._log = tempfile.NamedTemporaryFile("w+")  # noqa: SIM115  # it is closed in `stop`
        words = [command, "serve", "--port", "0", "--journal", url, *OPTIONS, *options]
        self.process = Process(words, stdout=subprocess.PIPE, stderr=self._log, text=True)
        if not (first := self.process.stdout.readline()):
            self.process.wait(PATIENCE)
            raise ChildProcessError(self.said())
        self.address = first.split()[-1]
        self.drained = False

    def said(self) -> str:
        """Its log so far."""
        return Path(self._log.name).read_text()

    def complaints(self) -> list[str]:
        """What it logs of errors."""
        return [line for line in self.said().splitlines() if any(each in line for each in COMPLAINTS)]

    def stop(self) -> None:
        """End it as systemd does, which is planned: its partitions move first."""
        self.process.terminate()
        assert self.process.wait(PATIENCE) == 0, self.said()[-2_000:]
        self.process.stdout.close()


class Planned:
    """A cluster, its callers, and the changes."""

    def __init__(
        self, url: str, seed: int, kinds: Sequence[type[Caller]], *, restarts: bool, command: str = COMMAND
    ) -> None:
        self._url = url
        self._restarts = restarts
        self._random = random.Random(seed)
        self._all: list[Machine] = []
        self.machines = [self._started("--gateways", "2", command=command), self._started(command=command)]
        self.counts: Counter[str] = Counter()
        self._settle()
        address = self._address()
        self.callers = [kind(address) for kind in kinds]
        for caller in self.callers:
            caller.begin()

    def _address(self) -> str:
        """What callers call."""
        return self.machines[0].address

    def _started(self, *options: str, command: str = COMMAND) -> Machine:
        machine = Machine(self._url, *options, command=command)
        self._all.append(machine)
        return machine

    def change(self) -> None:
        """One change, to its end."""
        able = {"move": len(self._able()) > 1, "join": len(self.machines) < MOST_MACHINES}
        able |= {
            "leave": len(self.machines) > 2,
            "drain": len(self._able()) > 2,
            "restart": self._restarts and len(self._able()) > 1,
        }
        weights = [CHANGES[each] * able[each] for each in CHANGES]
        kind = self._random.choices(list(CHANGES), weights)[0]
        begun = time.monotonic()
        getattr(self, f"_{kind}")()
        self.counts[kind] += 1
        print(f"{self.counts.total()}: {kind}, {time.monotonic() - begun:.1f} s", file=sys.stderr)

    def _able(self) -> list[Machine]:
        """The machines that can have partitions."""
        return [each for each in self.machines if not each.drained]

    def _owners(self) -> list[str]:
        """The workers that serve the partitions, once all are served."""
        owners: list[str] = []

        def all_are_served() -> bool:
            owners[:] = [worker for (worker,) in query(self._url, SERVED)]
            return len(owners) == PARTITIONS

        wait_until(all_are_served)
        return owners

    def _settle(self) -> None:
        """Wait until every machine has its share."""
        wait_until(lambda: all(self._has(owners, each) for owners in [self._owners()] for each in self._able()))

    def _has(self, owners: Sequence[str], machine: Machine) -> bool:
        return any(f"-{machine.process.pid}-" in each for each in owners)

    def _command(self, *words: str) -> None:
        done = run("cluster", *words, "--journal", self._url)
        assert done.returncode == 0, done.stderr

    def _worker(self, machine: Machine) -> str:
        workers = [worker for (worker,) in query(self._url, "SELECT worker FROM workers")]
        return next(each for each in workers if f"-{machine.process.pid}-" in each)

    def _move(self) -> None:
        partition = self._random.randrange(PARTITIONS)
        owner = self._owners()[partition]
        to = self._random.choice([each for each in self._able() if f"-{each.process.pid}-" not in owner])
        worker = self._worker(to)
        self._command("move", str(partition), worker)
        wait_until(lambda: self._owners()[partition] == worker)
        self._command("move", str(partition), "anywhere")
        self._settle()

    def _join(self) -> None:
        self.machines.append(self._started())
        self._settle()

    def _leave(self) -> None:
        drained = [each for each in self.machines[1:] if each.drained]
        machine = drained[0] if drained else self._random.choice(self.machines[1:])
        self.machines.remove(machine)
        machine.stop()
        self._settle()

    def _drain(self) -> None:
        machine = self._random.choice([each for each in self._able() if each is not self.machines[0]])
        machine.drained = True
        self._command("drain", self._worker(machine))
        wait_until(lambda: not self._has(self._owners(), machine))
        self._settle()

    def _restart(self) -> None:
        """All processes of the machine that everybody calls, or of another one."""
        machine = self._random.choice(self._able())
        before = machine.said().count(RESTARTED)
        machine.process.send_signal(signal.SIGHUP)
        wait_until(lambda: machine.said().count(RESTARTED) > before)
        self._settle()

    def finish(self) -> list[str]:
        """End the callers. Returns what went wrong."""
        errors = []
        for caller in self.callers:
            if not caller.over.is_set():
                caller.finish()
            errors += caller.errors
        errors += [line for machine in self._all for line in machine.complaints()]
        while self.machines:
            self.machines[-1].stop()
            self.machines.pop()
        return errors

    def kill(self) -> None:
        """End what is left, without a plan."""
        for machine in self.machines:
            machine.process.kill()

    def table(self) -> str:
        """What has been done."""
        rows = [f"{kind:<22}{count:>9,}" for kind, count in sorted(self.counts.items())]
        rows += ["", f"{'calls':<22}{'answered':>9}{'errors':>8}{'longest, s':>12}"]
        rows += [
            f"{type(each).__name__:<22}{each.calls:>9,}{len(each.errors):>8}{each.longest:>12.2f}"
            for each in self.callers
        ]
        return "\n".join([f"{'changes':<22}{self.counts.total():>9,}", *rows])


def torture(
    database: PostgreSQL, changes: int, seed: int, kinds: Sequence[type[Caller]] = KINDS, *, restarts: bool
) -> tuple[str, list[str]]:
    """Make so many changes. Returns the table, and what went wrong."""
    planned = Planned(database.new_database(), seed, kinds, restarts=restarts)
    try:
        while planned.counts.total() < changes and not any(each.errors for each in planned.callers):
            planned.change()
        errors = planned.finish()
    finally:
        planned.kill()
    return planned.table(), errors


def main() -> None:
    parser = argparse.ArgumentParser(description="Change a cluster as planned while callers go on.")
    parser.add_argument("--changes", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--restarts", action="store_true", help="restart all processes of a machine now and then, too")
    options = parser.parse_args()
    begun = time.monotonic()
    with ExitStack() as stack:
        database = stack.enter_context(postgresql())
        table, errors = torture(database, options.changes, options.seed, restarts=options.restarts)
    print(f"seed {options.seed}, {time.monotonic() - begun:.0f} s\n{table}")
    for each in errors:
        print(each)
    sys.exit(bool(errors))


if __name__ == "__main__":
    main()
