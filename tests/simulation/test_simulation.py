"""A short run of the simulation, everything that it has found, and that it finds what it should."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cases import slow

from simulation import shell_life, sqlite_store
from simulation.mutate import PATCHES, fits, hunt
from simulation.plan import random_plan
from simulation.play import play
from simulation.schedule import Schedule
from simulation.shrink import LEAST, shrunk

FINDINGS = {
    file.stem: json.loads(file.read_text())["plan"]
    for file in sorted((Path(__file__).parent / "findings").glob("*.json"))
}
# Plans of each layer, a few seconds together; `make simulate` has more.
PLANS = {"core": 30, "shell": 3, "sqlite": 2, "past": 2, "cluster": 10, "links": 5}
# The first seed: other plans than those of the command line.
FIRST = 5 * 10**6
# Faults that are found in a second, one in the pure state and one in a cluster; `make soak` has all of them.
QUICK = {"fence_not_restored", "hidden_is_dead"}


@pytest.mark.parametrize("layer", PLANS)
def test_no_promise_is_broken(layer):
    for seed in range(FIRST, FIRST + PLANS[layer]):
        outcome = play(random_plan(seed, layer))
        assert outcome.finding is None, f"seed {seed}: {outcome.where}"


@pytest.mark.parametrize(
    "finding",
    # Those of the pure state take a hundredth of a second.
    [pytest.param(name, marks=() if plan["layer"] == "core" else slow) for name, plan in FINDINGS.items()],
)
def test_what_was_found_stays_mended(finding):
    outcome = play(FINDINGS[finding])
    assert outcome.finding is None, outcome.where


@pytest.mark.parametrize("layer", ["shell", "cluster"])
def test_a_plan_that_goes_on_within_one_turn_is_a_finding(layer, monkeypatch):
    def go_on(_):
        while True:
            for _ in range(1000):
                pass

    monkeypatch.setattr(Schedule, "turn", go_on)
    outcome = play(random_plan(FIRST, layer), 0.2)
    assert outcome.finding == "EndlessError: it does not end within 0.2 s of processor time"
    assert "go_on" in outcome.where


def test_who_goes_on_without_a_pause_is_a_finding(monkeypatch):
    monkeypatch.setattr(shell_life, "ENDLESS", 1000)
    found = (play(random_plan(seed, "links")).finding or "" for seed in range(FIRST, FIRST + 100))
    assert any(each.endswith("waits for ever, while somebody goes on without a pause") for each in found)


@slow
def test_a_plan_with_a_finding_is_made_small_in_a_given_time(monkeypatch):
    monkeypatch.setattr(sqlite_store, "may_go", lambda *_: False)
    plan = random_plan(123000000120, "past")
    begun = time.process_time()
    small = shrunk(plan, 3.0)
    assert time.process_time() - begun < 3.0 + 2 * LEAST
    assert "goes, and should stay" in play(small).finding
    assert len(small["lives"]) < len(plan["lives"])


@slow
def test_a_plan_always_ends_the_same_way():
    command = [sys.executable, "-m", "simulation", "trace", "12"]  # two plans of each layer
    runs = [
        subprocess.Popen(
            command,
            cwd=Path(__file__).parents[1],
            env=os.environ | {"PYTHONHASHSEED": hash_seed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for hash_seed in ("1", "2")
    ]
    first, second = (run.communicate()[0] for run in runs)
    assert [run.returncode for run in runs] == [0, 0]
    assert len(set(first.split())) > 20
    assert second == first


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.stem)
def test_faults_can_be_put_back_in(patch):
    fits(patch)


@slow
@pytest.mark.parametrize("patch", [each for each in PATCHES if each.stem in QUICK], ids=lambda patch: patch.stem)
def test_a_fault_put_back_in_is_found(patch):
    assert hunt(patch, lives=1000).lives is not None
