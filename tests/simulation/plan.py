"""What happens in a simulated run, as data: lives of a server, what clients do, what fails, and how a life ends.

A plan is a dictionary that JSON can hold, so that one that found something can be shrunk and kept. The schedule, which
says who comes when, is drawn from the plan's seed and nothing else.

    {"seed": 7, "layer": "core", "limits": {...},
     "lives": [{"clients": [[operation, ...], ...], "end": "kill", "after": 40}, ...],
     "faults": [{"at": "commit", "nth": 3, "kind": "ghost", "calls": 1}, ...]}

A life with `restored` begins with the last backup in place of what the life before has left.
An operation names what to do and to which hull; with `leave` its caller disconnects after that number of turns.
"""

import random
from typing import Any

from .cluster_plan import Operation, Plan, random_cluster_plan
from .globe import CENTERS, FAR, GLOBE
from .link_plan import random_link_plan

NAMES = ("a", "b", "c")
# Hulls with keys, and of which type these are; and one of points in a window.
TIMED = {"k": "str", "w": "multiset", "l": "int", "kk": "str", "gk": "str", "gw": "multiset"}

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

# In plans with fences, beside these. Fences have names of their own; each has its kind of subjects.
FENCES = {
    "fence": 20,
    "refence": 10,
    "unfence": 5,
    "follow": 10,
    "ack": 12,
    "unack": 2,
    "inside": 4,
    "keep": 15,
}
FENCED = {"f": ("hull", "k"), "g": ("prefix", "k"), "h": ("other", "k"), "i": ("hull", "l")}
AREAS = ("a", "k", "kk", "l", "w")
# The share of plans with fences.
WITH_FENCES = 0.12

# How often a plan with hulls on the globe asks for another centre, and the share of plans with such hulls.
RECENTERS = 20
ON_GLOBE = 0.1

# The share of the shell's plans in which clients send streams of reads, and how many of these there are.
WITH_QUERIES = 0.2
QUERIES = (1, 1, 2, 4)
# Where points of the parabola are asked for: most batches insert one of these.
PLACES_ASKED = 12

# The share of the plans with keys in which bad positions are held out, and how many requests there are about that.
WITH_QUARANTINE = 0.3
QUARANTINED = ("k", "kk", "l")
REQUESTS = (1, 2, 4, 8)

# The share of plans with fences in which a client does what hardly ever comes together by chance.
WITH_SCENES = 0.5

# The share of acknowledgements after which the consumer acknowledges an earlier event, and how far it goes back.
WITH_EARLIER_ACKS = 0.3
EARLIER = (1, 3)

# The share of the engine's plans with fences in which one is deleted repeatedly, while old events are dropped.
WITH_DELETED_FENCES = 0.3

# The share of plans with immediate commits in which a stream goes on after a batch that is refused.
WITH_REFUSED_STREAMS = 0.3

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
        return random_cluster_plan(seed)
    if layer == "links":
        return random_link_plan(seed)
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
            create = {"do": "create", "name": name, "max_points": 0} | _settings(draw, name)
            lives[0]["clients"][0].insert(0, create)
    if with_fences:
        lives[0]["clients"][0][len(timed) :] = [_of_fence(draw, "fence", name) for name in fences] + lives[0][
            "clients"
        ][0][len(timed) :]
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
        draw.choice(lives)["clients"] += _recall_beside_delete(draw, names[0])
        plan["limits"]["resume_bytes"] = 0
    scenes = random.Random(f"scenes {seed}")  # the other plans stay as they were
    if fences and scenes.random() < WITH_SCENES:
        _add_scene(scenes, plan, fences)
    if fences:
        _add_earlier_acks(random.Random(f"acks {seed}"), plan)
    deleted = random.Random(f"deleted fences {seed}")
    compared = [name for name in fences if FENCED[name][0] != "other"]
    if layer != "core" and compared and deleted.random() < WITH_DELETED_FENCES:
        deleted.choice(lives)["clients"].append(_fence_deleted(deleted, deleted.choice(compared)))
        plan["limits"] |= {"max_hulls": 10, "max_points": 100}
        plan["fences"] |= {"max_fences": 10}
    refused = random.Random(f"refused streams {seed}")
    if immediate and refused.random() < WITH_REFUSED_STREAMS:
        refused.choice(lives)["clients"].append(_refused_stream(refused, names[0]))
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
            client.insert(queries.randint(0, len(client)), _query(queries, (*names, *timed)))
    return plan


