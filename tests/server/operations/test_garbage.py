"""What the garbage collector of a server looks at: in a process of its own, since all of a process shares it."""

import subprocess
import sys
import textwrap

import pytest

PREPARED = """
import gc, weakref
from dynhull_server import garbage

class Thing:
    pass

def cycle():
    one, other = Thing(), Thing()
    one.other, other.other = other, one
    return one

def in_flight(things):
    for _ in range(300):  # they come and go
        waiting = [[] for _ in range(things)]

looked = []
def look(phase, info):
    if phase == "start":
        looked.append((info["generation"], len(gc.get_objects())))
"""


def run(program: str) -> None:
    subprocess.run([sys.executable, "-c", PREPARED + textwrap.dedent(program)], check=True, timeout=60)


def test_what_waits_for_its_commit_brings_no_collections() -> None:
    run("""
    with garbage.few_collections():
        gc.callbacks.append(look)
        in_flight(9_000)
        gc.callbacks.remove(look)
    assert len(looked) < 2, looked
    """)


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="Python looks at all objects bit by bit")
def test_all_objects_are_looked_at_seldom() -> None:
    run("""
    with garbage.few_collections():
        gc.callbacks.append(look)
        hulls = [[] for _ in range(100_000)]
        in_flight(30_000)
        gc.callbacks.remove(look)
    found = [objects for generation, objects in looked if generation == 2]
    assert len(found) > 2, looked
    assert sum(objects > 100_000 for objects in found) <= 2, found
    """)


def test_all_cycles_are_collected() -> None:
    run("""
    garbage.PAUSE_FACTOR = 0.0
    before = gc.get_threshold()
    with garbage.few_collections():
        kept = cycle()
        gone, later = weakref.ref(cycle()), weakref.ref(kept)
        gc.collect()
        assert gone() is None
        assert gc.get_freeze_count() > 0
        del kept
        assert later() is not None
        gc.collect()
        assert later() is None
    assert (gc.get_threshold(), gc.get_freeze_count(), len(gc.callbacks)) == (before, 0, 0)
    """)


def test_what_others_have_set_aside_stays_so() -> None:
    """As in a process of tests: to look at all that it has imported takes a second."""
    run("""
    gc.freeze()
    before = gc.get_freeze_count()
    with garbage.few_collections():
        pass
    assert gc.get_freeze_count() >= before > 0
    """)


def test_what_is_made_at_the_start_is_not_looked_at() -> None:
    run("""
    with garbage.few_collections():
        gc.callbacks.append(look)
        with garbage.without_collections():
            hulls = [[] for _ in range(100_000)]
        in_flight(9_000)
        assert gc.isenabled()
        gc.callbacks.remove(look)
    assert all(objects < 50_000 for _, objects in looked), looked
    """)
