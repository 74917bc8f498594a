"""What happens in a simulated run, as data: lives of a server, what clients do, what fails, and how a life ends.

A plan is a dictionary that JSON can hold, so that one that found something can be shrunk and kept. The schedule, which
says who comes when, is drawn from the plan's seed and nothing else.

    {"seed": 7, "layer": "core", "limits": {...},
     "lives": [{"clients": [[operation, ...], ...], "end": "kill", "after": 40}, ...],
     "faults": [{"at": "commit", "nth": 3, "kind": "ghost", "calls": 1}, ...]}

A life with `restored` begins with the last backup in place of what the life before has left. Of a `short`
plan only lives `looked_at`, and the last one, end with a look at everything; see `short_plan`.
An operation names what to do and to which hull; with `leave` its caller disconnects after that number of turns.
"""

import random
from typing import Any

from .alarm_plan import WITH_ALARMS, WITH_ALARMS_IN_CLUSTER, add_alarms, add_alarms_to_cluster
from .cluster_plan import NAMES as NAMES_IN_CLUSTER
from .cluster_plan import Plan, random_cluster_plan
from .link_plan import random_link_plan
from .operations import (
    FENCED,
    FENCES,
    NAMES,
    Names,
    numbered_writes,
    of_fence,
    of_quarantine,
    operation,
    query,
    random_rules,
    settings_of,
)
from .past_plan import add_past, add_past_to_cluster, may_keep
from .scenes import (
    WITH_SCENES,
    add_earlier_acks,
    add_scene,
    fence_changes,
    fence_deleted,
    positions_held,
    recall_beside_delete,
    refused_stream,
)
from .short_plan import random_short_plan

# What can be asked for, and how often. Each plan has some of it much more often, and some not at all: faults hide where
# a few operations meet (swarm testing: Groce and others, 2012).
CORE = {
    "write": 40,
    "put": 40,
    "together": 8,
    "stream": 14,
    "read": 12,
    "delete": 10,
    "create": 8,
    "recall": 5,
    "snapshot": 5,
    "last": 4,
    "tick": 12,
    "day": 3,
}
SHELL = {
    "write": 34,
    "put": 34,
    "together": 8,
    "stream": 14,
    "read": 10,
    "delete": 9,
    "create": 8,
    "recall": 12,
    "last": 3,
    "watch": 6,
    "rest": 8,
}

# The share of plans with fences.
WITH_FENCES = 0.12

# How often a plan with hulls on the globe asks for another centre, and the share of plans with such hulls.
RECENTERS = 20
ON_GLOBE = 0.1

# The share of the shell's plans in which clients send streams of reads, and how many of these there are.
WITH_QUERIES = 0.2
QUERIES = (1, 1, 2, 4)

# The share of the plans with keys in which bad positions are held out, and how many requests there are about that.
WITH_QUARANTINE = 0.3
QUARANTINED = ("k", "kk", "l")
REQUESTS = (1, 2, 4, 8)

# The share of the engine's plans with fences in which one is deleted repeatedly, while old events are dropped.
WITH_DELETED_FENCES = 0.3

# The share of plans with immediate commits in which a stream goes on after a batch that is refused.
WITH_REFUSED_STREAMS = 0.3

# The share of the other layers' plans in which the past is read: on SQLite, where hulls keep it, and in memory.
WITH_PAST = {"sqlite": 0.2, "shell": 0.15, "cluster": 0.4}

SWARM = (0, 1, 1, 5)

# The share of the shell's plans in which a hull is recalled from the storage beside its deletion: by chance the two
# hardly ever meet.
RECALLS_BESIDE_DELETES = 0.1

# The share of the plans on SQLite in which a backup is made and restored: with fences, without them.
WITH_RESTORES = 0.8, 0.3

# How a commit fails: surely not done; done or not though it raised; and not decided before it is settled.
COMMIT_FAULTS = ("nothing", "full", "lost", "ghost", "memory", "ghost memory", "later lost", "later ghost")

# How everything else fails.
OTHER_FAULTS = ("os", "memory")
SQLITE_FAULTS = ("full", "lost", "ghost", "memory", "ghost memory")
CORE_PLACES = ("commit",) * 6 + ("read", "settle", "row")
SHELL_PLACES = (*CORE_PLACES, "oldest", "snapshot", "sweep", "checkpoint", "sync")
SQLITE_PLACES = ("commit",) * 5 + ("begin", "connect", "connect", "open", "fsync", "stat")
PLACES = {"core": CORE_PLACES, "shell": SHELL_PLACES, "sqlite": SQLITE_PLACES}
ENDS = ("kill", "kill", "stop")