def _add_restore(draw: random.Random, plan: Plan, names: "Names", weights: dict[str, int]) -> None:
    """A backup in one life, more of it, perhaps more lives, and one that begins with what the backup has."""
    lives = plan["lives"]
    backed_up = draw.randrange(len(lives))
    clients = lives[backed_up]["clients"]
    if draw.random() < WITH_SCENES:
        clients.insert(0, _numbered(draw, names[0][0]))
    compared = [name for name in names[2] if FENCED[name][0] != "other"]
    if compared and draw.random() < WITH_SCENES:
        clients.append(_fence_changes(draw, draw.choice(compared)))
        plan["fences"] |= {"max_fences": 10, "max_fence_consumers": 10}
    client = draw.choice((clients[0], clients[-1], draw.choice(clients)))
    client.insert(draw.randint(0, len(client)), {"do": "backup"})
    after = _life(draw, names, weights) | {"restored": True}
    after["clients"].insert(0, _numbered(draw, names[0][0]))
    lives.insert(draw.choice((backed_up + 1, draw.randint(backed_up + 1, len(lives)))), after)


def _numbered(draw: random.Random, name: str) -> list[Operation]:
    """A writer's batches, among which a backup may come."""
    write = {"do": "write", "name": name, "create": name not in GLOBE, "numbered": True, "rows": 1}
    rest = {"do": "rest", "name": name, "seconds": 0.01}
    return draw.choices([write, write, rest], k=draw.randint(3, 8))


def _query(draw: random.Random, names: tuple[str, ...]) -> Operation:
    """A stream of reads. Between two looks at a hull of points, other points are located in it."""
    messages = []
    for _ in range(draw.choice((1, 2, 5))):
        reads: list[Operation] = []
        for name in draw.choices(names, k=draw.choice((1, 1, 3))):
            look: Operation = {"name": name}
            located = [
                look | {"at": draw.sample(range(1, PLACES_ASKED), draw.choice((1, 1, 1, 3)))}
                for _ in range(draw.choice((0, 2, 5)) if name in NAMES else 0)
            ]
            reads += [look, *located, look]
        messages.append(reads)
    op: Operation = {"do": "query", "messages": messages}
    if draw.random() < 0.2:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op


def _add_quarantine(draw: random.Random, plan: Plan, names: list[str]) -> None:
    """Hulls have rules, and clients let positions in, drop them and change the rules."""
    for life in plan["lives"]:
        for client in life["clients"]:
            for op in client:
                if op["do"] == "create" and op["name"] in names and draw.random() < 0.8:
                    op["quarantine"] = _rules(draw)
        for _ in range(draw.choice(REQUESTS)):
            client = draw.choice(life["clients"])
            client.insert(draw.randint(0, len(client)), _request(draw, draw.choice(names)))
    draw.choice(plan["lives"])["clients"].append(_positions_held(draw, plan["layer"], draw.choice(names)))
    plan["limits"] |= {"max_hulls": 10, "max_points": 100}


def _request(draw: random.Random, name: str) -> Operation:
    """Keys are let in and dropped, or there are other rules."""
    op = {"do": "rules", "name": name, "rules": _rules(draw)}
    if draw.random() < 0.8:
        keys = draw.sample(range(4), draw.choice((1, 2, 4)))
        op = {"do": "release", "name": name, "releases": keys[::2], "drops": keys[1::2]}
    op["rows"] = draw.choice((1, 1, 200))
    if draw.random() < 0.2:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op


