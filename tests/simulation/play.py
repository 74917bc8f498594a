"""Plays a plan: its lives one after the other on one storage, each with a look at all promises at its end."""

import logging
import traceback
from dataclasses import dataclass
from typing import Any

import dynhull_server
from dynhull_server.state.limits import FenceLimits, Limits
from dynhull_server.storage.memory import MemoryStorage

from .clients import Client, probe, probe_fence
from .core_life import CoreServer
from .model import Finding, Model
from .plan import Plan
from .schedule import Schedule
from .shell_life import ShellServer
from .sqlite_store import SQLiteLives
from .store import FaultyStorage

# How often a fence is made anew at the end of a life.
ANEW = 0.3

LAYERS = {"core": CoreServer, "shell": ShellServer, "sqlite": ShellServer}


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


def play(plan: Plan) -> Outcome:
    """Play a plan to its end, or to the first broken promise. Nothing is logged."""
    log = logging.getLogger(dynhull_server.__name__)
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        return _play(plan)
    finally:
        log.setLevel(level)


def _play(plan: Plan) -> Outcome:
    limits = Limits(**plan["limits"], fences=FenceLimits(**plan.get("fences", {})))
    model, schedule = Model(limits), Schedule(plan["seed"])
    storage = _storage(plan, model)
    lives = 0
    where = ""
    try:
        for life in plan["lives"]:
            lives += 1
            _live(plan["layer"], life, limits, model, schedule, storage)
        _live(plan["layer"], {"clients": [], "end": "kill"}, limits, model, schedule, storage)
    except Finding:
        where = traceback.format_exc()
    except Exception as error:  # the server's own code has failed
        model.finds(f"{type(error).__name__}: {error}")
        where = traceback.format_exc()
    finally:
        storage.remove()
    return Outcome(lives, schedule.trace, model.finding, where)


def _storage(plan: Plan, model: Model) -> FaultyStorage:
    if plan["storage"] == "sqlite":
        return SQLiteLives(model, plan["faults"])
    return FaultyStorage(MemoryStorage(), model, plan["faults"], immediate=plan["storage"] == "immediate")


def _live(
    layer: str, life: dict[str, Any], limits: Limits, model: Model, schedule: Schedule, storage: FaultyStorage
) -> None:
    schedule.clear()
    storage.calm = True
    server: CoreServer | ShellServer = LAYERS[layer](limits, storage, model, schedule)
    model.new_life()
    server.check()
    storage.calm = False
    for number, operations in enumerate(life["clients"]):
        server.client(Client(number, server, model), operations)
    if "after" in life:
        for _ in range(life["after"]):
            if not server.turn():
                break
    else:
        server.rest()
        _look(server, model, schedule, storage)
    if life["end"] == "stop":
        server.stop()
        if server.waiting():
            raise model.finds(f"after the end these wait: {server.waiting()}")
    storage.dead = True
    server.kill()


def _look(server: CoreServer | ShellServer, model: Model, schedule: Schedule, storage: FaultyStorage) -> None:
    """Everything is as it should be, and works, once all clients have been answered and nothing fails any more."""
    if server.waiting():
        raise model.finds(f"these wait for ever: {server.waiting()}")
    storage.calm = True
    server.check()
    names = sorted({*model.alive, "a"})
    anew = schedule.random.choice(names)
    for name in names:
        server.probe(probe(server, model, name, anew=name == anew))
    for name in sorted(model.fences.alive):
        server.probe(probe_fence(server, model, name, anew=schedule.random.random() < ANEW))
    server.let_leave()
    server.check()
    storage.calm = False
