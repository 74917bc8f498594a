"""The simulation from the command line.

python -m simulation run --seconds 60 --seed 1     random plans of all layers; exit code 1 on a finding
python -m simulation replay FILE                   one plan that was kept
python -m simulation mutants                       after how many lives the simulation finds each fault put back in
"""

import argparse
import gc
import json
import math
import sys
import time
from pathlib import Path

LAYERS = "core", "shell", "sqlite", "past", "cluster", "links"
FINDINGS = Path(__file__).parent / "findings"

# Plans from one collection of garbage to the next, and seconds from one line of progress to the next.
COLLECT, REPORT = 500, 60.0
# A run draws its plans' seeds from here on: room for any number of plans.
ROOM = 10**9


def main() -> int:
    parser = argparse.ArgumentParser(prog="simulation", description=__doc__.splitlines()[0])
    parser.add_argument("--package", help="the folder of other copies of the server's packages")
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="random plans")
    run.add_argument("--seconds", type=float, help="end after this time (default: 60, or never with --lives)")
    run.add_argument("--seed", type=int, default=1)
    run.add_argument("--layer", choices=(*LAYERS, "all"), default="all")
    run.add_argument("--lives", type=int, default=None, help="end after this number of lives")
    run.add_argument("--alarms", action="store_true", help="only plans with alarms")
    run.add_argument("--keep", action="store_true", help="shrink what is found, and keep its plan")
    replay = commands.add_parser("replay", help="a plan that was kept")
    replay.add_argument("file", type=Path)
    trace = commands.add_parser("trace", help="hashes of the first plans' histories")
    trace.add_argument("plans", type=int)
    mutants = commands.add_parser("mutants", help="faults put back in")
    mutants.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    if arguments.package:
        from .package import use_package

        use_package(arguments.package)
    match arguments.command:
        case "run":
            return _run(arguments)
        case "replay":
            return _replay(arguments.file)
        case "trace":
            return _trace(arguments.plans)
        case _:
            from .mutate import report

            return report(arguments.names)


def _run(arguments: argparse.Namespace) -> int:
    gc.disable()  # dead worlds are collected between plans
    try:
        return _search(arguments)
    finally:
        gc.enable()
        gc.collect()


def _search(arguments: argparse.Namespace) -> int:
    """Plans until the time or the lives are over, or one has found something."""
    from .plan import random_plan
    from .play import play

    layers = LAYERS if arguments.layer == "all" else (arguments.layer,)
    lives = dict.fromkeys(layers, 0)
    seconds = dict.fromkeys(layers, 0.0)
    begun = reported = time.monotonic()
    seed = arguments.seed * ROOM
    least = 60.0 if arguments.lives is None else math.inf
    until = begun + (least if arguments.seconds is None else arguments.seconds)
    while time.monotonic() < until:
        layer = min(layers, key=lambda each: seconds[each])
        plan = random_plan(seed, layer)
        if arguments.alarms and "alarms" not in plan:
            seed += 1
            continue
        plan_begun = time.monotonic()
        outcome = play(plan)
        seconds[layer] += time.monotonic() - plan_begun
        lives[layer] += outcome.lives
        if outcome.finding is not None:
            print(f"{_progress(lives, seconds)}, 1 finding", flush=True)
            return _found(seed, layer, keep=arguments.keep)
        seed += 1
        if seed % COLLECT == 0:
            gc.collect()
        if time.monotonic() - reported >= REPORT:
            reported = time.monotonic()
            print(f"{_progress(lives, seconds)}, no finding", flush=True)
        if arguments.lives is not None and sum(lives.values()) >= arguments.lives:
            break
    print(f"{_progress(lives, seconds)}, no finding", flush=True)
    return 0


def _progress(lives: dict[str, int], seconds: dict[str, float]) -> str:
    return ", ".join(
        f"{layer}: {lives[layer]} lives, {lives[layer] / max(seconds[layer], 1e-9):.0f} a second" for layer in lives
    )


def _found(seed: int, layer: str, *, keep: bool) -> int:
    from .plan import random_plan
    from .play import play
    from .shrink import shrunk

    plan = random_plan(seed, layer)
    outcome = play(plan)
    print(f"seed {seed} of the {layer}: {outcome.finding}\n{outcome.where}")
    if keep:
        plan = shrunk(plan)
        file = FINDINGS / f"{layer}-{seed}.json"
        file.write_text(json.dumps({"finding": play(plan).finding, "plan": plan}, indent=1) + "\n")
        print(f"kept; to replay it: PYTHONPATH=tests .venv/bin/python -m simulation replay {file}")
    return 1


def _replay(file: Path) -> int:
    from .play import play

    outcome = play(json.loads(file.read_text())["plan"])
    print(f"{outcome.finding}\n{outcome.where}" if outcome.finding else "no finding")
    return int(outcome.finding is not None)


def _trace(plans: int) -> int:
    from .plan import random_plan
    from .play import play

    for seed in range(plans):
        outcome = play(random_plan(seed, LAYERS[seed % len(LAYERS)]))
        print(seed, outcome.trace, outcome.finding)
    return 0


if __name__ == "__main__":
    sys.exit(main())
