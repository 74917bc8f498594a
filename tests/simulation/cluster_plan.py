"""What happens in a simulated cluster, as data: see `cluster_life`.

    {"seed": 7, "layer": "cluster", "limits": {...}, "haste": 0.05, "machines": 2, "clients": [[operation, ...], ...],
     "copied": [[operation, ...], ...], "fates": [{"do": "stop", "who": 3, "site": 0, "after": 40}, ...]}

`clients` are those of the first database, `copied` those of its copy, if a fate makes one. Each fate befalls one of the
processes, or begins one more for a site; `after` so many of its turns comes the next one. Between "dark" and "light" a
process cannot reach its database. `haste` says how often time passes while others could act.
"""

import random
from typing import Any

Plan = dict[str, Any]
Operation = dict[str, Any]

NAMES = ("a", "b")
OPERATIONS = {"write": 12, "read": 10, "last": 1, "create": 1, "delete": 1}
FATES = {"stop": 5, "go on": 4, "kill": 3, "cut": 2, "leave": 2, "start": 5}
WITH_COPY = 0.6
LIMITS = {
    "max_hulls": 10,
    "max_points": 100,
    "max_producers": 10,
    "max_producers_per_caller": 10,
    "resume_bytes": 1_000_000,
}


def random_cluster_plan(seed: int) -> Plan:
    """A plan that anything may be in."""
    draw = random.Random(f"cluster {seed}")
    fates = [_fate(draw) for _ in range(draw.randint(2, 12))]
    if draw.random() < WITH_COPY:
        place = draw.randint(0, len(fates))
        start = {"do": "start", "who": 0, "site": 1}
        fates[place:place] = [
            {"do": "copy", "after": 0},
            *[start | {"after": draw.choice((0, 30))}] * draw.choice((1, 2)),
        ]
    return {
        "seed": seed,
        "layer": "cluster",
        "limits": LIMITS,
        "haste": draw.choice((0.01, 0.05, 0.2)),
        "machines": draw.choice((1, 2)),
        "clients": [_operations(draw) for _ in range(draw.randint(1, 3))],
        "copied": [_operations(draw) for _ in range(draw.randint(1, 2))],
        "fates": fates,
    }


def _fate(draw: random.Random) -> dict[str, Any]:
    do = draw.choices(list(FATES), list(FATES.values()))[0]
    site = draw.choice((0, 0, 1))
    return {"do": do, "who": draw.randrange(4), "site": site, "after": int(draw.expovariate(1 / 40))}


def _operations(draw: random.Random) -> list[Operation]:
    return [_operation(draw) for _ in range(draw.randint(2, 8))]


def _operation(draw: random.Random) -> Operation:
    do = draw.choices(list(OPERATIONS), list(OPERATIONS.values()))[0]
    op: Operation = {"do": do, "name": draw.choice(NAMES)}
    match do:
        case "write":
            op |= {"create": True, "numbered": draw.random() < 0.4, "rows": draw.choice((1, 1, 200_000))}
        case "read":
            op["rows"] = draw.choice((1, 200))
    if draw.random() < 0.1:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op
