"""Mutation testing: how many small faults in the reference geometry do its fast tests find?

    make mutants MUTANTS=200 SEED=1

Works on a copy in build/mutants. Draws mutants at random: in one line a sign, comparison, constant, condition or loop
is changed. Prints what the tests do not find as a difference, and the score.
"""

import argparse
import os
import random
import re
import shlex
import shutil
import sys
import time
from pathlib import Path

from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkItem

ROOT = Path(__file__).parents[2]
COPY = ROOT / "build/mutants/tree"
COPIED = ("dynhull", "tests", "pyproject.toml")
MODULES = [
    *(f"dynhull/_{name}.py" for name in ("predicates", "nodes", "tree")),
    *(f"dynhull/static/_{name}.py" for name in ("boundary", "graham", "jarvis", "monotone_chain", "chan")),
]
TESTS = ["static/test_static.py", "core/test_predicates.py", "core/test_stateful.py", "core/test_hull.py"]
SLOW = "100000 or splits_and_merges or perturbation"
COMPARISON = "(Gt|GtE|Lt|LtE|Eq|NotEq)"
OPERATORS = re.compile(
    r"core/(NumberReplacer|AddNot|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceTrueWithFalse|ReplaceFalseWithTrue"
    r"|ReplaceBreakWithContinue|ReplaceContinueWithBreak|ZeroIterationForLoop|ReplaceUnaryOperator_Delete_(USub|Not)"
    rf"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Add)|ReplaceComparisonOperator_{COMPARISON}_{COMPARISON})$"
)
PATIENCE = 2  # times as long as the tests take without a fault: what takes longer is found


def test_command() -> str:
    """Stops at the first failure; the same examples for every mutant."""
    tests = [f"tests/{path}" for path in TESTS]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "--hypothesis-seed=0",
        "--timeout=30",
    ]
    return shlex.join(["env", "DYNHULL_KERNEL=python", "PYTHONPATH=.", *command, "-k", f"not ({SLOW})", *tests])


def mutants(session: WorkDB) -> list[WorkItem]:
    """All of them, in an order that does not change."""
    init([Path(path) for path in MODULES], session, {})
    wanted = [item for item in session.work_items if OPERATORS.match(item.mutations[0].operator_name)]
    return sorted(wanted, key=lambda item: str(item.mutations))


def main() -> int:
    """Exit code 1 if the tests fail without a fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    shutil.rmtree(COPY, ignore_errors=True)
    COPY.mkdir(parents=True)
    for name in COPIED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, COPY / name)
    os.chdir(COPY)
    begun = time.monotonic()
    if mutate_and_test([], test_command(), 600).test_outcome != TestOutcome.SURVIVED:
        print("The tests fail without a fault.")
        return 1
    patience = PATIENCE * (time.monotonic() - begun)
    with use_db("session.sqlite") as session:
        everything = mutants(session)
    drawn = random.Random(options.seed).sample(everything, min(options.mutants, len(everything)))
    survivors = 0
    for item in drawn:
        [mutation] = item.mutations
        result = mutate_and_test(item.mutations, test_command(), patience)
        survived = result.test_outcome == TestOutcome.SURVIVED
        survivors += survived
        place = f"{mutation.module_path}:{mutation.start_pos[0]} {mutation.operator_name.removeprefix('core/')}"
        print(f"NOT FOUND {place}\n{result.diff}" if survived else f"found {place}", flush=True)
    found = len(drawn) - survivors
    print(f"{found} of {len(drawn)} mutants found ({found / len(drawn):.0%}), drawn from {len(everything)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
