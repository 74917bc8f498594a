"""What tortures have found, one line each run, so that many faults can be tried in pieces.

    python tests/robustness/server/record.py

A torture with --record appends its run to build/torture/COMMIT.jsonl when it ends, however it ends; COMMIT is the last
one that changed more than documentation. This prints the sums of the present commit.
"""

import json
import os
import statistics
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[2]))
from flakes import tested_commit

RESULTS = Path("build/torture")

Run = dict[str, Any]


@contextmanager
def recorded(seed: int, faults: Mapping[str, int], seconds: Sequence[float]) -> Iterator[None]:
    """Append what the block does: the faults that there were, and the seconds after each until all was served again."""
    commit = tested_commit()
    begun, started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), time.monotonic()
    failure = ""
    try:
        yield
    except BaseException as error:
        failure = f"{type(error).__name__}: {error}"
        raise
    finally:
        words = [Path(sys.argv[0]).stem, *(each for each in sys.argv[1:] if each == "--workers")]
        run: Run = {
            "torture": " ".join(words),
            "commit": commit,
            "seed": seed,
            "started": begun,
            "seconds": round(time.monotonic() - started, 1),
            "load": round(os.getloadavg()[1], 1),
            "faults": dict(faults),
            "served_again": [round(each, 2) for each in seconds],
            "failure": failure,
        }
        RESULTS.mkdir(parents=True, exist_ok=True)
        with (RESULTS / f"{commit}.jsonl").open("a") as file:
            file.write(json.dumps(run) + "\n")


def table(runs: Sequence[Run]) -> str:
    """How many faults each torture has tried, what has failed, and how long it took until all was served again."""
    lines = ["torture                     runs  faults  failed  served again: median  worst"]
    by_torture: dict[str, list[Run]] = defaultdict(list)
    for run in runs:
        by_torture[run["torture"]].append(run)
    for name, among in [*sorted(by_torture.items()), ("all", list(runs))]:
        faults = sum((Counter(run["faults"]) for run in among), Counter[str]())
        seconds = [each for run in among for each in run["served_again"]] or [0.0]
        bad = sum(bool(run["failure"]) for run in among)
        spread = f"{statistics.median(seconds):18.1f} s  {max(seconds):4.1f} s"
        lines.append(f"{name:26}  {len(among):4}  {faults.total():6}  {bad:6}  {spread}")
    lines += [f"{run['torture']}, seed {run['seed']}: {run['failure']}" for run in runs if run["failure"]]
    return "\n".join(lines)


def main() -> None:
    file = RESULTS / f"{tested_commit()}.jsonl"
    if not file.exists():
        raise SystemExit(f"there are no runs of {file.stem}")
    print(table([json.loads(line) for line in file.read_text().splitlines()]))


if __name__ == "__main__":
    main()
