"""Plans with alarms: on the outline of one hull, or of all with a prefix."""

import random
from typing import Any

from dynhull_server.state.alarms.rule import marked

from .cluster_plan import Operation, Plan
from .globe import GLOBE
from .operations import TIMED, puts_of

# The share of plans with alarms, and of those of clusters.
WITH_ALARMS, WITH_ALARMS_IN_CLUSTER = 0.12, 0.25
ALARMS = tuple(map(marked, "xyz"))
# How often each is asked for; "move" changes the outline of a hull that is watched.
ASKED = {"move": 30, "pass": 14, "follow": 6, "ack": 5, "unack": 1, "take": 8, "mute": 6, "unfence": 2, "inside": 2}
# Most of these are attained by points of the parabola.
BOUNDS: dict[str, tuple[float, ...]] = {
    "area": (0, 0.5, 1, 3, 6, 10, 15, 60),
    "perimeter": (0, 7.3, 30.7, 100.9),
    "diameter": (0, 4, 10.5, 50),
    "width": (0, 0.25, 1, 2),
    "count": (0, 1, 2, 3, 5),
    "vertices": (0, 1, 2, 3, 5),
}
DISTANCES = (0, 0.5, 2, 50)
HOLDS = 0, 0, 0, 1, 100_000, 400_000
SILENCES = "1ms", "100ms", "400ms", "2s"
OPPOSITE = {">": "<=", ">=": "<", "<": ">=", "<=": ">"}
LOWEST, HIGHEST = -1_000, 10**7


def add_alarms(draw: random.Random, plan: Plan, names: tuple[str, ...]) -> None:
    """Alarms at some hulls, and clients that change these, follow the events and take care."""
    hulls = tuple(name for name in names if name not in GLOBE)
    if not hulls:
        return
    plan["limits"] |= {"max_hulls": 10, "max_points": 100}
    plan["fences"] |= {
        "max_fence_consumers": 10,
        "max_alarms": draw.choice((1, 10, 10, 10)),
        "max_alarm_hulls": draw.choice((2, 100, 100, 100)),
    }
    plan["alarms"] = True
    alarms = ALARMS[: draw.choice((1, 1, 2, 3))]
    asked = {do: often * draw.choice((0, 1, 1, 3)) for do, often in ASKED.items()} | {"move": 40, "pass": 14}
    if plan["layer"] == "core":
        asked["keep"] = 8
    clients = plan["lives"][0]["clients"]
    beginning = [_created(draw, alarm, hulls) for alarm in alarms]
    for hull in hulls:
        if draw.random() < 0.8:
            beginning.insert(0, _moved(draw, hull, streams=True))
    at = next((place for place, op in enumerate(clients[0]) if op["do"] not in ("create", "fence")), len(clients[0]))
    clients[0][at:at] = beginning
    for life in plan["lives"]:
        for client in life["clients"]:
            for _ in range(draw.choice((2, 4, 8))):
                client.insert(
                    draw.randint(at if client is clients[0] else 0, len(client)),
                    _asked(draw, plan, asked, alarms, hulls),
                )
        if draw.random() < 0.5:
            life["clients"].append([_asked(draw, plan, asked, alarms, hulls) for _ in range(draw.randint(4, 16))])


def add_alarms_to_cluster(draw: random.Random, plan: Plan, names: tuple[str, ...]) -> None:
    """Alarms at some hulls of a cluster, and clients of the database, and of its copy, that change these and follow."""
    plan["alarms"] = True
    alarms = ALARMS[: draw.choice((1, 1, 2))]
    asked = {do: often * draw.choice((0, 1, 1, 3)) for do, often in ASKED.items()} | {"move": 60, "pass": 10}
    beginning = [_moved(draw, hull, streams=False) for hull in names if draw.random() < 0.8]
    plan["clients"][0][:0] = beginning + [_created(draw, alarm, names) for alarm in alarms]
    begun = len(beginning) + len(alarms)
    for site in ("clients", "copied"):
        for client in plan[site]:
            for _ in range(draw.choice((2, 4, 8))):
                place = draw.randint(begun if client is plan["clients"][0] else 0, len(client))
                client.insert(place, _asked(draw, plan, asked, alarms, names))


def _asked(
    draw: random.Random, plan: Plan, asked: dict[str, int], alarms: tuple[str, ...], hulls: tuple[str, ...]
) -> Operation:
    op = _request(draw, plan, asked, alarms, hulls)
    if draw.random() < 0.1:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op