def _positions_held(draw: random.Random, layer: str, name: str) -> list[Operation]:
    """Three keys make a small hull; others move far away, and there perhaps farther."""
    create = {"do": "create", "name": name, "max_points": 0} | _settings(draw, name)
    rules = {"max_speed": draw.choice((None, None, 1e5)), "max_growth": 10.0, "confirmations": draw.choice((1, 1, 2))}
    scene: list[Operation] = [create | {"quarantine": rules}]
    put = {"do": "put", "name": name, "create": True, "numbered": False, "rows": 1, "time": 0, "removes": []}
    scene.append(put | {"keys": [0, 1, 2]})
    for _ in range(draw.randint(4, 12)):
        op = put | {"keys": draw.sample(range(4), draw.choice((1, 1, 2)))}
        if draw.random() < 0.3:
            op |= _puts(draw) | {"keys": op["keys"]}
        others = [_request(draw, name)] * 2 + [{"do": "snapshot", "name": name}] * (layer == "core")
        scene.append(draw.choice([op] * 6 + others))
        if draw.random() < 0.5:
            scene.append({"do": "tick" if layer == "core" else "rest", "name": name, "seconds": 0.1})
    return scene


def _rules(draw: random.Random) -> dict[str, Any]:
    """The rules of a quarantine; points are on the parabola, one farther out than the other."""
    return {
        "max_speed": draw.choice((None, 1.0, 100.0, 1e5)),
        "max_growth": draw.choice((None, 1.0, 1.5, 10.0)),
        "confirmations": draw.choice((0, 1, 1, 2)),
    }


def _recall_beside_delete(draw: random.Random, name: str) -> list[list[Operation]]:
    """Two clients: one writes to a hull and recalls it, the other deletes it."""
    write = {"do": "write", "name": name, "create": name not in GLOBE, "numbered": False, "rows": 1}
    recalls = [{"do": "recall", "name": name, "back": draw.randint(0, 1)} for _ in range(draw.randint(1, 3))]
    return [[write, write, *recalls], [{"do": "rest", "seconds": 0.001}, {"do": "delete", "name": name}]]


def _add_scene(draw: random.Random, plan: Plan, fences: tuple[str, ...]) -> None:
    """In one life a client is alone with a fence, and perhaps one of its commits fails."""
    compared = [name for name in fences if FENCED[name][0] != "other"]
    if not compared:
        return
    name = draw.choice(compared)
    scenes = [_area_moves, _fence_changes, *([_few_events_dropped] if plan["layer"] == "core" else [])]
    scene = draw.choice(scenes)
    life = draw.choice(plan["lives"])
    life["clients"] = [scene(draw, name)]
    life.pop("after", None)
    if scene is not _few_events_dropped and plan["storage"] != "immediate":
        fault = {"at": "commit", "nth": draw.randint(4, 14), "kind": draw.choice(("lost", "full")), "calls": 1}
        plan["faults"] = [fault]
    plan["limits"] |= {"max_hulls": 10, "max_points": 100}
    plan["fences"] |= {"max_fences": 10, "max_fence_consumers": 10}


def _fence_of_scene(name: str, area: dict[str, Any]) -> list[Operation]:
    """A fence, without margin and waiting, with or without keys before it."""
    kind, subjects = FENCED[name]
    config = {"kind": kind, "subjects": subjects, "initial": "events", "area": area, "closed": True, "margin": 0.0}
    return [
        {"do": "write", "name": "a", "create": True, "numbered": False, "rows": 1},
        {"do": "create", "name": subjects, "max_points": 0, "by_event_time": False},
        {"do": "fence", "name": name, "rows": 1, "config": config},
        {"do": "refence", "name": name, "rows": 1, "config": config},
    ]


