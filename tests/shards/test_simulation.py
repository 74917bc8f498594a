"""A short run of the simulation, and that it finds faults of the protocol; `make robustness-cluster` runs far more."""

import pytest
from cases import slow
from shards.mutants import MUTANTS, found, mutated
from shards.simulation import World

SCHEDULES = 200
# The first seed: other schedules than those of the command line.
FIRST = 5 * 10**6
# Found within a few schedules.
QUICK = {
    "a process begins two roots in one epoch",
    "a process that was replaced begins a root above the next one",
    "a root chooses its epoch alone, above those that shards know of",
    "a refused batch is not undone",
    "a request is forgotten where a shard restarts",
    "a shard listens to a root that was replaced",
    "a shard replies before it has the step in its log",
    "an uncertain step stays after a root was lost",
    "an undone step stays in the log",
    "the root answers without a decision",
    "the root keeps no producers",
}


def test_no_promise_is_broken():
    for seed in range(FIRST, FIRST + SCHEDULES):
        World(seed).play()


@pytest.mark.parametrize("name", sorted(MUTANTS.keys() - QUICK))
def test_faults_can_be_put_in(name):
    mutated(name)


@slow
@pytest.mark.parametrize("name", sorted(QUICK))
def test_a_fault_is_found(name):
    assert found(name, schedules=100) is not None
