"""Operations in an order that hardly ever comes together by chance."""

import random
from typing import Any

from .cluster_plan import Operation, Plan
from .globe import GLOBE
from .operations import FENCED, of_fence, of_quarantine, puts_of, settings_of

# The share of plans with fences in which a client does what hardly ever comes together by chance.
WITH_SCENES = 0.5

# The share of acknowledgements after which the consumer acknowledges an earlier event, and how far it goes back.
WITH_EARLIER_ACKS = 0.3
EARLIER = (1, 3)


def positions_held(draw: random.Random, layer: str, name: str) -> list[Operation]:
    """Three keys make a small hull; others move far away, and there perhaps farther."""
    create = {"do": "create", "name": name, "max_points": 0} | settings_of(draw, name)
    rules = {"max_speed": draw.choice((None, None, 1e5)), "max_growth": 10.0, "confirmations": draw.choice((1, 1, 2))}
    scene: list[Operation] = [create | {"quarantine": rules}]
    put = {"do": "put", "name": name, "create": True, "numbered": False, "rows": 1, "time": 0, "removes": []}
    scene.append(put | {"keys": [0, 1, 2]})
    for _ in range(draw.randint(4, 12)):
        op = put | {"keys": draw.sample(range(4), draw.choice((1, 1, 2)))}
        if draw.random() < 0.3:
            op |= puts_of(draw) | {"keys": op["keys"]}
        others = [of_quarantine(draw, name)] * 2 + [{"do": "snapshot", "name": name}] * (layer == "core")
        scene.append(draw.choice([op] * 6 + others))
        if draw.random() < 0.5:
            scene.append({"do": "tick" if layer == "core" else "rest", "name": name, "seconds": 0.1})
    return scene


def recall_beside_delete(draw: random.Random, name: str) -> list[list[Operation]]:
    """Two clients: one writes to a hull and recalls it, the other deletes it."""
    write = {"do": "write", "name": name, "create": name not in GLOBE, "numbered": False, "rows": 1}
    recalls = [{"do": "recall", "name": name, "back": draw.randint(0, 1)} for _ in range(draw.randint(1, 3))]
    return [[write, write, *recalls], [{"do": "rest", "seconds": 0.001}, {"do": "delete", "name": name}]]


def add_scene(draw: random.Random, plan: Plan, fences: tuple[str, ...]) -> None:
    """In one life a client is alone with a fence, and perhaps one of its commits fails."""
    compared = [name for name in fences if FENCED[name][0] != "other"]
    if not compared:
        return
    name = draw.choice(compared)
    scenes = [_area_moves, fence_changes, *([_few_events_dropped] if plan["layer"] == "core" else [])]
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


def fence_changes(draw: random.Random, name: str) -> list[Operation]:
    """A fence gets events, consumers and other areas: some commits change no hull."""
    scene = _fence_of_scene(name, {"strips": 2, "holes": False})
    for _ in range(draw.randint(3, 8)):
        ack = {"do": "ack", "name": name, "rows": 1, "consumer": "x", "back": 0}
        scene.append(draw.choice((ack, ack, _key_moves(draw, name), of_fence(draw, "refence", name))))
    return scene


def _few_events_dropped(draw: random.Random, name: str) -> list[Operation]:
    """A consumer acknowledges all events, perhaps another one comes, and all are dropped."""
    scene = _fence_of_scene(name, {"strips": 2, "holes": False})
    of_fence = {"name": name, "rows": 1, "consumer": "x", "back": 0, "most": 1_000}
    for _ in range(draw.randint(2, 5)):
        scene += [of_fence | {"do": "ack"}, _key_moves(draw, name), of_fence | {"do": "keep"}]
    return [*scene, of_fence | {"do": "follow"}]


def add_earlier_acks(draw: random.Random, plan: Plan) -> None:
    """Consumers acknowledge events, and then earlier ones."""
    for life in plan["lives"]:
        for client in life["clients"]:
            acks = [op for op in client if op["do"] == "ack" and draw.random() < WITH_EARLIER_ACKS]
            for ack in acks:
                client.insert(client.index(ack) + 1, ack | {"back": draw.choice(EARLIER)})


def fence_deleted(draw: random.Random, name: str) -> list[Operation]:
    """A fence that keeps one event is deleted at any time from round to round of its keeping, and made again."""
    write, create, fence, _ = _fence_of_scene(name, {"strips": 1, "holes": False})
    fence["config"]["max_events"] = 1
    scene = [write, create]
    for _ in range(draw.randint(3, 6)):
        moves = [_key_moves(draw, name) for _ in range(4)]
        rest = {"do": "rest", "name": name, "seconds": draw.uniform(0.0, 1.0)}
        scene += [fence, *moves, rest, {"do": "unfence", "name": name, "rows": 1}]
    return scene


def refused_stream(draw: random.Random, name: str) -> list[Operation]:
    """A stream of which a batch is refused, and a later one would not be. None waits for the answers before it."""
    write = {"do": "write", "name": name, "create": name not in GLOBE, "numbered": False, "rows": 1}
    batches = draw.randint(3, 6)
    return [write, write | {"do": "stream", "delete": "nowhere", "batches": batches, "window": batches}]
