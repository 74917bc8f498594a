"""How often does a test fail that should not? Runs the whole suite again and again, in random order.

    make flakes N=20 BUSY=2 SEED=1

Beside BUSY processes that only use processor time. Each run is appended to build/flakes/COMMIT.jsonl as it ends; COMMIT
is the last one that changed more than documentation. What is there already counts, so a series that was stopped goes
on. At the end, and with N=0, a table shows each test that has failed on COMMIT, and how long the runs took. The exit
code is 1 if a test has failed.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

RESULTS = Path("build/flakes")
DOCUMENTATION = [":!*.md", ":!docs/images"]
# Ends with its parent, however that ends.
SPIN = "import os; parent = os.getppid()\nwhile os.getppid() == parent: sum(range(100_000))"
LONGEST = 3600  # seconds of a run; single tests have a limit of their own
SHOWN = 4000  # characters of a traceback, at each end: the first has the error that led to others
THE_RUN = "(the run itself)"

Run = dict[str, Any]


def git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], capture_output=True, text=True, check=True).stdout.strip()


def tested_commit() -> str:
    if changed := git("status", "--porcelain", "--untracked-files=no"):
        raise SystemExit(f"commit first: results belong to a commit, and these files have changed since:\n{changed}")
    return git("log", "-1", "--format=%h", "--abbrev=12", "--", ".", *DOCUMENTATION)


@contextmanager
def beside(busy: int) -> Iterator[None]:
    spinning = [subprocess.Popen([sys.executable, "-c", SPIN]) for _ in range(busy)]
    try:
        yield
    finally:
        for each in spinning:
            each.kill()
            each.wait()


def run(seed: int, busy: int, arguments: list[str]) -> Run:
    report = RESULTS / "report.xml"
    report.unlink(missing_ok=True)
    cold = not any(Path("tests").glob("**/__pycache__"))
    command = [sys.executable, "-m", "pytest", "-q", f"--order-seed={seed}", f"--junitxml={report}", *arguments]
    begun, started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), time.monotonic()
    with beside(busy), (RESULTS / "output.txt").open("wb") as output:
        suite = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            code: int | None = suite.wait(LONGEST)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            if suite.poll() is None:
                os.killpg(suite.pid, signal.SIGKILL)
                suite.wait()
    seconds = time.monotonic() - started
    counts, failures = read(report)
    if code not in (0, 1) or bool(code) != bool(failures):
        ended = f"not after {LONGEST} s" if code is None else f"with code {code}"
        tail = Path(output.name).read_text("utf-8", "replace")[-SHOWN:]
        failures.append({"test": THE_RUN, "traceback": f"it ended {ended}, and reports {counts}\n{tail}"})
    figures = {"started": begun, "seconds": round(seconds, 1), "load": round(os.getloadavg()[1], 1)}
    return {
        "seed": seed,
        "busy": busy,
        "cold": cold,
        "cores": os.cpu_count(),
        **figures,
        **counts,
        "failures": failures,
    }


def read(report: Path) -> tuple[dict[str, int], list[dict[str, str]]]:
    """The counts and the failures of a run; empty where it ended without a report."""
    if not report.exists():
        return {}, []
    suite = ElementTree.parse(report).getroot().find("testsuite")
    failures = []
    for case in suite.iter("testcase"):
        for kind in ("failure", "error"):
            for each in case.iter(kind):
                name = f"{case.get('classname')}::{case.get('name')}"
                failures.append({"test": name, "traceback": shown(each.text or each.get("message", ""))})
    tests, failed, errors, skipped = (int(suite.get(name)) for name in ("tests", "failures", "errors", "skipped"))
    bad = failed + errors
    return {"passed": tests - bad - skipped, "failed": bad, "skipped": skipped}, failures


def shown(traceback: str) -> str:
    """What is kept of a traceback."""
    return traceback if len(traceback) <= 2 * SHOWN else f"{traceback[:SHOWN]}\n…\n{traceback[-SHOWN:]}"


def described(result: Run) -> str:
    counts = ", ".join(f"{result[name]:,} {name}" for name in ("passed", "failed", "skipped") if result.get(name))
    return f"{counts or 'no report'} in {result['seconds']:.0f} s, load {result['load']}"


def table(runs: list[Run]) -> str:
    """What has failed, how often, and first how; and the times."""
    failed: dict[str, list[str]] = defaultdict(list)
    for result in runs:
        for test, traceback in {each["test"]: each["traceback"] for each in reversed(result["failures"])}.items():
            failed[test].append(traceback)
    lines = []
    for test, tracebacks in sorted(failed.items(), key=lambda item: -len(item[1])):
        lines += [f"\n{test}: failed in {len(tracebacks)} of {len(runs)} runs; first:", tracebacks[0]]
    lines.append("\nbusy  runs  cold  with failures  seconds: least  median  most")
    for busy in sorted({result["busy"] for result in runs}):
        among = [result for result in runs if result["busy"] == busy]
        times = [result["seconds"] for result in among]
        cold, bad = sum(result["cold"] for result in among), sum(bool(result["failures"]) for result in among)
        spread = f"{min(times):14.0f}  {statistics.median(times):6.0f}  {max(times):4.0f}"
        lines.append(f"{busy:4}  {len(among):4}  {cold:4}  {bad:13}  {spread}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, help="how many runs there should be in all, so busy")
    parser.add_argument("--busy", type=int, default=0, help="how many processes are busy meanwhile")
    parser.add_argument("--seed", type=int, default=1, help="of the order of the first run; later ones count on")
    parser.add_argument("pytest", nargs="*", help="arguments of pytest")
    given = parser.parse_args()
    commit = tested_commit()
    RESULTS.mkdir(parents=True, exist_ok=True)
    file = RESULTS / f"{commit}.jsonl"
    runs = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = sum(result["busy"] == given.busy for result in runs)
    for number in range(done, given.runs):
        result = run(given.seed + number, given.busy, given.pytest)
        runs.append(result)
        with file.open("a") as appended:
            appended.write(json.dumps(result) + "\n")
        names = "".join(f"\n    {each['test']}" for each in result["failures"])
        print(f"{commit}, run {number + 1} of {given.runs}, busy {given.busy}: {described(result)}{names}", flush=True)
    if not runs:
        raise SystemExit(f"there are no runs of {commit}")
    print(table(runs))
    return int(any(result["failures"] for result in runs))


if __name__ == "__main__":
    raise SystemExit(main())
