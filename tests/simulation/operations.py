"""What clients of a simulated run do: one operation each, drawn at random."""

import random
from typing import Any

from .cluster_plan import Operation
from .globe import CENTERS, FAR, GLOBE

NAMES = ("a", "b", "c")
# Hulls with keys, and of which type these are; and one of points in a window.
TIMED = {"k": "str", "w": "multiset", "l": "int", "kk": "str", "gk": "str", "gw": "multiset"}

# What is asked for in plans with fences beside the rest, and how often.
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
# Fences have names of their own; each has its kind of subjects.
FENCED = {"f": ("hull", "k"), "g": ("prefix", "k"), "h": ("other", "k"), "i": ("hull", "l")}
# The subjects of fences that ask for certain positions, with all of their settings.
BY_ACCURACY = ("l",)
# Lives begin at 01:46:40 UTC on a Sunday, or up to ten seconds later; days pass in some.
TIMES_OF_DAY = (
    "01:46:41 UTC",
    "01:46:45 UTC",
    "01:46:51 UTC mon-fri,sun",
    "03:46:50 Europe/Berlin",
    "02:30 America/New_York mon",
)
AREAS = ("a", "k", "kk", "l", "w")

# The names of hulls of points, of hulls with keys or a window, and of fences.
Names = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]

# Where points of the parabola are asked for: most batches insert one of these.
PLACES_ASKED = 12


def numbered_writes(draw: random.Random, name: str) -> list[Operation]:
    """A writer's batches, among which a backup may come."""
    write = {"do": "write", "name": name, "create": name not in GLOBE, "numbered": True, "rows": 1}
    rest = {"do": "rest", "name": name, "seconds": 0.01}
    return draw.choices([write, write, rest], k=draw.randint(3, 8))


def query(draw: random.Random, names: tuple[str, ...]) -> Operation:
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


def of_quarantine(draw: random.Random, name: str) -> Operation:
    """Keys are let in and dropped, or there are other rules."""
    op = {"do": "rules", "name": name, "rules": random_rules(draw)}
    if draw.random() < 0.8:
        keys = draw.sample(range(4), draw.choice((1, 2, 4)))
        op = {"do": "release", "name": name, "releases": keys[::2], "drops": keys[1::2]}
    op["rows"] = draw.choice((1, 1, 200))
    if draw.random() < 0.2:
        op["leave"] = int(draw.expovariate(1 / 3))
    return op


def random_rules(draw: random.Random) -> dict[str, Any]:
    """The rules of a quarantine; points are on the parabola, one farther out than the other."""
    return {
        "max_speed": draw.choice((None, 1.0, 100.0, 1e5)),
        "max_growth": draw.choice((None, 1.0, 1.5, 10.0)),
        "confirmations": draw.choice((0, 1, 1, 2)),
    }


def operation(draw: random.Random, all_names: Names, weights: dict[str, int]) -> Operation:
    names, timed, fences = all_names
    do = draw.choices(list(weights), list(weights.values()))[0]
    if do in FENCES:
        op = of_fence(draw, do, draw.choice(fences))
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
        op |= puts_of(draw)
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
        op |= puts_of(draw)
    elif do == "delete":
        if draw.random() < 0.01:
            op["crowd"] = 400
    elif do == "create":
        op["max_points"] = draw.choice((0, 0, 2))
        op |= settings_of(draw, op["name"])
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


def of_fence(draw: random.Random, do: str, name: str) -> Operation:
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
    forms = "hull", "hull", "strips", "strips", "circle", "hull" if subjects in BY_ACCURACY else "others"
    match draw.choice(forms):
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
    if kind == "hull" and draw.random() < 0.4:
        keys = draw.sample(range(5), draw.choice((1, 3)))
        config["expected"] = tuple(keys if subjects == "l" else map(str, keys))
        if draw.random() < 0.4:
            config["expected_by"] = draw.choice(TIMES_OF_DAY)
        else:
            config["expected_within"] = draw.choice((1, 100_000, 400_000, 2_000_000))
    if subjects in BY_ACCURACY:
        config |= {"by_accuracy": True, "margin": 0.0, "crosses": False}
    if draw.random() < 0.3:
        config["dwell"] = draw.choice((1, 100_000, 400_000))
    if draw.random() < 0.3:
        config[draw.choice(("max_events", "max_event_age"))] = draw.choice((1, 4, 1_000_000))
    return config


def settings_of(draw: random.Random, name: str) -> dict[str, Any]:
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


def puts_of(draw: random.Random) -> dict[str, Any]:
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
