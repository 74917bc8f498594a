"""Faults of the protocol that the simulation must find: each is one replacement in one module.

PYTHONPATH=tests python -m shards.mutants [NAME ...]
"""

import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from dynhull_cluster.shards.root import Root

from .simulation import FEW, World

MOST_SCHEDULES = 2000

# Name: the module, what stands there once, and what stands there instead.
MUTANTS = {
    "a root chooses its epoch alone, above those that shards know of": (
        "epochs",
        "self._last = owner << OWNER_BITS",
        "self._last = 0",
    ),
    "a process that was replaced begins a root above the next one": (
        "epochs",
        "if self._owner and owner_of(last) > self._owner:",
        "if False:",
    ),
    "a process begins two roots in one epoch": ("epochs", "self._last = last + 1", "self._last = last"),
    "a shard replies before it has the step in its log": ("shard", "self._log.add(log)", "pass"),
    "an uncertain step stays after a root was lost": (
        "shard",
        "if contents is None or self._number > message.decided:",
        "if contents is None:",
    ),
    "a restarted shard opens for a message that comes again": (
        "shard",
        "if not known and (not isinstance(message, Open) or message.epoch == self._log.epoch):",
        "if not known and not isinstance(message, Open):",
    ),
    "a shard listens to a root that was replaced": ("shard", "if message.epoch < self._log.epoch:", "if False:"),
    "a shard applies what comes twice": (
        "shard",
        "if known and message.ticket <= self._ticket:",
        "if known and message.ticket < self._ticket:",
    ),
    "an undone step stays in the log": ("shard", "self._log.drop(message.number)", "pass"),
    "an undone step leaves its vertices": (
        "shard",
        "self._number, self._corners = last.before, last.corners",
        "self._number = last.before",
    ),
    "an undone step leaves its points": ("shard", "self._contents = last.inverse()", "pass"),
    "points leave before a batch that is refused": ("shard", "contents.check(part)", "pass"),
    "a refused batch is not undone": (
        "root",
        "if any(each >= number and effect.error is None for each, effect in own.items())",
        "if False",
    ),
    "the root decides before all shards have the step": (
        "root",
        "if len(self._replies) == len(self._sent):",
        "if len(self._replies) >= 1:",
    ),
    "the root takes replies of earlier rounds": (
        "root",
        "(reply.epoch, reply.ticket) != (sent.epoch, sent.ticket)",
        "reply.epoch != sent.epoch",
    ),
    "the root takes replies of earlier epochs": (
        "root",
        "(reply.epoch, reply.ticket) != (sent.epoch, sent.ticket)",
        "reply.ticket != sent.ticket",
    ),
    "the root answers without a decision": (
        "root",
        "            self._log.decide(self._epoch, decisions)",
        "            pass",
    ),
    "the root decides about new shards whose last points have not arrived": (
        "root",
        "        while left or under_way:",
        "        while left:",
    ),
    "old shards are dropped before the new ones are decided": (
        "root",
        "for each in (self._division, self._arising) if each is not None)",
        "for each in (self._arising or self._division,))",
    ),
    "the root goes on with the old shards": (
        "root",
        "        self._division, self._arising = arising, None",
        "        self._arising = None",
    ),
    "a new root begins with the first shards": ("root", "decided.division or Division(shards)", "Division(shards)"),
    "batches go to shards as before": ("root", "        self._planner.shards = arising.shards\n", ""),
    "the root keeps no producers": ("root", "self._producers.applied(", "(lambda *_, **__: None)("),
    "a request is forgotten where a shard restarts": (
        "root",
        "self._waiting.extendleft(reversed(self._current))",
        "pass",
    ),
    "a shard without rows keeps what is too old": (
        "planning",
        "range(self.shards) if clock != self._clock else parts",
        "parts",
    ),
    "vertices of what was too old stay": (
        "root",
        "        self._take_changes(effect.left for effect in effects.values())\n",
        "",
    ),
    "a step that may be refused cannot be undone": (
        "planning",
        "undoable = self._doubtful or suspect or (refusable(admitted) and len(shards) > 1)",
        "undoable = suspect",
    ),
    "a step behind one that may be refused cannot be undone": (
        "planning",
        "undoable = self._doubtful or suspect",
        "undoable = suspect",
    ),
    "the limit on points is forgotten": (
        "planning",
        "if grows and after > most_points else None",
        "if False else None",
    ),
    "batches of a round are limited one by one": ("planning", "        self._points += most_growth(admitted)\n", ""),
    "a batch joins a round with a number that is not the next one": (
        "planning",
        "if not last or write.sequence != last + 1 or write.after not in (None, last):",
        "if not last:",
    ),
    "batches behind a refused one are decided": (
        "root",
        "self._decide(plans[:refused], effects)",
        "self._decide(plans, effects)",
    ),
    "batches behind a refused one are forgotten": ("root", "self._waiting.extendleft(reversed(behind))", "pass"),
    "batches behind a refused one change places": (
        "root",
        "self._waiting.extendleft(reversed(behind))",
        "self._waiting.extendleft(behind)",
    ),
}


def mutated(name: str) -> dict[str, Any]:
    """The class with the fault, as an argument of World."""
    module, old, new = MUTANTS[name]
    original = import_module(f"dynhull_cluster.shards.{module}")
    assert original.__file__ is not None
    source = Path(original.__file__).read_text()
    assert source.count(old) == 1, f"{name}: {source.count(old)} places in {module}.py"
    copy = ModuleType(original.__name__)
    copy.__package__, copy.__file__ = original.__package__, original.__file__
    before = sys.modules[original.__name__]
    sys.modules[original.__name__] = copy  # dataclasses look their module up
    try:
        exec(compile(source.replace(old, new), original.__file__, "exec"), copy.__dict__)
    finally:
        sys.modules[original.__name__] = before
    if module == "root":
        copy.PIECE_POINTS = FEW
    if module == "epochs":
        return {"epochs_type": copy.Epochs}
    if module == "shard":
        return {"shard_type": copy.Shard}
    return {"root_type": copy.Root if module == "root" else partial(with_planner, copy.Planner)}


def with_planner(planner: Any, settings: Any, limits: Any, shards: int, log: Any, now: float) -> Root:
    root = Root(settings, limits, shards, log, now)
    root._planner = planner(settings, root._most_points, root._producers, shards)
    return root


def found(name: str, schedules: int = MOST_SCHEDULES) -> tuple[int, str] | None:
    """The first schedule that finds the fault, and how; None if none of them does."""
    fault = mutated(name)
    for seed in range(schedules):
        if (finding := attempt(lambda seed=seed: World(seed, **fault).play())) is not None:
            return seed, finding
    return None


def attempt(play: Callable[[], None]) -> str | None:
    try:
        play()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


def main() -> None:
    missed = 0
    for name in sys.argv[1:] or MUTANTS:
        finding = found(name)
        missed += finding is None
        print(f"{name}: {'not found' if finding is None else f'schedule {finding[0]}, {finding[1]}'}", flush=True)
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