def _key_moves(draw: random.Random, fence: str) -> Operation:
    """A key moves to a place that is inside of the area `a` as soon as this has a later point."""
    put = {"do": "put", "name": FENCED[fence][1], "create": True, "numbered": False, "rows": 1, "lift": 2}
    return put | {"keys": [draw.randrange(4)], "removes": []}


def _area_moves(draw: random.Random, name: str) -> list[Operation]:
    """Keys enter a fence because its area grows."""
    write = {"do": "write", "name": "a", "create": True, "numbered": False, "rows": 1}
    scene = _fence_of_scene(name, {"hull": "a"})
    for _ in range(draw.randint(2, 5)):
        scene += [_key_moves(draw, name), write]
    return [*scene, write]


def _fence_changes(draw: random.Random, name: str) -> list[Operation]:
    """A fence gets events, consumers and other areas: some commits change no hull."""
    scene = _fence_of_scene(name, {"strips": 2, "holes": False})
    for _ in range(draw.randint(3, 8)):
        ack = {"do": "ack", "name": name, "rows": 1, "consumer": "x", "back": 0}
        scene.append(draw.choice((ack, ack, _key_moves(draw, name), _of_fence(draw, "refence", name))))
    return scene


def _few_events_dropped(draw: random.Random, name: str) -> list[Operation]:
    """A consumer acknowledges all events, perhaps another one comes, and all are dropped."""
    scene = _fence_of_scene(name, {"strips": 2, "holes": False})
    of_fence = {"name": name, "rows": 1, "consumer": "x", "back": 0, "most": 1_000}
    for _ in range(draw.randint(2, 5)):
        scene += [of_fence | {"do": "ack"}, _key_moves(draw, name), of_fence | {"do": "keep"}]
    return [*scene, of_fence | {"do": "follow"}]


def _add_earlier_acks(draw: random.Random, plan: Plan) -> None:
    """Consumers acknowledge events, and then earlier ones."""
    for life in plan["lives"]:
        for client in life["clients"]:
            acks = [op for op in client if op["do"] == "ack" and draw.random() < WITH_EARLIER_ACKS]
            for ack in acks:
                client.insert(client.index(ack) + 1, ack | {"back": draw.choice(EARLIER)})


def _fence_deleted(draw: random.Random, name: str) -> list[Operation]:
    """A fence that keeps one event is deleted at any time from round to round of its keeping, and made again."""
    write, create, fence, _ = _fence_of_scene(name, {"strips": 1, "holes": False})
    fence["config"]["max_events"] = 1
    scene = [write, create]
    for _ in range(draw.randint(3, 6)):
        moves = [_key_moves(draw, name) for _ in range(4)]
        rest = {"do": "rest", "name": name, "seconds": draw.uniform(0.0, 1.0)}
        scene += [fence, *moves, rest, {"do": "unfence", "name": name, "rows": 1}]
    return scene


def _refused_stream(draw: random.Random, name: str) -> list[Operation]:
    """A stream of which a batch is refused, and a later one would not be. None waits for the answers before it."""
    write = {"do": "write", "name": name, "create": name not in GLOBE, "numbered": False, "rows": 1}
    batches = draw.randint(3, 6)
    return [write, write | {"do": "stream", "delete": "nowhere", "batches": batches, "window": batches}]


# The names of hulls of points, of hulls with keys or a window, and of fences.
Names = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]


def _life(draw: random.Random, names: Names, weights: dict[str, int]) -> dict[str, Any]:
    most = 7 if names[2] else 4  # what fences say is seen later than what hulls hold
    clients = [
        [_operation(draw, names, weights) for _ in range(draw.randint(1, most))]
        for _ in range(draw.choice((1, 2, 2, 3, 4)))
    ]
    life: dict[str, Any] = {"clients": clients, "end": draw.choice(ENDS)}
    if draw.random() < 0.5:
        life["after"] = int(draw.expovariate(1 / 25))
    return life


