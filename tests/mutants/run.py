"""Mutation testing: how many small faults in the reference geometry do its fast tests find?

    make mutants MUTANTS=200 SEED=1

Works on a copy in build/mutants. Each mutant, drawn at random, changes one sign, comparison, constant, condition or
loop. Prints the mutants that the tests do not find, as differences, and the score. A mutant is found if a test fails,
or if the tests use far more processor time than without it: limits on processor time and memory end its endless loops,
however busy the machine is.
"""

import argparse
import os
import random
import re
import resource
import shlex
import shutil
import sys
from collections.abc import Sequence
from math import ceil
from pathlib import Path

from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkerOutcome, WorkItem, WorkResult

ROOT = Path(__file__).parents[2]
COPY = ROOT / "build/mutants/tree"
COPIED = ("dynhull", "tests", "pyproject.toml")
MODULES = [
    *(f"dynhull/_{name}.py" for name in ("predicates", "nodes", "tree")),
    *(f"dynhull/static/_{name}.py" for name in ("boundary", "graham", "jarvis", "monotone_chain", "chan")),
]
TESTS = [
    *(f"core/test_{name}.py" for name in ("hull", "predicates", "check", "stateful")),
    "static/test_static.py",
]
SLOW = "20000 or splits_and_merges or perturbation"
COMPARISON = "(Gt|GtE|Lt|LtE|Eq|NotEq)"
OPERATORS = re.compile(
    r"core/(NumberReplacer|AddNot|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceTrueWithFalse|ReplaceFalseWithTrue"
    r"|ReplaceBreakWithContinue|ReplaceContinueWithBreak|ZeroIterationForLoop|ReplaceUnaryOperator_Delete_(USub|Not)"
    rf"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Add)|ReplaceComparisonOperator_{COMPARISON}_{COMPARISON})$"
)
FACTOR = 2  # times the processor time that the tests use without a fault
LONGEST = 600  # seconds of processor time that they may use without a fault
MEMORY = 4_000_000  # KiB
FAILED = re.compile(r"\d+ (failed|error)")


def test_command(seconds: int, mutations: Sequence[MutationSpec]) -> str:
    """Stops at the first failure; the same examples for every mutant, in the order that finds it soonest."""
    static = any(mutation.module_path.parent.name == "static" for mutation in mutations)
    limited = ["sh", "-c", f'ulimit -t {seconds} && ulimit -v {MEMORY} && exec "$@"', "sh"]
    environment = ["env", "DYNHULL_KERNEL=python", "PYTHONPATH=."]
    pytest = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--timeout=0"]
    hypothesis = ["--hypothesis-profile=mutants", "--hypothesis-seed=0"]
    tests = [f"tests/{path}" for path in (reversed(TESTS) if static else TESTS)]
    return shlex.join([*limited, *environment, *pytest, *hypothesis, "-k", f"not ({SLOW})", *tests])


def run(mutations: Sequence[MutationSpec], seconds: int) -> WorkResult:
    """Run the tests with these mutations. Raises RuntimeError if they cannot be made."""
    result = mutate_and_test(mutations, test_command(seconds, mutations), timeout=None)
    if result.worker_outcome != WorkerOutcome.NORMAL or result.test_outcome == TestOutcome.INCOMPETENT:
        raise RuntimeError(f"{mutations}: {result.worker_outcome} {result.output}")
    return result


def outcome(result: WorkResult) -> str:
    """One of "NOT FOUND", "found" and "found by its processor time"."""
    if result.test_outcome == TestOutcome.SURVIVED:
        return "NOT FOUND"
    return "found" if FAILED.search(result.output) else "found by its processor time"


def processor_time() -> float:
    """Seconds used by finished children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


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
    without = run([], LONGEST)
    if without.test_outcome != TestOutcome.SURVIVED:
        print(f"The tests fail without a fault.\n{without.output}")
        return 1
    seconds = ceil(FACTOR * processor_time())
    with use_db("session.sqlite") as session:
        everything = mutants(session)
    drawn = random.Random(options.seed).sample(everything, min(options.mutants, len(everything)))
    survivors = 0
    for item in drawn:
        [mutation] = item.mutations
        result = run(item.mutations, seconds)
        survived = result.test_outcome == TestOutcome.SURVIVED
        survivors += survived
        place = f"{mutation.module_path}:{mutation.start_pos[0]} {mutation.operator_name.removeprefix('core/')}"
        print(f"{outcome(result)} {place}", *([result.diff] if survived else []), sep="\n", flush=True)
    found = len(drawn) - survivors
    print(f"{found} of {len(drawn)} mutants found ({found / len(drawn):.0%}), drawn from {len(everything)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
