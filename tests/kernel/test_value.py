"""Hulls on the kernel as values: copied, pickled, compared, subclassed, sent to other processes and implementations."""

import copy
import pickle
import subprocess
import sys
from os import pathsep
from pathlib import Path
from shutil import copytree, ignore_patterns

import numpy as np
import pytest

import dynhull
from dynhull import DynamicHull


@pytest.fixture
def hull():
    rows = np.random.default_rng(5).random((500, 2))
    hull = DynamicHull(np.concatenate([rows, rows[:50]]))
    hull.insert(2, 2)
    hull.delete(2, 2)
    return hull


@pytest.mark.parametrize(
    "duplicate", [DynamicHull.copy, copy.copy, copy.deepcopy, lambda hull: pickle.loads(pickle.dumps(hull))]
)
def test_copies_are_equal_and_independent(hull, duplicate):
    other = duplicate(hull)
    other.check()
    assert other == hull
    assert (other.changes, len(other), other.distinct) == (2, 550, 500)
    assert not other.insert(*hull.points()[0])
    assert other != hull
    assert other.insert(3, 3)
    other.insert_many(np.random.default_rng(6).random((2000, 2)))
    other.check()
    hull.check()
    assert (len(hull), hull.changes) == (550, 2)


def test_pickles_pass_between_implementations(hull, tmp_path):
    """Written here on the kernel, read and written again by the reference, read here."""
    path = tmp_path / "hull.pickle"
    path.write_bytes(pickle.dumps(hull))
    script = (
        "import pathlib, pickle, sys, dynhull\n"
        "path = pathlib.Path(sys.argv[1])\n"
        "hull = pickle.loads(path.read_bytes())\n"
        "assert dynhull.KERNEL == 'python'\n"
        "assert type(hull._tree).__module__ == 'dynhull._tree'\n"
        "hull.insert(7, 7)\n"
        "path.write_bytes(pickle.dumps(hull))\n"
    )
    subprocess.run([sys.executable, "-c", script, str(path)], check=True, env={"DYNHULL_KERNEL": "python"})
    returned = pickle.loads(path.read_bytes())
    assert type(returned._tree).__module__ == "dynhull._kernel"
    assert returned.changes == 3
    hull.insert(7, 7)
    assert returned == hull


def test_which_implementation():
    assert dynhull.KERNEL == "cpp"
    wrong = subprocess.run(
        [sys.executable, "-c", "import dynhull"], env={"DYNHULL_KERNEL": "rust"}, capture_output=True, text=True
    )
    assert 'DYNHULL_KERNEL must be "cpp" or "python", got \'rust\'' in wrong.stderr


@pytest.mark.parametrize(
    ("folder", "more", "why"),
    [
        ("source", {}, "it was imported from its source folder, "),
        ("copy", {}, "no C++ compiler was found when it was installed"),
        ("source", {"DYNHULL_KERNEL": "python"}, None),
    ],
)
def test_an_import_without_the_kernel_says_why(folder, more, why, tmp_path):
    """-S: without the finder of an editable installation, which finds the kernel of the source folder."""
    source = Path(__file__).parents[2]
    if folder == "copy":
        copytree(source / "dynhull", tmp_path / "dynhull", ignore=ignore_patterns("kernel", "*.so"))
    paths = [str(tmp_path if folder == "copy" else source), str(Path(np.__file__).parents[1])]
    run = subprocess.run(
        [sys.executable, "-S", "-c", "import dynhull; print(dynhull.KERNEL)"],
        env={"PYTHONPATH": pathsep.join(paths), **more},
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    assert run.stdout == "python\n"
    if why is None:
        assert run.stderr == ""
    else:
        assert (
            f"RuntimeWarning: dynhull has no C++ kernel here, so that all takes many times longer: {why}" in run.stderr
        )


@pytest.mark.every(5)
@pytest.mark.parametrize("given", ["65", "0", "-1", "two", "1.5"])
def test_a_wrong_number_of_threads(given):
    wrong = subprocess.run(
        [sys.executable, "-c", "import dynhull"], env={"DYNHULL_THREADS": given}, capture_output=True, text=True
    )
    assert f"DYNHULL_THREADS must be a number from 1 to 64, got {given!r}" in wrong.stderr


def test_a_number_that_is_not_a_double_is_still_checked(hull):
    """The kernel takes floats and small integers itself, and leaves the rest to dynhull.arrays."""
    with pytest.raises(ValueError, match="x is 9007199254740993: no double has this value"):
        hull.insert(2**53 + 1, 0)
    with pytest.raises(ValueError, match="y is nan"):
        hull.insert(0.0, float("nan"))
    assert hull.insert(2**53, -(2**53))
    assert (float(2**53), float(-(2**53))) in hull
    hull.insert(-0.0, 0.5)
    assert str(hull.points()[np.flatnonzero(hull.points()[:, 1] == 0.5)[0], 0]) == "0.0"


def test_a_thread_that_has_a_hull_at_the_end_of_its_program_is_no_complaint():
    """It is never destroyed, which nanobind would take for a fault of the bindings."""
    program = """
import threading
from dynhull import DynamicHull
def hold(hull, held):
    held.set()
    threading.Event().wait()
held = threading.Event()
threading.Thread(target=hold, args=(DynamicHull([[0, 0]]), held), daemon=True).start()
held.wait()
"""
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")