def random_plan(seed: int, layer: str) -> Plan:
    """A plan that anything may be in."""
    if layer == "cluster":
        return _cluster_plan(seed)
    if layer == "links":
        return random_link_plan(seed)
    if layer == "past":
        return random_short_plan(seed)
    with_past = WITH_PAST.get(layer, 0.0)
    draw = random.Random(seed)
    with_fences = draw.random() < WITH_FENCES
    with_times = with_fences or draw.random() < 0.5
    names = NAMES[: draw.randint(1, 1 if with_times else 3)]
    timed = tuple(draw.sample(("k", "w", "l"), draw.randint(1, 3))) if with_times else ()
    fences = tuple(draw.sample(tuple(FENCED), draw.choice((1, 1, 2, 3)))) if with_fences else ()
    on_globe = not with_fences and random.Random(f"globe {seed}").random() < ON_GLOBE
    if on_globe:
        names = (*names[: draw.randint(0, 1)], "g")
        timed = tuple(draw.sample(("k", "gk", "gw"), draw.randint(0, 3)))
    if with_fences:
        timed = tuple(dict.fromkeys(("k", *timed, *(("kk",) if draw.random() < 0.4 else ()))))
    weights = {do: often * draw.choice(SWARM) for do, often in (CORE if layer == "core" else SHELL).items()}
    weights["write"] += 1
    if with_fences:
        weights |= {do: often * draw.choice(SWARM) for do, often in FENCES.items()}
        weights["put"] += 20
        if layer != "core":  # the engine does it itself
            weights["keep"] = 0
    if on_globe:
        weights["recenter"] = RECENTERS * draw.choice(SWARM)
    if not timed:
        weights |= {"put": 0, "tick": 0}
        weights["together"] *= len(names) > 1
    immediate = layer != "sqlite" and draw.random() < 0.15
    lives = [_life(draw, (names, timed, fences), weights) for _ in range(draw.choice((1, 1, 2, 3)))]
    for name in (*timed, "g") if on_globe else timed:
        if draw.random() < 0.7:  # otherwise most would be made by their first batch, without a window, or never
            create = {"do": "create", "name": name, "max_points": 0} | settings_of(draw, name)
            lives[0]["clients"][0].insert(0, create)
    if with_fences:
        lives[0]["clients"][0][len(timed) :] = [of_fence(draw, "fence", name) for name in fences] + lives[0]["clients"][
            0
        ][len(timed) :]
    plan = {
        "seed": seed,
        "layer": layer,
        "storage": "immediate" if immediate else "sqlite" if layer == "sqlite" else "memory",
        "limits": {
            "max_hulls": draw.choice((1, 2, 10, 10, 10)),
            "max_points": draw.choice((3, 100, 100, 100)),
            "max_producers": draw.choice((1, 10, 10)),
            "max_producers_per_caller": draw.choice((1, 10, 10)),
            "resume_bytes": draw.choice((0, 0, 700, 1_000_000)),
        },
        "fences": {
            "max_fences": draw.choice((1, 10, 10)),
            "max_fence_consumers": draw.choice((1, 10)),
            "fence_event_bytes": draw.choice((0, 1000, 100_000)),
        },
        "lives": lives,
        "faults": [] if immediate or draw.random() < 0.3 else [_fault(draw, layer) for _ in range(draw.randint(1, 3))],
    }
    if layer == "shell" and draw.random() < RECALLS_BESIDE_DELETES:
        draw.choice(lives)["clients"] += recall_beside_delete(draw, names[0])
        plan["limits"]["resume_bytes"] = 0
    scenes = random.Random(f"scenes {seed}")  # the other plans stay as they were
    if fences and scenes.random() < WITH_SCENES:
        add_scene(scenes, plan, fences)
    if fences:
        add_earlier_acks(random.Random(f"acks {seed}"), plan)
    deleted = random.Random(f"deleted fences {seed}")
    compared = [name for name in fences if FENCED[name][0] != "other"]
    if layer != "core" and compared and deleted.random() < WITH_DELETED_FENCES:
        deleted.choice(lives)["clients"].append(fence_deleted(deleted, deleted.choice(compared)))
        plan["limits"] |= {"max_hulls": 10, "max_points": 100}
        plan["fences"] |= {"max_fences": 10}
    refused = random.Random(f"refused streams {seed}")
    if immediate and refused.random() < WITH_REFUSED_STREAMS:
        refused.choice(lives)["clients"].append(refused_stream(refused, names[0]))
        plan["limits"] |= {"max_hulls": 10, "max_points": 100}
    quarantine = random.Random(f"quarantine {seed}")
    held = [name for name in timed if name in QUARANTINED]
    if held and quarantine.random() < WITH_QUARANTINE:
        _add_quarantine(quarantine, plan, held)
    restores = random.Random(f"restores {seed}")
    if layer == "sqlite" and restores.random() < WITH_RESTORES[not fences]:
        _add_restore(restores, plan, (names, timed, fences), weights)
    queries = random.Random(f"queries {seed}")
    if layer != "core" and queries.random() < WITH_QUERIES:
        for _ in range(queries.choice(QUERIES)):
            client = queries.choice(queries.choice(lives)["clients"])
            client.insert(queries.randint(0, len(client)), query(queries, (*names, *timed)))
    past = random.Random(f"past {seed}")
    keeping = may_keep((*names, *timed))
    if keeping and past.random() < with_past and not immediate:
        add_past(past, plan, keeping)
    alarms = random.Random(f"alarms {seed}")
    if alarms.random() < WITH_ALARMS:
        add_alarms(alarms, plan, (*names, *timed))
    return plan


