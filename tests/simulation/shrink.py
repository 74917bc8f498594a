"""Makes a plan that found something small: it loses lives, clients, operations and faults while it finds the same."""

import copy
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice

from .cluster_plan import Plan
from .play import play

# Schedules that are tried for each smaller plan.
SEEDS = 30
# Processor time after which a plan stays as small as it is by then: a short one of many lives takes 0.2 s each time.
LONG_ENOUGH = 600.0
# A smaller plan may take so many times as long as the whole one has, or a second: it may go on without an end.
LONGER, LEAST = 3.0, 1.0

SIMPLER = {
    "rows": 1,
    "shared": False,
    "numbered": False,
    "window": 1,
    "batches": 1,
    "message": 1,
    "back": 0,
    "max_points": 0,
}


def shrunk(plan: Plan, long_enough: float = LONG_ENOUGH) -> Plan:
    """A small plan with the same kind of finding; one that is not of lives, of a cluster or of links, as it is.

    First under its own schedule, then under others, until nothing more can be left out, or the time is over.
    """
    if "lives" not in plan:
        return plan
    begun = time.process_time()
    whole = play(plan)
    seconds = max(LONGER * (time.process_time() - begun), LEAST)
    tries = _Tries(whole.kind, seconds, begun + long_enough)
    found = tries.failing(_with(plan, plan["lives"][: whole.lives], "lives"), 0)
    plan = found or plan
    for seeds in (0, SEEDS):
        plan = _less(plan, tries, seeds)
    return plan


def _less(plan: Plan, tries: "_Tries", seeds: int) -> Plan:
    """A plan from which no one thing can be left out."""
    place, found = 0, False
    while not tries.over:
        smaller = next(islice(_smaller(plan), place, None), None)
        if smaller is None:
            if not found:
                break
            place, found = 0, False
            continue
        failing = tries.failing(smaller(), seeds)
        if failing is None:
            place += 1
        else:  # what follows is in its place now
            plan, found = failing, True
    return plan


@dataclass(frozen=True, slots=True)
class _Tries:
    """Plays of plans that are to have one kind of finding, each for some seconds, until all of the time is over."""

    kind: str
    seconds: float
    until: float

    @property
    def over(self) -> bool:
        return time.process_time() >= self.until

    def failing(self, plan: Plan, seeds: int) -> Plan | None:
        """The plan with a schedule under which it has the finding: its own, or one of so many others."""
        for seed in (plan["seed"], *range(seeds)):
            if self.over:
                break
            tried = plan | {"seed": seed}
            if play(tried, self.seconds).kind == self.kind:
                return tried
        return None


def _smaller(plan: Plan) -> Iterator[Callable[[], Plan]]:
    """What makes plans with one thing less, the largest first."""
    for i in range(len(plan["lives"])):
        if len(plan["lives"]) > 1:
            yield partial(_without, plan, "lives", i)
    for i in range(len(plan["faults"])):
        yield partial(_without, plan, "faults", i)
    for life in range(len(plan["lives"])):
        clients = plan["lives"][life]["clients"]
        for client in range(len(clients)):
            yield partial(_without, plan, "lives", life, "clients", client)
        for client in range(len(clients)):
            for op in range(len(clients[client])):
                yield partial(_without, plan, "lives", life, "clients", client, op)
        for key in ("after", "restored"):
            if key in plan["lives"][life]:
                yield partial(_without, plan, "lives", life, key)
    for i, fault in enumerate(plan["faults"]):
        if fault["calls"] > 1:
            yield partial(_with, plan, 1, "faults", i, "calls")
    for life in range(len(plan["lives"])):
        clients = plan["lives"][life]["clients"]
        for client in range(len(clients)):
            for i, op in enumerate(clients[client]):
                yield from _simpler(plan, ("lives", life, "clients", client, i), op)


def _simpler(plan: Plan, path: tuple[str | int, ...], op: dict[str, object]) -> Iterator[Callable[[], Plan]]:
    for key in ("leave", "delete", "torn", "crowd", "skips"):
        if key in op:
            yield partial(_without, plan, *path, key)
    for key, value in SIMPLER.items():
        if op.get(key, value) != value:
            yield partial(_with, plan, value, *path, key)


def _without(plan: Plan, *path: str | int) -> Plan:
    plan = copy.deepcopy(plan)
    place = plan
    for key in path[:-1]:
        place = place[key]  # type: ignore[index]
    del place[path[-1]]  # type: ignore[arg-type]
    return plan


def _with(plan: Plan, value: object, *path: str | int) -> Plan:
    plan = copy.deepcopy(plan)
    place = plan
    for key in path[:-1]:
        place = place[key]  # type: ignore[index]
    place[path[-1]] = value  # type: ignore[index]
    return plan
