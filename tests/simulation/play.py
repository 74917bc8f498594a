"""Plays a plan: its lives one after the other on one storage, each with a look at all promises at its end."""

import logging
import traceback
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import dynhull_cluster
import dynhull_server
from dynhull_server.state.limits import FenceLimits, Limits
from dynhull_server.storage.memory import MemoryStorage

from .clients import Client, probe, probe_fence
from .cluster_life import World
from .cluster_plan import Plan
from .core_life import CoreServer
from .limit import SECONDS, EndlessError, bounded
from .link_life import LinkedServer
from .link_owners import LinkWorld
from .model import Finding, Model
from .past_plan import small_segments
from .schedule import Schedule
from .shell_life import ShellServer
from .sqlite_store import SQLiteLives
from .store import FaultyStorage, KilledError

# How often a fence is made anew at the end of a life.
ANEW = 0.3

LAYERS = {"core": CoreServer, "shell": ShellServer, "sqlite": ShellServer, "links": LinkedServer}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a plan: how many lives, a hash of all that happened, and the promise that was broken, if any."""

    lives: int
    trace: int
    finding: str | None
    where: str = ""

    @property
    def kind(self) -> str:
        """The finding without its numbers, to compare it with another one."""
        return "".join(letter for letter in self.finding or "" if not letter.isdigit())[:40]


def play(plan: Plan, seconds: float = SECONDS) -> Outcome:
    """Play a plan to its end, to the first broken promise, or for so much processor time. Nothing is logged."""
    logs = [logging.getLogger(each.__name__) for each in (dynhull_server, dynhull_cluster)]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL + 1)
    try:
        return _play(plan, seconds)
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)


def _play(plan: Plan, seconds: float) -> Outcome:
    if "fates" in plan:
        return _play_world(plan, seconds)
    with small_segments(plan.get("segment_rows")):
        return _play_lives(plan, seconds)


def _play_lives(plan: Plan, seconds: float) -> Outcome:
    limits = Limits(**plan["limits"], fences=FenceLimits(**plan.get("fences", {})))
    model, schedule = Model(limits), Schedule(plan["seed"])
    model.immediate = plan["storage"] == "immediate"
    model.forgets = plan.get("history_bytes", 0) > 0
    schedule.brisk = plan.get("short", False)
    storage = _storage(plan, model)
    lives = 0
    where = ""
    try:
        clients: list[Client] = []
        with bounded(seconds):
            for life in plan["lives"]:
                lives += 1
                clients = _live(plan["layer"], life, limits, model, schedule, storage, clients)
            _live(plan["layer"], {"clients": [], "end": "kill"}, limits, model, schedule, storage, [])
    except Finding:
        where = traceback.format_exc()
    except (Exception, EndlessError) as error:  # the server's own code has failed
        model.finds(f"{type(error).__name__}: {error}")
        where = traceback.format_exc()
    finally:
        storage.remove()
    return Outcome(lives, schedule.trace, model.finding, where)


def _play_world(plan: Plan, seconds: float) -> Outcome:
    world = LinkWorld if plan["layer"] == "links" else World
    model, schedule = Model(Limits(**plan["limits"])), Schedule(plan["seed"])
    where = ""
    try:
        with bounded(seconds):
            world(plan, model, schedule).play()
    except Finding as finding:
        model.finds(str(finding))
        where = traceback.format_exc()
    except (Exception, EndlessError) as error:  # the server's own code has failed
        model.finds(f"{type(error).__name__}: {error}")
        where = traceback.format_exc()
    return Outcome(1, schedule.trace, model.finding, where)


def _storage(plan: Plan, model: Model) -> FaultyStorage:
    if plan["storage"] == "sqlite":
        most_bytes, short = plan.get("history_bytes", 0), plan.get("short", False)
        return SQLiteLives(model, plan["faults"], most_bytes, in_store=plan.get("store", False), one_reader=short)
    return FaultyStorage(MemoryStorage(), model, plan["faults"], immediate=plan["storage"] == "immediate")


def _live(
    layer: str,
    life: dict[str, Any],
    limits: Limits,
    model: Model,
    schedule: Schedule,
    storage: FaultyStorage,
    before: list[Client],
) -> list[Client]:
    """One life. The clients of a life that begins with a restore are those of the life before."""
    schedule.clear()
    schedule.patient, schedule.slow = life.get("patient", False), life.get("slow", "")
    storage.calm = True
    if life.get("restored"):
        storage.restore()
    server: CoreServer | ShellServer = LAYERS[layer](limits, storage, model, schedule)
    try:
        clients = _lived(server, life, model, schedule, storage, before)
    except BaseException:
        if isinstance(server, ShellServer):
            server.end()
        raise
    server.kill()
    return clients


def _lived(
    server: CoreServer | ShellServer,
    life: dict[str, Any],
    model: Model,
    schedule: Schedule,
    storage: FaultyStorage,
    before: list[Client],
) -> list[Client]:
    """The clients of a life that has been led to its end."""
    model.new_life()
    model.wall += life.get("clock", 0)
    server.check()
    storage.calm = False
    server.begin()
    clients = [Client(number, server, model) for number in range(len(life["clients"]))]
    for client, operations in zip(clients, life["clients"], strict=True):
        server.client(client, operations)
    if life.get("restored"):
        for client, former in zip(clients, before, strict=False):
            client.remember(former)
    with suppress(KilledError):  # where the plan says so
        _lead(server, life, model, schedule, storage)
    storage.dead, storage.killing = True, False
    return clients


def _lead(
    server: CoreServer | ShellServer, life: dict[str, Any], model: Model, schedule: Schedule, storage: FaultyStorage
) -> None:
    """Lead a life to its end."""
    if "after" in life:
        for _ in range(life["after"]):
            if not server.turn():
                break
    else:
        server.rest()
        if life.get("looked_at", True):
            _look(server, model, schedule, storage)
    if life["end"] == "stop":
        server.stop()
        if server.waiting():
            raise model.finds(f"after the end these wait: {server.waiting()}")


def _look(server: CoreServer | ShellServer, model: Model, schedule: Schedule, storage: FaultyStorage) -> None:
    """Everything is as it should be, and works, once all clients have been answered and nothing fails any more."""
    if server.waiting():
        raise model.finds(f"these wait for ever: {server.waiting()}")
    storage.calm = True
    schedule.patient = True
    server.check()
    names = sorted({*model.alive, "a"})
    anew = schedule.random.choice(names)
    for name in names:
        server.probe(probe(server, model, name, anew=name == anew))
    for name in sorted(model.fences.alive):
        server.probe(probe_fence(server, model, name, anew=schedule.random.random() < ANEW))
    server.let_leave()
    server.check()
    if isinstance(server, ShellServer) and storage.keeps_past:
        server.look_at_past()
    storage.calm = False
