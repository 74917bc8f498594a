"""What happens on a simulated link between a gateway and a worker, as data: see `link_life`."""

import random
from typing import Any

Plan = dict[str, Any]
Operation = dict[str, Any]

NAMES = ("a", "b")
OPERATIONS = {"write": 12, "read": 8, "last": 1, "burst": 2, "dark": 3, "cut": 1, "rest": 3}
LIMITS = {
    "max_hulls": 10,
    "max_points": 100_000,
    "max_producers": 10,
    "max_producers_per_caller": 10,
    "resume_bytes": 1_000_000,
}


def random_link_plan(seed: int) -> Plan:
    """A plan that anything may be in."""
    draw = random.Random(f"link {seed}")
    lives = [_life(draw) for _ in range(draw.choice((1, 1, 2)))]
    return {"seed": seed, "layer": "links", "storage": "memory", "limits": LIMITS, "lives": lives, "faults": []}


def _life(draw: random.Random) -> dict[str, Any]:
    clients = [[_operation(draw) for _ in range(draw.randint(1, 8))] for _ in range(draw.randint(1, 4))]
    life: dict[str, Any] = {"clients": clients, "end": "kill"}
    if draw.random() < 0.2:
        life["after"] = int(draw.expovariate(1 / 200))
    return life


def _operation(draw: random.Random) -> Operation:
    do = draw.choices(list(OPERATIONS), list(OPERATIONS.values()))[0]
    op: Operation = {"do": do, "name": draw.choice(NAMES), "rows": 1}
    match do:
        case "write":
            op |= {"create": True, "numbered": draw.random() < 0.5}
        case "burst":
            op |= {"create": True, "numbered": False, "calls": draw.choice((3, 10, 40))}
        case "dark":
            op |= {"way": draw.choice(("there", "back", "both")), "seconds": draw.choice((None, 0.5, 3.0))}
        case "rest":
            op["seconds"] = 10 ** draw.uniform(-3, 0.8)
    if do not in ("dark", "burst") and draw.random() < 0.1:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op
