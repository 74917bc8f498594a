"""What happens on a simulated link between a gateway and a worker, as data: see `link_life` and `link_owners`."""

import random
from typing import Any

from dynhull_server.state.records import FOREVER

from .past_archive import LATE

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


# The share of the plans in which several servers own the hulls one after the other, and keep their past in a store.
WITH_OWNERS = 0.3
# What clients ask for there, and what befalls owners, their database and their store.
OF_OWNERS = {"write": 12, "read": 4, "as_of": 4, "rest": 7, "burst": 1, "dark": 1, "cut": 1, "delete": 1, "create": 1}
FATES = {
    "start": 5,
    "stop": 4,
    "go on": 4,
    "kill": 2,
    "cut": 1,
    "leave": 2,
    "dark": 2,
    "light": 3,
    "away": 3,
    "back": 4,
}
# Points and keys after which a segment ends; None for as many as usual.
SEGMENT_ROWS = (None, 1, 3)
# How calls of the store fail: while it is away, and one or some of them.
AWAY = ("os", *LATE)
STORE_FAULTS = {"call": ("os", *LATE), "send": ("os", "torn", "still", *LATE), "answer": ("os",)}
# The share of these plans in which a copy of the database is served, and of those in which its past is in the store of
# the original.
WITH_COPY, SHARED = 0.4, 0.7


def random_link_plan(seed: int) -> Plan:
    """A plan that anything may be in."""
    owners = random.Random(f"owners {seed}")  # the other plans stay as they were
    if owners.random() < WITH_OWNERS:
        return _owners_plan(owners, seed)
    draw = random.Random(f"link {seed}")
    lives = [_life(draw) for _ in range(draw.choice((1, 1, 2)))]
    return {"seed": seed, "layer": "links", "storage": "memory", "limits": LIMITS, "lives": lives, "faults": []}


def _owners_plan(draw: random.Random, seed: int) -> Plan:
    """Owners that are replaced while they file, and gateways that lose their way to them."""
    fates = [_fate(draw) for _ in range(draw.randint(4, 14))]
    if draw.random() < WITH_COPY:
        shares = draw.random() < SHARED
        place = draw.randint(1, min(5, len(fates)) if shares else len(fates))
        begins: Operation = {"do": "start", "who": 0, "site": 1}
        after = [draw.choice((0, 1)), draw.choice((2, 6) if shares else (0, 2))]  # both are written to for a while
        fates[place:place] = [
            {"do": "copy", "after": 0, "shares": shares},
            *[begins | {"after": each} for each in after],
        ]
    creates = [{"do": "create", "name": name, "rows": 1, "history": FOREVER, "history_bytes": 0} for name in NAMES]
    clients = [[_of_owners(draw) for _ in range(draw.randint(4, 14))] for _ in range(draw.randint(1, 3))]
    copied = [[_of_owners(draw) for _ in range(draw.randint(2, 8))] for _ in range(draw.choice((1, 2)))]
    name = draw.choice(NAMES)
    clients.append(_written_until_filed(draw, name))
    for client in clients[:-1]:
        client[:0] = draw.sample(creates, draw.choice((0, 0, 1)))
    clients[-1][:0] = creates
    if draw.random() < 0.4:  # what was filed goes
        clients[-1].append(_asked(draw, "delete", name))
    # What a gateway sends again may come to another hull of that name: so a plan has either numbers or deletions.
    numbered = draw.random() < 0.5
    for client in (*clients, *copied):
        client[:] = [op for op in client if not (numbered and op["do"] == "delete")]
        for op in client:
            op["numbered"] = numbered and op.get("numbered", False)
    return {
        "seed": seed,
        "layer": "links",
        "limits": LIMITS,
        "haste": draw.choice((0.01, 0.05, 0.2)),
        "machines": draw.choice((1, 2)),
        "segment_rows": draw.choice(SEGMENT_ROWS),
        "clients": clients,
        "copied": copied,
        "fates": fates,
        "faults": [_store_fault(draw) for _ in range(draw.choice((0, 1, 1, 2)))],
    }


def _written_until_filed(draw: random.Random, name: str) -> list[Operation]:
    """A hull is written to, and rests until its snapshots and segments are written, again and again."""
    scene: list[Operation] = []
    read, write = _asked(draw, "read", name), _asked(draw, "write", name) | {"create": False}
    for _ in range(draw.randint(3, 8)):  # the hull stays small, so that its snapshots do not wait for many batches
        scene += [read, write | {"delete": "lenient"}] * draw.randint(1, 4)
        scene.append({"do": "rest", "name": name, "rows": 1, "seconds": draw.choice((1.1, 1.1, 2.2))})
        if draw.random() < 0.4:
            scene.append({"do": "as_of", "name": name, "rows": 1, "at": draw.random()})
    return scene


def _fate(draw: random.Random) -> dict[str, Any]:
    do = draw.choices(list(FATES), list(FATES.values()))[0]
    fate = {"do": do, "who": draw.randrange(4), "site": draw.choice((0, 0, 1)), "after": draw.choice((0, 0.2, 1, 2, 4))}
    return fate | ({"kind": draw.choice(AWAY)} if do == "away" else {})


def _store_fault(draw: random.Random) -> dict[str, Any]:
    at = draw.choice(("call", "send", "send", "answer"))
    nth, kind = 1 + int(draw.expovariate(1 / 4)), draw.choice(STORE_FAULTS[at])
    return {"at": at, "nth": nth, "kind": kind, "calls": 1 if kind == "still" else draw.choice((1, 1, 2, 5))}


def _of_owners(draw: random.Random) -> Operation:
    """What a client asks for, of hulls that are made with a past."""
    do = draw.choices(list(OF_OWNERS), list(OF_OWNERS.values()))[0]
    name = draw.choice(NAMES)
    op: Operation = _asked(draw, do, name) | ({"history": FOREVER, "history_bytes": 0} if do == "create" else {})
    match do:
        case "as_of":
            op["at"] = draw.random()
        case "write" | "burst":
            op["create"] = draw.random() < 0.3  # without a past
        case "rest":
            op["seconds"] = draw.choice((0.3, 1.1, 1.1, 2.2, 6.0))
    return op


def _life(draw: random.Random) -> dict[str, Any]:
    clients = [[_operation(draw) for _ in range(draw.randint(1, 8))] for _ in range(draw.randint(1, 4))]
    life: dict[str, Any] = {"clients": clients, "end": "kill"}
    if draw.random() < 0.2:
        life["after"] = int(draw.expovariate(1 / 200))
    return life


def _operation(draw: random.Random) -> Operation:
    do = draw.choices(list(OPERATIONS), list(OPERATIONS.values()))[0]
    return _asked(draw, do, draw.choice(NAMES))


def _asked(draw: random.Random, do: str, name: str) -> Operation:
    op: Operation = {"do": do, "name": name, "rows": 1}
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
