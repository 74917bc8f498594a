"""Makes a plan that found something small: it loses lives, clients, operations and faults while it finds the same."""

import copy
from collections.abc import Iterator

from .cluster_plan import Plan
from .play import play

# Schedules that are tried for each smaller plan.
SEEDS = 30

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


def shrunk(plan: Plan) -> Plan:
    """A small plan with the same kind of finding; one that is not of lives, of a cluster or of links, as it is."""
    if "lives" not in plan:
        return plan
    kind = play(plan).kind
    found = True
    while found:
        found = False
        for smaller in _smaller(plan):
            failing = _failing(smaller, kind)
            if failing is not None:
                plan, found = failing, True
                break
    return plan


def _failing(plan: Plan, kind: str) -> Plan | None:
    for seed in (plan["seed"], *range(SEEDS)):
        tried = plan | {"seed": seed}
        if play(tried).kind == kind:
            return tried
    return None


def _smaller(plan: Plan) -> Iterator[Plan]:
    """Plans with one thing less, the largest first."""
    for i in range(len(plan["lives"])):
        if len(plan["lives"]) > 1:
            yield _without(plan, "lives", i)
    for i in range(len(plan["faults"])):
        yield _without(plan, "faults", i)
    for life in range(len(plan["lives"])):
        clients = plan["lives"][life]["clients"]
        for client in range(len(clients)):
            yield _without(plan, "lives", life, "clients", client)
        for client in range(len(clients)):
            for op in range(len(clients[client])):
                yield _without(plan, "lives", life, "clients", client, op)
        for key in ("after", "restored"):
            if key in plan["lives"][life]:
                yield _without(plan, "lives", life, key)
    for i, fault in enumerate(plan["faults"]):
        if fault["calls"] > 1:
            yield _with(plan, 1, "faults", i, "calls")
    for life in range(len(plan["lives"])):
        clients = plan["lives"][life]["clients"]
        for client in range(len(clients)):
            for i, op in enumerate(clients[client]):
                yield from _simpler(plan, ("lives", life, "clients", client, i), op)


def _simpler(plan: Plan, path: tuple[str | int, ...], op: dict[str, object]) -> Iterator[Plan]:
    for key in ("leave", "delete", "torn", "crowd", "skips"):
        if key in op:
            yield _without(plan, *path, key)
    for key, value in SIMPLER.items():
        if op.get(key, value) != value:
            yield _with(plan, value, *path, key)


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