def _operation(draw: random.Random, all_names: Names, weights: dict[str, int]) -> Operation:
    names, timed, fences = all_names
    do = draw.choices(list(weights), list(weights.values()))[0]
    if do in FENCES:
        op = _of_fence(draw, do, draw.choice(fences))
        if draw.random() < 0.2:
            op["leave"] = int(draw.expovariate(1 / 3))
        return op
    every = (*names, *timed)
    op: Operation = {"do": do, "name": draw.choice({"write": names, "stream": names, "put": timed}.get(do, every))}
    if do == "put":
        # A first batch makes neither windows nor hulls on the globe.
        op["create"] = op["name"] not in ("w", *GLOBE) and draw.random() < 0.5
        op["numbered"] = draw.random() < 0.5
        op["rows"] = draw.choice((1, 1, 1, 200))
        op |= _puts(draw)
        if fences:
            op["lift"] = draw.choice((0, 0, 2, 30))
    elif do in ("write", "stream"):
        op["create"] = op["name"] not in GLOBE and draw.random() < 0.7
        op["numbered"] = draw.random() < 0.5
        op["rows"] = draw.choice((1, 1, 1, 200, 200, 200_000))
        if draw.random() < 0.2:
            op["delete"] = draw.choice(("strict", "lenient", "nowhere"))
        if draw.random() < 0.03:
            op["torn"] = draw.randint(1, 4)
        if do == "stream":
            op["batches"] = draw.randint(1, 5)
            op["window"] = draw.randint(1, 5)
            op["message"] = draw.choice((1, 1, 2, 3, 5))
        elif draw.random() < 0.05:
            op["shared"] = True
        if op["numbered"] and draw.random() < 0.3:
            op["skips"] = [draw.choice((0, 0, 1, 3, -1, -2)) for _ in range(op.get("batches", 1))]
    elif do == "together":
        op["names"] = draw.sample(every, draw.randint(2, len(every)))
        op["numbered"] = draw.random() < 0.5
        op["rows"] = draw.choice((1, 1, 200))
        if draw.random() < 0.3:
            op["delete"] = draw.choice(("strict", "lenient", "nowhere"))
        if draw.random() < 0.05:
            op["torn"] = draw.randint(1, 4)
        op |= _puts(draw)
    elif do == "delete":
        if draw.random() < 0.01:
            op["crowd"] = 400
    elif do == "create":
        op["max_points"] = draw.choice((0, 0, 2))
        op |= _settings(draw, op["name"])
    elif do == "recenter":
        op["name"] = draw.choice([name for name in every if name in GLOBE])
        op["center"] = draw.choice((None, *CENTERS, *CENTERS, FAR))
        op["rows"] = draw.choice((1, 200_000))
    elif do in ("rest", "tick"):
        op["seconds"] = 10 ** draw.uniform(-3, 0.8)
    elif do in ("recall", "watch"):
        op["back"] = draw.randint(0, 3)
    elif do == "read":
        op["rows"] = draw.choice((1, 1, 200))
    if do in ("write", "put", "stream", "together") and op.get("names", [op["name"]])[-1] in GLOBE:
        op["far"] = draw.random() < 0.1
    if draw.random() < 0.2:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op


def _of_fence(draw: random.Random, do: str, name: str) -> Operation:
    """A request about a fence."""
    op: Operation = {"do": do, "name": name, "rows": draw.choice((1, 1, 200, 5_000))}
    if do in ("fence", "refence"):
        op["config"] = _config(draw, *FENCED[name])
    elif do in ("ack", "unack"):
        op["consumer"] = draw.choice(("x", "x", "y"))
        op["back"] = draw.choice((None, 0, 0, 1, 3))
    else:
        op["back"] = draw.choice((0, 0, 1, 5, 50))
        op["most"] = draw.choice((1, 3, 1_000))
    return op