def _request(
    draw: random.Random, plan: Plan, asked: dict[str, int], alarms: tuple[str, ...], hulls: tuple[str, ...]
) -> Operation:
    do = draw.choices(list(asked), list(asked.values()))[0]
    name, hull = draw.choice(alarms), draw.choice(hulls)
    op: Operation = {"do": do, "name": name, "rows": draw.choice((1, 1, 200, 5_000))}
    match do:
        case "move":
            return _moved(draw, hull, streams=plan["layer"] != "cluster")
        case "pass":
            seconds = draw.choice((0.0, 0.05, 0.1, 0.4, 1.0, 3.0))
            return {"do": "tick" if plan["layer"] in ("core", "cluster") else "rest", "name": hull, "seconds": seconds}
        case "unfence" if draw.random() < 0.5:
            return _created(draw, name, hulls)
        case "take" | "mute":
            # Of a cluster, the clocks differ by seconds.
            later = (10**9,) if plan["layer"] == "cluster" else (1, 300_000, 10_000_000)
            op |= {"hull": hull, "until": draw.choice((-1_000_000, *later))}
        case "ack" | "unack":
            op |= {"consumer": draw.choice(("x", "x", "y")), "back": draw.choice((None, 0, 0, 1, 3))}
        case _:
            op |= {"back": draw.choice((0, 0, 1, 5, 50)), "most": draw.choice((1, 3, 1_000))}
    return op


def _moved(draw: random.Random, hull: str, *, streams: bool) -> Operation:
    """A batch that changes the outline of a hull, as a rule; perhaps a stream of them."""
    batch: Operation = {"name": hull, "create": hull not in ("w", *GLOBE), "numbered": draw.random() < 0.2, "rows": 1}
    if hull not in TIMED:
        batch |= {"do": "write"}
        if draw.random() < 0.4:
            batch["delete"] = "lenient"
    else:
        keys = {"keys": draw.sample(range(4), draw.choice((1, 1, 2, 3))), "time": 0}
        removes = draw.sample(range(4), draw.choice((0, 0, 1, 2, 3)))
        batch |= {"do": "put"} | (puts_of(draw) if draw.random() < 0.2 else {}) | keys | {"removes": removes}
        batch["lift"] = draw.choice((0, 0, 2, 30))
    if streams and draw.random() < 0.2:
        batch |= {"do": "stream", "batches": draw.randint(1, 5), "window": draw.randint(1, 5), "message": 2}
    return batch


def _created(draw: random.Random, name: str, hulls: tuple[str, ...]) -> Operation:
    kind, subjects = "other", draw.choice(hulls)
    if draw.random() < 0.4:
        kind, subjects = "prefix", subjects[0]
    when, clear = _rule(draw, subjects, [hull for hull in hulls if kind == "prefix" or hull != subjects])
    hold = 0 if when.startswith("silent") else draw.choice(HOLDS)
    config: dict[str, Any] = {"kind": kind, "subjects": subjects, "area": {"when": when, "clear": clear, "hold": hold}}
    if draw.random() < 0.3:
        config[draw.choice(("max_events", "max_event_age"))] = draw.choice((1, 4, 1_000_000))
    return {"do": "fence", "name": name, "rows": draw.choice((1, 1, 200, 5_000)), "config": config}


def _rule(draw: random.Random, hull: str, others: list[str]) -> tuple[str, str]:
    """What raises and what clears an alarm."""
    kind = draw.choice(("measure",) * 5 + ("silent", "near", "near", "vertex in", "vertex"))
    if kind == "silent":
        return f"silent {draw.choice(SILENCES)}", ""
    if kind == "near" and others:
        return _near(draw, draw.choice(others))
    if kind == "vertex in":
        return _negated(draw, f"vertex in {_area(draw, others)}")
    if kind == "vertex" and TIMED.get(hull, "multiset") != "multiset":
        return _negated(draw, f"vertex {draw.randrange(4)}")
    measure = draw.choice(list(BOUNDS))
    op, bound = draw.choice(list(OPPOSITE)), draw.choice(BOUNDS[measure])
    clear, other = OPPOSITE[op], bound
    if draw.random() < 0.5:
        weaker = [each for each in BOUNDS[measure] if (each < bound if op.startswith(">") else each > bound)]
        other = draw.choice(weaker) if weaker else bound
        if other != bound and draw.random() < 0.5:
            clear = draw.choice(("<", "<=") if op.startswith(">") else (">", ">="))
    return f"{measure} {op} {bound}", f"{measure} {clear} {other}"


def _near(draw: random.Random, other: str) -> tuple[str, str]:
    least, most = sorted(draw.choices(DISTANCES, k=2))
    near, far = f"near {other} {least}", f"not near {other} {most}"
    return (near, far) if draw.random() < 0.6 else (far, near)


def _negated(draw: random.Random, condition: str) -> tuple[str, str]:
    both = condition, f"not {condition}"
    return both if draw.random() < 0.6 else both[::-1]


def _area(draw: random.Random, others: list[str]) -> str:
    match draw.choice(("hull", "circle", "polygon")):
        case "hull" if others:
            return draw.choice(others)
        case "circle":
            x = draw.randint(3, 15)
            return f"circle({x}, {x * x}, {draw.choice((0, 5, 20, 200))})"
    x, width = draw.randint(1, 12), draw.choice((1, 3, 8))
    ring = (x, LOWEST), (x + width, LOWEST), (x + width, HIGHEST), (x, HIGHEST)
    return f"polygon({', '.join(f'{x} {y}' for x, y in ring)})"
