"""Plans of short lives with hulls that keep their past: one hull or two, which few clients write to, file and read.

What a fault of the past needs is a segment, something that fails, and a read; what comes before is time that other
lives could have had. Long lives, with fences, alarms and whatever else there is, are those of the layer `sqlite`.
"""

import random
from typing import Any

from .cluster_plan import Operation, Plan
from .operations import TIMED, of_quarantine, operation, random_rules
from .past_plan import (
    BEYOND_ITS_AGE,
    JUMPS,
    SEGMENT_ROWS,
    SERVER_BYTES,
    STEP_FAULTS,
    WITH_CONSUMERS,
    changes_history,
    consumes,
    fault_of_past,
    kept,
    of_past,
    written_and_erased,
    written_beyond_its_age,
    written_until_filed,
)

# The hulls of a plan, the second perhaps, and the lives on one folder.
KEEPING = ("a", "a", "b", "k", "k", "k", "l", "kk", "w")
LIVES = (2, 3, 4, 5, 6)

# What clients ask for beside the past, and how often.
BESIDE = {
    "write": 12,
    "put": 12,
    "together": 4,
    "stream": 5,
    "read": 3,
    "delete": 6,
    "create": 6,
    "recall": 3,
    "last": 1,
    "watch": 2,
    "rest": 4,
}

# The share of the plans in which the past is in an object store, positions are held out, or a backup is restored; and
# of the lives that end at any time, in which the clock is another one, and which are looked at as a whole.
IN_STORE, WITH_QUARANTINE, WITH_RESTORES = 0.35, 0.2, 0.1
CUT_SHORT, OTHER_CLOCK, LOOKED_AT = 0.4, 0.3, 0.3

# The share of the lives in which commits are slow, so that what several ask for is one commit; and of the plans with
# keys in which one is erased.
SLOW_COMMITS, WITH_ERASURES = 0.15, 0.3

# The share of the plans in which commits fail, files and steps of the past, and commits of consumers.
COMMITS_FAIL, PAST_FAILS, CONSUMERS_FAIL = 0.25, 0.75, 0.9
COMMIT_FAULTS = ("full", "lost", "ghost", "memory", "ghost memory")
OF_CONSUMERS = (*STEP_FAULTS, "lost", "ghost", "ghost memory")


def random_short_plan(seed: int) -> Plan:
    """A plan of short lives."""
    draw = random.Random(f"short {seed}")
    names = tuple(dict.fromkeys(draw.choices(KEEPING, k=draw.choice((1, 1, 1, 2)))))
    backed_up = draw.random() < WITH_RESTORES
    plan: Plan = {
        "seed": seed,
        "layer": "sqlite",
        "storage": "sqlite",
        "short": True,
        "limits": {
            "max_hulls": 10,
            "max_points": 100,
            "max_producers": 10,
            "max_producers_per_caller": 10,
            "resume_bytes": draw.choice((0, 700, 1_000_000)),
        },
        "history_bytes": draw.choice(SERVER_BYTES),
        "segment_rows": draw.choice(SEGMENT_ROWS),
        "store": not backed_up and draw.random() < IN_STORE,
        "lives": [_life(draw, names) for _ in range(draw.choice(LIVES))],
        "faults": [],
    }
    _add_more(draw, plan, names)
    _add_faults(draw, plan)
    if backed_up:
        lives = plan["lives"]
        place = draw.randrange(1, len(lives))
        client = draw.choice(lives[place - 1]["clients"])
        client.insert(draw.randint(0, len(client)), {"do": "backup"})
        lives[place]["restored"] = True
    return plan


def _life(draw: random.Random, names: tuple[str, ...]) -> dict[str, Any]:
    clients = [written_until_filed(draw, draw.choice(names), rounds=draw.choice((1, 1, 2, 3)), reads=(0, 0, 1))]
    if draw.random() < 0.6:
        clients.append([_beside(draw, names) for _ in range(draw.randint(1, 4))])
    life: dict[str, Any] = {
        "clients": clients,
        "end": draw.choice(("kill", "kill", "kill", "stop")),
        "clock": draw.choice(JUMPS) if draw.random() < OTHER_CLOCK else 0,
        "patient": draw.random() < 0.8,
        "looked_at": draw.random() < LOOKED_AT,
    }
    if life["patient"] and draw.random() < SLOW_COMMITS:
        life["slow"] = "commits"
    if draw.random() < CUT_SHORT:
        life["after"] = int(draw.expovariate(1 / 150))
    return life


