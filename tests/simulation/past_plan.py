"""Plans with hulls that keep their past: they are written to until segments close, and read as they were."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dynhull_server.state.records import FOREVER
from dynhull_server.storage.rows import filing, past_rows

from .cluster_plan import Operation, Plan
from .globe import GLOBE
from .operations import TIMED
from .past_archive import DAMAGE, FILE_PLACES, LATE, STORE_PLACES
from .past_model import ERASED, NOBODY

# What clients ask of the past.
OF_PREFIXES = ("consume_many", "unconsume_many")
OF_PAST = ("as_of", "feed", "replay", "track", "keep_past", "erase", "consume", "unconsume")
READS = ("as_of", "as_of", "as_of", "feed", "replay", "track")

# How much is kept: for ever, for some seconds, or some bytes: about one segment, or some.
HISTORIES = [*[(FOREVER, 0)] * 5, (3_000_000, 0), (FOREVER, 4_000), (FOREVER, 20_000), (0, 0)]
SERVER_BYTES = (0, 0, 0, 0, 15_000)

# Points and keys after which a segment ends, and of which reads have some at a time; None for as many as usual.
SEGMENT_ROWS = (None, 1, 3)

# The share of lives in which time waits for slow threads: most, or they would be twice as long.
PATIENT = 0.7

# Seconds after which a hull may have a snapshot, and a segment be closed.
ROUND = 1.1
JUMPS = (-3600.0, -2.0, 2.0, 3600.0)

# The share of the plans with segments of many batches in which a hull is written to for longer than it keeps its past.
BEYOND_ITS_AGE = 0.1
AGE = 3_000_000

# The share of the plans in which feeds have consumers.
WITH_CONSUMERS = 0.4
# The share of what consumers do in the feeds of all hulls with a prefix.
OF_MANY = 0.35

# The share of the plans without backups in which the past is in an object store.
IN_STORE = 0.3

# The share of the cluster's plans with a past in which an owner cannot reach the database for a while.
IN_THE_DARK = 0.5

# The share of the cluster's plans with a past in which an owner stands still when it is to send a file, and others
# come.
STANDS_STILL = 0.3

# How the files of the past fail, where they are read too; how calls of a store do; and commits of steps of filing.
FILE_FAULTS = ("os", "disk full", "memory", "kill", "kill", "kill")
READ_FAULTS = ("os", "memory", "kill", *DAMAGE)
CALL_FAULTS = ("os", "os", "kill", "kill", *LATE, *LATE, *DAMAGE)
SEND_FAULTS = ("os", "kill", "torn", "torn", *LATE, *LATE)
STEP_FAULTS = ("kill", "kill", "ghost kill", "ghost kill", "full", "lost", "ghost", "memory", "ghost memory")


def add_past(draw: random.Random, plan: Plan, names: tuple[str, ...]) -> None:
    """Hulls keep their past; clients write to them, read them as they were, and perhaps erase from it."""
    plan["limits"] |= {"max_hulls": 10, "max_points": 100}
    plan["history_bytes"] = draw.choice(SERVER_BYTES)
    plan["segment_rows"] = draw.choice(SEGMENT_ROWS)
    files = plan["storage"] == "sqlite"
    backed_up = any(op["do"] == "backup" for life in plan["lives"] for client in life["clients"] for op in client)
    plan["store"] = files and not backed_up and draw.random() < IN_STORE
    for life in plan["lives"]:
        life["clock"] = draw.choice((0, 0, *JUMPS))
        life["patient"] = draw.random() < PATIENT
        if "after" in life:
            life["after"] = int(draw.expovariate(1 / 400))
        for client in life["clients"]:
            for op in client:
                if op["do"] == "create" and files:
                    op |= kept(draw)
            for _ in range(draw.randint(0, 3)):
                client.insert(draw.randint(0, len(client)), of_past(draw, draw.choice(names), files=files))
        name, rounds = draw.choice(names), draw.randint(2, 6)
        life["clients"].append(written_until_filed(draw, name, rounds=rounds, reads=(0, 1, 2), files=files))
    fed = random.Random(f"fed {plan['seed']}")
    if fed.random() < WITH_CONSUMERS:
        for life in plan["lives"]:
            _add_consumers(fed, life, fed.choice(names))
        if files and fed.random() < 0.5:
            fault = {"at": "consumer", "nth": fed.randint(1, 6), "kind": fed.choice(STEP_FAULTS), "calls": 1}
            plan["faults"].append(fault)
    aged = random.Random(f"aged {plan['seed']}")  # the other plans stay as they were
    if files and plan["segment_rows"] is None and aged.random() < BEYOND_ITS_AGE:
        aged.choice(plan["lives"])["clients"].append(written_beyond_its_age(aged.choice(names)))
    if files and draw.random() < 0.6:
        plan["faults"] += [fault_of_past(draw, in_store=plan["store"]) for _ in range(draw.choice((1, 1, 2, 3)))]


def add_past_to_cluster(draw: random.Random, plan: Plan, names: tuple[str, ...]) -> None:
    """Hulls keep their past for ever, in a store that all owners share; clients write to them, and read it."""
    plan["segment_rows"] = draw.choice(SEGMENT_ROWS)
    plan["faults"] = [_store_fault(draw) for _ in range(draw.choice((0, 0, 1, 2)))]
    creates = [_creation(name) | {"history": FOREVER, "history_bytes": 0} for name in names]
    for client in (*plan["clients"], *plan["copied"]):
        client[:0] = draw.sample(creates, draw.choice((0, 1, 2)))
        for _ in range(draw.randint(2, 8)):
            write = _writes(draw.choice(names))[0]
            client.insert(
                draw.randint(0, len(client)), draw.choice((write, write, {"do": "past", "name": write["name"]}))
            )
    plan["clients"][0][:0] = creates
    still = random.Random(f"still {plan['seed']}")  # the other plans stay as they were
    if still.random() < STANDS_STILL:
        plan["faults"] = [{"at": "send", "nth": still.randint(1, 3), "kind": "still", "calls": 1}]
        plan["clients"] = [[op for op in client if op["do"] != "delete"] for client in plan["clients"]]
        # One owner files, and the next one has time to remove what it finds.
        starts = [_fate(still, "start", 0) | {"after": still.randint(300, 2_000)} for _ in range(3)]
        plan["fates"] = [*starts, *plan["fates"][: still.randint(0, 3)], _fate(still, "start", 0)]
    if draw.random() < IN_THE_DARK:
        who, place = draw.randrange(2), draw.randint(0, len(plan["fates"]))
        plan["fates"][place:place] = [_fate(draw, "dark", who), _fate(draw, "light", who)]
        for client in plan["clients"]:
            client += [_writes(draw.choice(names))[0] for _ in range(draw.randint(0, 6))]


def _fate(draw: random.Random, do: str, who: int) -> dict[str, Any]:
    return {"do": do, "who": who, "site": 0, "after": int(draw.expovariate(1 / 200))}


def _store_fault(draw: random.Random) -> dict[str, Any]:
    kinds = {"call": ("os", *LATE), "send": ("os", "torn", *LATE), "answer": ("os",)}
    at = draw.choice(tuple(kinds))
    nth, calls = 1 + int(draw.expovariate(1 / 4)), draw.choice((1, 1, 2, 5))
    return {"at": at, "nth": nth, "kind": draw.choice(kinds[at]), "calls": calls}


def _add_consumers(draw: random.Random, life: dict[str, Any], name: str) -> None:
    """Consumers follow the feed of a hull, each from where it was in the life before."""
    clients = [*life["clients"], []]
    for _ in range(draw.choice((2, 4, 8))):
        op = consumes(draw, name)
        client = draw.choice((*clients, clients[-2]))
        client.insert(draw.randint(0, len(client)), op)
    life["clients"] = [each for each in clients if each]


def consumes(draw: random.Random, name: str) -> Operation:
    """A consumer of the feed of a hull, or of a prefix, reads on, or is deleted."""
    do = draw.choice(("consume",) * 9 + ("unconsume",))
    op: Operation = {"do": do, "name": name, "consumer": draw.randrange(2), "most": draw.choice((1, 1, 3, 100))}
    if draw.random() < OF_MANY:
        op |= {"do": f"{do}_many", "name": draw.choice(("", name[0], name))}
    if draw.random() < 0.15:
        op["leave"] = int(draw.expovariate(1 / 5))
    return op


def written_until_filed(
    draw: random.Random, name: str, *, rounds: int, reads: tuple[int, ...], files: bool = True
) -> list[Operation]:
    """A hull is written to, and rests until its snapshots and segments are written, again and again."""
    create = _creation(name)
    scene = [create | kept(draw) if files else create]
    write, put = _writes(name)
    for _ in range(rounds):
        for _ in range(draw.randint(1, 4)):
            if name not in TIMED:
                scene.append(write | ({"delete": "lenient"} if draw.random() < 0.3 else {}))
            else:
                keys = draw.sample((0, 1, 2, 3, ERASED), draw.choice((1, 2, 2)))
                removes = [key for key in (ERASED, draw.randrange(4)) if draw.random() < 0.3]
                scene.append(put | {"keys": keys, "removes": removes})
        if draw.random() < 0.8:
            scene.append({"do": "rest", "name": name, "seconds": draw.choice((0.3, ROUND, ROUND, 2 * ROUND))})
        scene += [of_past(draw, name, files=files) for _ in range(draw.choice(reads))]
    return scene


def written_and_erased(draw: random.Random, name: str) -> list[Operation]:
    """A key is put and removed, perhaps filed, and erased."""
    put = _writes(name)[1]
    rest: Operation = {"do": "rest", "name": name, "seconds": draw.choice((0.01, ROUND))}
    erase: Operation = {"do": "erase", "name": name, "at": 0.0} | beside(draw)
    gone = put | {"keys": [draw.randrange(4)], "removes": [ERASED]}
    return [put | {"keys": [ERASED, 0]}, *[rest] * draw.randint(0, 2), gone, *[rest] * draw.randint(0, 1), erase]


def beside(draw: random.Random) -> Operation:
    """Who else asks at once for the same key to be erased, or for one that never was; and one who goes away."""
    return {"others": draw.choices((ERASED, NOBODY), k=draw.choice((0, 0, 1, 2))), "goes": draw.random() < 0.2}


def changes_history(draw: random.Random, name: str) -> Operation:
    """Another part of the past is to be kept."""
    history, most_bytes = draw.choice(HISTORIES)
    return {"do": "keep_past", "name": name, "at": 0.0, "history": history, "history_bytes": most_bytes}


def written_beyond_its_age(name: str) -> list[Operation]:
    """A hull is written to until its first segments are too old, each for a while only in part."""
    write, put = _writes(name)
    one = put | {"keys": [0]} if name in TIMED else write
    rests: list[Operation] = [{"do": "rest", "name": name, "seconds": seconds} for seconds in (0.4, 0.7)]
    set_age: Operation = {"do": "keep_past", "name": name, "at": 0.0, "history": AGE, "history_bytes": 0}
    return [_creation(name), set_age, *[one, rests[0], one, rests[1]] * 7]


def _creation(name: str) -> Operation:
    """The creation of a hull, which has a window if its name says so."""
    create: Operation = {"do": "create", "name": name, "max_points": 0}
    return create | {"window": {"max_points": 2}} if name == "w" else create


def _writes(name: str) -> tuple[Operation, Operation]:
    """A batch of points, and one of keys, which names them yet."""
    write: Operation = {"do": "write", "name": name, "create": False, "numbered": False, "rows": 1}
    return write, write | {"do": "put", "removes": [], "time": 0}


def of_past(draw: random.Random, name: str, *, files: bool) -> Operation:
    """A request about the past."""
    do = draw.choice((*READS * 3, *(("keep_past", "erase", "erase") if files else ())))
    if draw.random() < 0.05:
        return {"do": "clock", "name": name, "seconds": draw.choice(JUMPS)}
    op: Operation = {"do": do, "name": name, "at": draw.random() ** draw.choice((1, 3))}
    if do == "erase":
        op |= beside(draw)
    if do == "keep_past":
        op["history"], op["history_bytes"] = draw.choice(HISTORIES)
    if do == "as_of" and draw.random() < 0.5:
        op["by"] = draw.choice((-1, 0, 0, 1, 1_000, 500_000))
    if do == "feed":
        op["most"] = draw.choice((1, 5, 100))
    if draw.random() < 0.15:
        op["leave"] = int(draw.expovariate(1 / 5))
    return op


def kept(draw: random.Random) -> Operation:
    """How much of the past is kept."""
    history, most_bytes = draw.choice(HISTORIES)
    return {"history": history, "history_bytes": most_bytes}


def fault_of_past(draw: random.Random, *, in_store: bool) -> dict[str, Any]:
    """A file, a call of a store, a step of filing or a read fails."""
    at = draw.choice((*(STORE_PLACES if in_store else FILE_PLACES), "step", "step", "settings", "history", "past"))
    match at:
        case "fetch":
            kinds: tuple[str, ...] = READ_FAULTS
        case "call":
            kinds = CALL_FAULTS
        case "send":
            kinds = SEND_FAULTS
        case "step" | "settings":
            kinds = STEP_FAULTS
        case "past":
            kinds = ("os", "memory")
        case "history" | "answer":
            kinds = ("os", "memory", "kill")
        case _:
            kinds = FILE_FAULTS
    more = {
        "nth": 1 + int(draw.expovariate(1 / (1 if at == "settings" else 4))),
        "kind": draw.choice(kinds),
        "calls": draw.choice((1, 1, 1, 2, 5, 20)),
    }
    return {"at": at} | more


def may_keep(names: tuple[str, ...]) -> tuple[str, ...]:
    """The hulls of a plan that may keep their past: those that a client can make with one request."""
    return tuple(name for name in names if name not in GLOBE)


@contextmanager
def small_segments(rows: int | None) -> Iterator[None]:
    """Have segments, and reads of the past, of few rows."""
    if rows is None:
        yield
        return
    before = filing.MOST_ROWS, past_rows.STEP_ROWS, past_rows.STEP_POINTS
    filing.MOST_ROWS, past_rows.STEP_ROWS, past_rows.STEP_POINTS = rows, rows, rows
    try:
        yield
    finally:
        filing.MOST_ROWS, past_rows.STEP_ROWS, past_rows.STEP_POINTS = before