def _cluster_plan(seed: int) -> Plan:
    plan, alarms = random_cluster_plan(seed), random.Random(f"alarms {seed}")
    past = random.Random(f"past {seed}")
    if past.random() < WITH_PAST["cluster"]:
        add_past_to_cluster(past, plan, NAMES_IN_CLUSTER)
        return plan
    if alarms.random() < WITH_ALARMS_IN_CLUSTER:
        add_alarms_to_cluster(alarms, plan, (*NAMES_IN_CLUSTER, "k"))
    return plan


def _add_restore(draw: random.Random, plan: Plan, names: Names, weights: dict[str, int]) -> None:
    """A backup in one life, more of it, perhaps more lives, and one that begins with what the backup has."""
    lives = plan["lives"]
    backed_up = draw.randrange(len(lives))
    clients = lives[backed_up]["clients"]
    if draw.random() < WITH_SCENES:
        clients.insert(0, numbered_writes(draw, names[0][0]))
    compared = [name for name in names[2] if FENCED[name][0] != "other"]
    if compared and draw.random() < WITH_SCENES:
        clients.append(fence_changes(draw, draw.choice(compared)))
        plan["fences"] |= {"max_fences": 10, "max_fence_consumers": 10}
    client = draw.choice((clients[0], clients[-1], draw.choice(clients)))
    client.insert(draw.randint(0, len(client)), {"do": "backup"})
    after = _life(draw, names, weights) | {"restored": True}
    after["clients"].insert(0, numbered_writes(draw, names[0][0]))
    lives.insert(draw.choice((backed_up + 1, draw.randint(backed_up + 1, len(lives)))), after)


def _add_quarantine(draw: random.Random, plan: Plan, names: list[str]) -> None:
    """Hulls have rules, and clients let positions in, drop them and change the rules."""
    for life in plan["lives"]:
        for client in life["clients"]:
            for op in client:
                if op["do"] == "create" and op["name"] in names and draw.random() < 0.8:
                    op["quarantine"] = random_rules(draw)
        for _ in range(draw.choice(REQUESTS)):
            client = draw.choice(life["clients"])
            client.insert(draw.randint(0, len(client)), of_quarantine(draw, draw.choice(names)))
    draw.choice(plan["lives"])["clients"].append(positions_held(draw, plan["layer"], draw.choice(names)))
    plan["limits"] |= {"max_hulls": 10, "max_points": 100}


def _life(draw: random.Random, names: Names, weights: dict[str, int]) -> dict[str, Any]:
    most = 7 if names[2] else 4  # what fences say is seen later than what hulls hold
    clients = [
        [operation(draw, names, weights) for _ in range(draw.randint(1, most))]
        for _ in range(draw.choice((1, 2, 2, 3, 4)))
    ]
    life: dict[str, Any] = {"clients": clients, "end": draw.choice(ENDS)}
    if draw.random() < 0.5:
        life["after"] = int(draw.expovariate(1 / 25))
    return life


def _fault(draw: random.Random, layer: str) -> dict[str, Any]:
    at = draw.choice(PLACES[layer])
    commit_faults = SQLITE_FAULTS if layer == "sqlite" else COMMIT_FAULTS
    return {
        "at": at,
        "nth": 1 + int(draw.expovariate(1 / 4)),
        "kind": draw.choice(commit_faults if at == "commit" else OTHER_FAULTS),
        "calls": draw.choice((1, 1, 1, 2, 5, 20)),
    }