def _beside(draw: random.Random, names: tuple[str, ...]) -> Operation:
    """What a client asks for while another one files."""
    if draw.random() < 0.4:
        return of_past(draw, draw.choice(names), files=True)
    timed = tuple(name for name in names if name in TIMED)
    others = tuple(name for name in names if name not in TIMED)
    weights = dict(BESIDE)
    weights |= {} if others else {"write": 0, "stream": 0}
    weights |= {} if timed else {"put": 0}
    weights |= {} if len(names) > 1 else {"together": 0}
    op = operation(draw, (others, timed, ()), weights)
    return op | kept(draw) if op["do"] == "create" else op


def _add_more(draw: random.Random, plan: Plan, names: tuple[str, ...]) -> None:
    """Consumers, positions held out, and a hull that is written to for longer than it keeps its past."""
    lives = plan["lives"]
    if draw.random() < WITH_CONSUMERS:
        for life in lives:
            client = life["clients"][0]  # whose hull is there after its first request
            for _ in range(draw.choice((3, 4, 6))):
                client.insert(draw.randint(1, len(client)), consumes(draw, client[0]["name"]))
    held = [name for name in names if name in ("k", "kk", "l")]
    if held and draw.random() < WITH_QUARANTINE:
        for life in lives:
            client = draw.choice(life["clients"])
            client.insert(draw.randint(0, len(client)), of_quarantine(draw, draw.choice(held)))
            for op in client:
                if op["do"] == "create" and op["name"] in held and draw.random() < 0.8:
                    op["quarantine"] = random_rules(draw)
    if lives[0]["clients"][0][0]["name"] in held and draw.random() < WITH_ERASURES:
        _erase(draw, plan)
    if plan["segment_rows"] is None and draw.random() < BEYOND_ITS_AGE:
        draw.choice(lives)["clients"].append(written_beyond_its_age(draw.choice(names)))


def _erase(draw: random.Random, plan: Plan) -> None:
    """A key is erased in the first life, which is looked at, and perhaps a commit of that fails without a kill."""
    life = plan["lives"][0]
    client = life["clients"][0]
    for _ in range(draw.choice((1, 1, 2))):
        client += written_and_erased(draw, client[0]["name"])
    life["looked_at"] = True
    life.pop("after", None)
    if draw.random() < 0.5:
        kind = draw.choice(("full", "lost", "ghost", "memory"))
        plan["faults"].append({"at": "step", "nth": draw.randint(2, 12), "kind": kind, "calls": 1})


def _add_faults(draw: random.Random, plan: Plan) -> None:
    """What fails; nothing in some plans."""
    faults = plan["faults"]
    if draw.random() < COMMITS_FAIL:
        nth = 1 + int(draw.expovariate(1 / 12))
        faults.append({"at": "commit", "nth": nth, "kind": draw.choice(COMMIT_FAULTS), "calls": draw.choice((1, 2, 5))})
    if draw.random() < PAST_FAILS:
        faults += [fault_of_past(draw, in_store=plan["store"]) for _ in range(draw.choice((1, 1, 2, 3)))]
    if any(fault["at"] == "settings" for fault in faults):
        for life in plan["lives"]:
            client = life["clients"][0]
            client.insert(draw.randint(1, len(client)), changes_history(draw, client[0]["name"]))
    consumed = any(
        op["do"].startswith("consume") for life in plan["lives"] for client in life["clients"] for op in client
    )
    if consumed and draw.random() < CONSUMERS_FAIL:
        faults.append({"at": "consumer", "nth": draw.randint(1, 6), "kind": draw.choice(OF_CONSUMERS), "calls": 1})