def _config(draw: random.Random, kind: str, subjects: str) -> dict[str, Any]:
    """The settings of a fence; times in microseconds."""
    config: dict[str, Any] = {
        "kind": kind,
        "subjects": subjects,
        "initial": draw.choice(("snapshot", "events", "none")),
    }
    hull = draw.choice(("a", "a", "a", *AREAS))
    if kind == "other":
        while hull == subjects:
            hull = draw.choice(AREAS)
        return config | {"area": {"hull": hull}, "near": draw.choice((0.0, 0.0, 2.0, 50.0))}
    match draw.choice(("hull", "hull", "strips", "strips", "circle", "others")):
        case "hull":
            config["area"] = {"hull": hull}
        case "strips":
            config["area"] = {"strips": draw.choice((1, 2, 3)), "holes": draw.random() < 0.3}
        case "circle":
            config["area"] = {"circle": draw.randint(3, 15), "radius": draw.choice((0, 5, 20, 200))}
        case "others":
            config["area"] = {"hull": "l" if subjects == "l" else "k", "without_self": kind == "hull"}
    config["margin"] = draw.choice((0.0, 0.0, 1.0, 30.0))
    if config["area"].get("without_self"):
        return config | {"margin": draw.choice((0.5, 20.0))}
    config["closed"] = "hull" in config["area"] or draw.random() < 0.7
    config["crosses"] = config["closed"] and draw.random() < 0.4
    if draw.random() < 0.3:
        config["dwell"] = draw.choice((1, 100_000, 400_000))
    if draw.random() < 0.3:
        config[draw.choice(("max_events", "max_event_age"))] = draw.choice((1, 4, 1_000_000))
    return config


def _settings(draw: random.Random, name: str) -> dict[str, Any]:
    """Of a hull with keys or a window, or on the globe; times in microseconds."""
    center = {"center": draw.choice((None, *CENTERS))} if name in GLOBE else {}
    return center | (_timed_settings(draw, name) if name in TIMED else {})


def _timed_settings(draw: random.Random, name: str) -> dict[str, Any]:
    keyed = TIMED[name] != "multiset"
    settings: dict[str, Any] = {"by_event_time": keyed and draw.random() < 0.5}
    if draw.random() < 0.8 or not keyed:
        window = {"max_age": draw.choice((0, 300_000, 1_000_000)), "clock": draw.choice(("server", "data"))}
        window["max_points"] = draw.choice((0, 0, 2) if window["max_age"] else (1, 2))
        if draw.random() < 0.5:
            window |= {"max_skew": draw.choice((0, 500_000)), "clamps": draw.random() < 0.5}
        settings["window"] = window
    return settings


def _puts(draw: random.Random) -> dict[str, Any]:
    """What a batch does to keys, or to points with times; times in microseconds from now on."""
    puts: dict[str, Any] = {
        "keys": draw.sample(range(4), draw.randint(0, 3)),
        "removes": draw.sample(range(4), draw.choice((0, 0, 1, 2))),
    }
    if draw.random() < 0.8:
        puts["time"] = draw.choice((0, 0, 200_000, 700_000, -200_000, -700_000, -5_000_000))
    if draw.random() < 0.2:
        puts["only"] = draw.choice(("absent", "present"))
    if draw.random() < 0.2:
        puts[draw.choice(("ttl", "deadline"))] = draw.choice((1, 200_000, 900_000))
    if draw.random() < 0.1:
        puts["refuse"] = True
    return puts


def _fault(draw: random.Random, layer: str) -> dict[str, Any]:
    at = draw.choice(PLACES[layer])
    commit_faults = SQLITE_FAULTS if layer == "sqlite" else COMMIT_FAULTS
    return {
        "at": at,
        "nth": 1 + int(draw.expovariate(1 / 4)),
        "kind": draw.choice(commit_faults if at == "commit" else OTHER_FAULTS),
        "calls": draw.choice((1, 1, 1, 2, 5, 20)),
    }
