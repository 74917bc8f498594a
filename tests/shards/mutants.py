"""Faults of the protocol that the simulation must find: each is one replacement in one module.

PYTHONPATH=tests python -m shards.mutants [NAME ...]
"""

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from .simulation import World

MOST_SCHEDULES = 2000

# Name: the module, what stands there once, and what stands there instead.
MUTANTS = {
    "a shard replies before it has the step in its log": ("shard", "self._log.add(message.number, records)", "pass"),
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
        "self._number, self._corners, self._last = last.before, last.corners, None",
        "self._number, self._last = last.before, None",
    ),
    "an undone step leaves its points": ("shard", "self._contents = last.inverse()", "pass"),
    "points leave before a batch that is refused": ("shard", "contents.check(part)", "pass"),
    "a refused batch is not undone": ("root", "if reply.error is None]", "if False]"),
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
        'self._log.decide(self._epoch, Decision(self._number + 1, revision, "batch", clock, *numbered))',
        "pass",
    ),
    "the root keeps no producers": ("root", "self._producers.applied(", "(lambda *_, **__: None)("),
    "a request is forgotten where a shard restarts": ("root", "self._waiting.appendleft(self._current)", "pass"),
    "a shard without rows keeps what is too old": (
        "root",
        "concerned = range(len(self._totals)) if clock != self.clock else parts",
        "concerned = parts",
    ),
    "vertices of what was too old stay": (
        "root",
        "        self._take_changes(reply.left for reply in replies.values())\n        hull_changed",
        "        hull_changed",
    ),
    "a step that may be refused cannot be undone": (
        "root",
        "undoable = suspect or (refusable(admitted) and len(concerned) > 1)",
        "undoable = suspect",
    ),
    "the limit on points is forgotten": (
        "root",
        "if grows and after > self._most_points else None",
        "if False else None",
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
    if module == "shard":
        return {"shard_type": copy.Shard}
    for shared in ("Write", "Expire", "Read", "Request"):  # the simulation's own requests
        setattr(copy, shared, getattr(original, shared))
    return {"root_type": copy.Root}


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
